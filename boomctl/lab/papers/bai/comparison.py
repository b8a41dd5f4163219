"""What a part of the paper consists of: numbers beside ours and the rule by which they count as met, statements, charts."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from boomctl.arrays import Array

MET = "met"
CORRECTED = "met with corrected reading"
NOT_REPRODUCIBLE = "not reproducible"
ADDED = "not in the paper"


@dataclass(frozen=True)
class Comparison:
    """A published number beside the computed one.

    Attributes
    ----------
    where : str
        Table, figure or section of Bai et al. (2009).
    what : str
        Meaning of the number.
    unit : str
    published : float
        As printed.
    computed : float
        From correct equations, converged.
    reading : float or None
        What the paper should show if a slip named in `why` is mended: either the published number without its slip, or
        ours with the slip made on purpose; None if no slip is known.
    tolerance : float
        Largest difference that counts as met, in the unit.
    verdict : str
        "met", "met with corrected reading" or "not reproducible".
    why : str
        One line.
    """

    where: str
    what: str
    unit: str
    published: float
    computed: float
    reading: float | None
    tolerance: float
    verdict: str
    why: str


@dataclass(frozen=True)
class Claim:
    """A published curve or statement without a number, and whether our curves show it."""

    where: str
    published: str
    computed: str
    verdict: str
    why: str


MODEL_COLOURS = {
    "TLAM": "#d55e00",
    "SFOAM": "#0072b2",
    "SFOAM, consistent": "#56b4e9",
    "FOAM": "#009e73",
    "CFOAM": "#cc79a7",
    "exact": "#000000",
}
"""One colour a model, told apart by colour-blind readers too (Okabe & Ito 2008)."""

Place = Literal["", "best", "upper left", "upper right", "lower left", "lower right"]
"""Where a legend stands; "" is nowhere."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve: label, abscissae and ordinates, matplotlib line style, and colour (None: next of the cycle)."""

    label: str
    x: Array
    y: Array
    style: str = "-"
    colour: str | None = None


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves in one pair of axes.

    Attributes
    ----------
    title, ylabel : str
        Texts; the labels carry the units.
    lines : tuple of Line
    xlabel : str
        Of the abscissa, by default time.
    logarithmic : str
        "", "x", "y" or "xy".
    ylim : tuple of float, optional
        Range of the ordinate.
    levels : tuple of (float, str)
        Horizontal lines and what they mean.
    legend : Place
        Where the legend stands; "" for none.
    xticks : tuple of float
        Marks on a logarithmic abscissa, written out; () for matplotlib's.
    """

    title: str
    ylabel: str
    lines: tuple[Line, ...]
    xlabel: str = "time [s]"
    logarithmic: str = ""
    ylim: tuple[float, float] | None = None
    levels: tuple[tuple[float, str], ...] = ()
    legend: Place = "best"
    xticks: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels of curves in one figure: file name without ending, caption, panels, and how many of them stand in a row."""

    name: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = field(default=1)


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the paper: its charts, its numbers, its statements."""

    title: str
    charts: tuple[Chart, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    claims: tuple[Claim, ...] = ()


def peak(values: Array) -> float:
    """Return the largest size of a curve."""
    return float(np.max(np.abs(values)))


def compare(
    where: str,
    what: str,
    unit: str,
    published: float,
    computed: float,
    tolerance: float,
    why: str = "",
    *,
    mended: float | None = None,
    slipped: float | None = None,
) -> Comparison:
    """Judge a number.

    Parameters
    ----------
    where, what, unit : str
        As in `Comparison`.
    published, computed : float
        As printed, and ours.
    tolerance : float
        Largest difference that counts as met.
    why : str
        One line; the deviation if empty.
    mended : float, optional
        The published number without a slip of the print.
    slipped : float, optional
        Our number with the paper's slip made on purpose.

    Returns
    -------
    Comparison
        Met if ours agrees with the print; met with corrected reading if `mended` agrees with ours or `slipped` with the
        print; not reproducible otherwise.
    """
    if abs(computed - published) <= tolerance:
        verdict = MET
    elif (mended is not None and abs(computed - mended) <= tolerance) or (
        slipped is not None and abs(slipped - published) <= tolerance
    ):
        verdict = CORRECTED
    else:
        verdict = NOT_REPRODUCIBLE
    against = published if mended is None else mended
    deviation = f"differs by {100.0 * abs(computed / against - 1.0):.2g} %" if against else ""
    reading = mended if slipped is None else slipped
    return Comparison(
        where=where,
        what=what,
        unit=unit,
        published=published,
        computed=computed,
        reading=reading,
        tolerance=tolerance,
        verdict=verdict,
        why="; ".join(w for w in (why, deviation) if w),
    )


def judge(where: str, published: str, computed: str, holds: bool, why: str, *, corrected: bool = False) -> Claim:
    """Judge a statement: met (with a corrected reading) if it `holds`, else not reproducible."""
    return Claim(where, published, computed, (CORRECTED if corrected else MET) if holds else NOT_REPRODUCIBLE, why)
