"""Figures with one look, and their bytes."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from cycler import cycler
from matplotlib.figure import Figure

from boomctl.report import Picture

COLOURS = ("#0b559f", "#c8501e", "#3a7d34", "#7b3fa0", "#8a6d00", "#444444")

_LOOK: dict[Any, Any] = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.prop_cycle": cycler(color=list(COLOURS)),
    "font.size": 9,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "savefig.dpi": 150,
    "svg.hashsalt": "boomctl",
}


@contextmanager
def style() -> Iterator[None]:
    """Draw with the project's look; the caller's settings come back afterwards."""
    with mpl.rc_context(_LOOK):
        yield


def new_figure(width: float = 7.0, height: float = 4.2) -> Figure:
    """Return an empty figure of ``width`` by ``height`` inches that belongs to no window."""
    return Figure(figsize=(width, height), layout="constrained")


def picture(name: str, figure: Any, caption: str, *kinds: str) -> Picture:
    """Return a figure as a picture of a report, with a file of each kind, by default SVG and PNG; the first is shown."""
    files = {}
    for kind in kinds or ("svg", "png"):
        files[kind] = figure_bytes(figure, kind)
        figure.set_layout_engine("none")  # places are found now, and take as long as drawing
    return Picture(name, caption, files)


def figure_bytes(figure: Any, kind: str) -> bytes:
    """Return a figure as a file's content, ``kind`` ``"png"`` or ``"svg"``."""
    buffer = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {}
    figure.savefig(buffer, format=kind, metadata=metadata)
    return buffer.getvalue()
