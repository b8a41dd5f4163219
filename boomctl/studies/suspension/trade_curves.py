"""What a suspension's numbers cost each other: what is asked for, and what was found, as records."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from math import inf
from typing import TYPE_CHECKING, Any

from boomctl.checks import function_of, instance, known, real, sequence, shown
from boomctl.printing import compact

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from boomctl.arrays import Array

OVER = {"asked": "", "effort": "force over platform [N/m]", "force": "largest force of the run [N]"}
"""What peaks may be drawn over, and what it is called; "asked" is called what the curve says."""
HALVES = ("jolt", "yaw")


@dataclass(frozen=True)
class TradeCurve:
    """Suspensions that differ in one number: what a design file's function ``trade_off()`` returns a tuple of.

    Attributes
    ----------
    name, title : str
        A name in one word, for files, and what the curve shows in a line.
    asked : str
        The number that is asked for, with its unit.
    values : sequence of float
        What is asked for.
    make : callable
        A function of one of them that returns a `SuspensionDesign`.
    chosen : float, optional
        The value that the design of the file itself has; it is not made again.
    half : "jolt" or "yaw", optional
        Whose peaks are drawn; by default the larger ones.
    over : "asked", "effort" or "force"
        What peaks are drawn over: the number asked for, the certified largest force over the motion of the platform [N/m],
        which elastic modes may decide, or the largest force of the run [N].
    beside : sequence of str
        Designs by name, or files of your own, to be set beside.

    Raises
    ------
    TypeError, ValueError
        Other kinds; no values, or one that is there twice; a chosen one that is not among them.

    Examples
    --------
    >>> import boomctl as bc
    >>> from boomctl.studies.suspension import TradeCurve
    >>> def softer(share):
    ...     return bc.SuspensionDesign("soft", "softer", bc.BoomParameters(spring_stiffness=1100.0 * share))
    >>> TradeCurve("spring", "what soft springs are worth", "springs, relative", (1.0, 0.5), softer).values
    (0.5, 1.0)
    """

    name: str
    title: str
    asked: str
    values: tuple[float, ...]
    make: Callable[[float], Any]
    chosen: float | None = None
    half: str | None = None
    over: str = "asked"
    beside: tuple[str, ...] = ()

    __repr__ = compact

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name.isidentifier()):
            raise ValueError(
                f"name = {shown(self.name)}: expected a word of letters, digits and _, for files are called so"
            )
        instance("title", self.title, str)
        instance("asked", self.asked, str)
        function_of("make", self.make, "a value asked for, to a SuspensionDesign")
        values = tuple(sorted(real("value", each) for each in sequence("values", self.values, "numbers")))
        if not values or len(set(values)) < len(values):
            raise ValueError(f"values = {list(values)}: expected at least one, each of them once")
        object.__setattr__(self, "values", values)
        if self.chosen is not None and self.chosen not in values:
            raise ValueError(f"chosen = {self.chosen!r}: expected one of the values {list(values)}, or None")
        if self.half is not None:
            known("half", self.half, HALVES)
        known("over", self.over, OVER)
        beside = tuple(instance("beside", each, str) for each in sequence("beside", self.beside, "names of designs"))
        object.__setattr__(self, "beside", beside)


@dataclass(frozen=True)
class HalfNumbers:
    """What one half of a suspension is worth, jolt or yaw, or the larger numbers of both.

    Attributes
    ----------
    peak : float
        Certified peak from platform to tips in the middle of the box.
    worst_found, worst_bound : float or None
        Largest peak found over springs of 70 to 130 % and a boom mass of 80 to 120 %, and what none is above, proved;
        infinite where a loop is unstable or nothing is proved, None where it was not looked for.
    effort : float
        Certified largest force over the motion of the platform [N/m]; 0 of a passive suspension.
    force : float
        Largest force of an actuator in the run by this half alone [N].
    """

    peak: float
    worst_found: float | None
    worst_bound: float | None
    effort: float
    force: float

    __repr__ = compact

    @property
    def worst(self) -> float | None:
        """The proved worst peak, or the one found where none is proved."""
        return self.worst_bound if self.worst_bound is not None and self.worst_bound < inf else self.worst_found

    def as_dict(self) -> dict[str, float | None]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names and numbers.
        """
        return {
            "peak": self.peak,
            "worst_found": self.worst_found,
            "worst_upper_bound": None if self.worst_bound == inf else self.worst_bound,
            "effort": self.effort,
            "force": self.force,
        }


