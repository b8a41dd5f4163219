"""Comparisons with the paper: numbers with tolerances, statements, charts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from boomctl.arrays import Array

MET = "met"
CORRECTED = "met with corrected reading"
NOT_REPRODUCIBLE = "not reproducible"
ADDED = "not in the paper"

APPROXIMATE = 0.1
"""Share by which a number that was read off a curve, or is called approximate, may differ."""


@dataclass(frozen=True)
class Comparison:
    """A published and a computed number.

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
        The published number with the misprint in `why` corrected, or the computed number with the misprint; None if no
        misprint is known.
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


MODELS = {
    "TLAM": "tlam",
    "SFOAM": "sfoam",
    "SFOAM, consistent": "sfoam-consistent",
    "FOAM": "foam",
    "CFOAM": "cfoam",
    "exact": "geometrically-exact",
}
"""Models of the hub-beam by the name that pictures show."""

_FORMATS = {
    "TLAM": "C1-",
    "SFOAM": "C0-",
    "SFOAM, consistent": "C4--",
    "FOAM": "C2--",
    "CFOAM": "C3-",
    "exact": "k:",
    "SFOAM, 1 mode": "C3:",
}
"""One color and dash a model, as matplotlib writes them."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve: label, abscissae, ordinates, and its look in matplotlib's short form, such as "C1--"."""

    label: str
    x: Array
    y: Array
    look: str = "-"


def lines(x: Array, curves: Mapping[str, Array], markers: Sequence[str] = ("",)) -> tuple[Line, ...]:
    """Return curves by label over one abscissa, with these markers in turn; those of models in the models' colors."""
    marked = zip(curves.items(), cycle(markers), strict=False)
    return tuple(Line(name, x, y, _FORMATS.get(name, "-") + marker) for (name, y), marker in marked)


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
    legend : str
        Position of the legend; "" for none.
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
    legend: str = "best"
    xticks: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the paper: its figure, its numbers, its statements.

    Attributes
    ----------
    title : str
    name, caption : str
        File name without suffix, and caption.
    panels : tuple of Panel
        Of the figure; none without one.
    comparisons : tuple of Comparison
    claims : tuple of Claim
    columns : int
        Panels in a row.
    """

    title: str
    name: str = ""
    caption: str = ""
    panels: tuple[Panel, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    claims: tuple[Claim, ...] = ()
    columns: int = 2


def peak(values: Array) -> float:
    """Return the largest size of a curve."""
    return float(np.max(np.abs(values)))


def compare(
    where: str,
    what: str,
    unit: str,
    published: float,
    computed: float,
    why: str = "",
    *,
    tolerance: float | None = None,
    corrected: float | None = None,
    slipped: float | None = None,
) -> Comparison:
    """Compare a number.

    Parameters
    ----------
    where, what, unit : str
        As in `Comparison`.
    published, computed : float
        As printed, and ours.
    why : str
        One line; the deviation if empty.
    tolerance : float, optional
        Largest difference. If None, a tenth of the published number with its misprint corrected.
    corrected : float, optional
        The published number with its misprint corrected.
    slipped : float, optional
        Our number with the paper's slip made on purpose.

    Returns
    -------
    Comparison
        Met if both numbers agree; met with corrected reading if `corrected` agrees with the computed number or `slipped` with
        the published one; not reproducible otherwise.
    """
    against, verdict = published if corrected is None else corrected, NOT_REPRODUCIBLE
    tolerance = APPROXIMATE * against if tolerance is None else tolerance
    if abs(computed - published) <= tolerance:
        verdict = MET
    elif (corrected is not None and abs(computed - corrected) <= tolerance) or (
        slipped is not None and abs(slipped - published) <= tolerance
    ):
        verdict = CORRECTED
    deviation = f"differs by {100.0 * abs(computed / against - 1.0):.2g} %" if against else ""
    reading = corrected if slipped is None else slipped
    reasons = "; ".join(w for w in (why, deviation) if w)
    return Comparison(where, what, unit, published, computed, reading, tolerance, verdict, reasons)


def check_statement(
    where: str, published: str, computed: str, holds: bool, why: str, *, corrected: bool = False
) -> Claim:
    """Compare a statement: met (with a corrected reading) if it `holds`, else not reproducible."""
    return Claim(where, published, computed, (CORRECTED if corrected else MET) if holds else NOT_REPRODUCIBLE, why)