@dataclass(frozen=True)
class TradePoint:
    """What one suspension of a trade-off is worth.

    Attributes
    ----------
    label : str
        What it is called: the number asked for, or the name of a design.
    asked : float or None
        The number that was asked for; None of a design that is set beside.
    states : int
        Of its controller; 0 of a passive one.
    jolt, yaw : HalfNumbers
        Of either half.
    deposit_cv, force, stroke : float
        Of the run over the field; force [N] and stroke [m] are the largest ones.
    """

    label: str
    asked: float | None
    states: int
    jolt: HalfNumbers
    yaw: HalfNumbers
    deposit_cv: float
    force: float
    stroke: float

    __repr__ = compact

    def of(self, half: str | None) -> HalfNumbers:
        """Return the numbers of a half, or the larger ones of both.

        Parameters
        ----------
        half : "jolt", "yaw" or None
            Which half; None: of each number the larger one.

        Returns
        -------
        HalfNumbers
            Peaks and effort.
        """
        if half is not None:
            return {"jolt": self.jolt, "yaw": self.yaw}[half]

        def larger(one: float | None, other: float | None) -> float | None:
            return None if one is None or other is None else max(one, other)

        return HalfNumbers(
            max(self.jolt.peak, self.yaw.peak),
            larger(self.jolt.worst_found, self.yaw.worst_found),
            larger(self.jolt.worst_bound, self.yaw.worst_bound),
            max(self.jolt.effort, self.yaw.effort),
            self.force,
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names and numbers.
        """
        return {
            "name": self.label,
            "asked": self.asked,
            "states": self.states,
            **self.of(None).as_dict(),
            "jolt": self.jolt.as_dict(),
            "yaw": self.yaw.as_dict(),
            "deposit_cv": self.deposit_cv,
            "stroke": self.stroke,
        }


@dataclass(frozen=True)
class TradeLine:
    """What was found along a curve.

    Attributes
    ----------
    name, title, asked : str
        As of the `TradeCurve`.
    half : "jolt", "yaw" or None
        Whose peaks are drawn; None: the larger ones.
    over : "asked", "effort" or "force"
        What they are drawn over.
    chosen : float or None
        The value that the design itself has.
    points, beside : tuple of TradePoint
        What was found, in the order of what was asked for, and the designs set beside.
    failures : mapping of str to str
        What failed, by its label, and why.
    static : float
        The static gain from platform to tips, which no suspension that centres the boom on the platform goes below.
    """

    name: str
    title: str
    asked: str
    half: str | None
    over: str
    chosen: float | None
    points: tuple[TradePoint, ...]
    beside: tuple[TradePoint, ...]
    failures: Mapping[str, str] = field(default_factory=dict)
    static: float = 0.0

    __repr__ = compact

    @property
    def abscissa(self) -> str:
        """What peaks are drawn over, in words."""
        whose = "" if self.half is None or self.over == "asked" else f"{self.half}: "
        return whose + (self.asked if self.over == "asked" else OVER[self.over])

    def place(self, point: TradePoint) -> float:
        """Return where a point lies on the abscissa of peaks over effort or force.

        Parameters
        ----------
        point : TradePoint
            One of the points or of the designs beside.

        Returns
        -------
        float
            Force over the motion of the platform [N/m], or the largest force of the run [N].
        """
        found = point.of(self.half)
        return found.force if self.over == "force" else found.effort

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names and numbers.
        """
        return {
            "title": self.title,
            "asked": self.asked,
            "chosen": self.chosen,
            "points": [point.as_dict() for point in self.points],
            "beside": [point.as_dict() for point in self.beside],
            "failures": dict(self.failures),
        }

    def plot(self, ax: Any = None, **style: Any) -> Array | Axes:
        """Draw the curve: peaks, deposit CV and force over the number asked for, or peaks over effort or force.

        Parameters
        ----------
        ax : matplotlib Axes, sequence of them or a figure, optional
            Three over the number asked for, otherwise one; by default a new figure of pyplot.
        **style
            Of the lines, as matplotlib's lines take it.

        Returns
        -------
        Axes or (3,) ndarray of Axes
            Those drawn on, of matplotlib.
        """
        return import_module("boomctl.plotting.studies.trade_off").plot_trade_line(self, ax, **style)
