"""What to use for an error of 1 %, 0.1 % or 1e-6: read from diagrams, as a table and as a page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from boomctl.files import Page
from boomctl.lab.benchmark.diagram import Diagram, Point, Way
from boomctl.report import Table, number, power

NAMES = (
    "Names: import boomctl as bc; p: parameters, bc.BoomParameters() of the boom, bc.HubBeamParameters() of the hub-beam;"
    ' actuators = ("actuator_left", "actuator_right"); tips = ("tip_left", "tip_right"); omega: frequencies [rad/s]; wheels:'
    ' {"actuator_left": ..., "actuator_right": ...}, motions at the instants time; t: instants [s]; P: a generalised plant;'
    " plant, controller, disturbance: the boom; beam = bc.hub_beam(p), pd: a sampled controller of it, wanted: its set point;"
    " u, y: samples of a record, dt: the time between them [s]."
)
"""What stands for what in the settings' calls."""

LEVELS = (1e-2, 1e-3, 1e-6)
"""Relative errors for which settings are recommended."""

HEADS = (
    "Wanted",
    "Write",
    "Its error",
    "New parameters",
    "Model ready",
    "Memory",
    "Best other, new parameters",
)
_ALIKE = 1.15  # times the shortest run time up to which the most exact is taken: medians differ by as much (a choice)
_SPACE = "\u00a0"  # between a number and its unit, where no line breaks
_BREAK = "\u200b"  # of no width, where a line may break
PAGE = Page(
    "<!-- what follows is written by `boomctl benchmark all --page` -->",
    "<!-- what precedes is written by `boomctl benchmark all --page` -->",
)


@dataclass(frozen=True)
class Recommendation:
    """A setting for an error.

    Attributes
    ----------
    diagram : Diagram
    wanted : float
        Largest error wanted.
    point : Point or None
        Ours: the most exact of those that take about as long as the fastest of those exact enough; None where none is.
    other : Point or None
        The fastest of the others that is exact enough.
    way : "cold" or "hot"
        In which they are compared: cold, where that was measured.
    """

    diagram: Diagram
    wanted: float
    point: Point | None
    other: Point | None
    way: Way


def recommendations(diagrams: Iterable[Diagram], levels: Sequence[float] = LEVELS) -> tuple[Recommendation, ...]:
    """Return the settings of all diagrams, level by level."""
    found = []
    for diagram in diagrams:
        way: Way = "cold" if any(p.ours and p.cold is not None for p in diagram.points) else "hot"
        ours = [p for p in diagram.points if p.ours and p.call]
        others = [p for p in diagram.points if not p.ours]
        for level in levels:
            best = diagram.cheapest(level, way, ours)
            if best is not None:
                limit = _ALIKE * (best.seconds(way) or 0.0)
                alike = [
                    p for p in ours if p.error <= level and (taken := p.seconds(way)) is not None and taken <= limit
                ]
                best = min(alike, key=lambda p: p.error)
            found.append(Recommendation(diagram, level, best, diagram.cheapest(level, way, others), way))
    return tuple(found)


def recommendation_table(found: Iterable[Recommendation]) -> Table:
    """Return the table of recommended settings."""
    caption = (
        "Run times are medians of processor time on the machine named below: of a call from new parameters, and of one more"
        " with the model ready. 'Best other' is the fastest other program that is as exact as wanted, and how many times as"
        f" long it takes. {NAMES}"
    )
    lines: list[tuple[str, ...]] = []
    before = None
    for each in found:
        if each.diagram is not before:
            lines.append((each.diagram.title,))
        *cells, other = recommended_cells(each)
        lines.append((*cells, other.replace("_", f"_{_BREAK}")))
        before = each.diagram
    return Table(HEADS, tuple(lines), caption, align="llrrrrl")


def recommended_cells(found: Recommendation) -> tuple[str, ...]:
    """Return what is wanted, what to write, error, run times, memory, and the best of the others, in words."""
    wanted, point = level_words(found.wanted), found.point
    if point is None:
        return (wanted, "none of ours is so exact", *[""] * 4, _other(found))
    return (
        wanted,
        point.call,
        error_words(point.error),
        duration(point.cold),
        duration(point.hot),
        memory_words(point.memory),
        _other(found),
    )


def _other(found: Recommendation) -> str:
    if found.other is None:
        return "none is so exact"
    name = f"{found.other.competitor}, {found.other.label}"
    mine = None if found.point is None else found.point.seconds(found.way)
    taken = found.other.seconds(found.way)
    return f"{name}: {number(taken / mine, 2)} times" if mine and taken else name


def level_words(level: float) -> str:
    """Return an error as it is spoken of: "0.1 %", "1e-6"."""
    return f"{100 * level:g} %" if level >= 1e-4 else f"{level:g}".replace("e-0", "e-")


def error_words(error: float) -> str:
    """Return an error with two digits, which no line breaks: "2.1·10⁻³"."""
    return power(error, 2) if error else "0"


def duration(seconds: float | None) -> str:
    """Return a run time with its unit."""
    if seconds is None:
        return ""
    scale, unit = (1.0, "s") if seconds >= 1.0 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "µs")
    return f"{scale * seconds:.3g}{_SPACE}{unit}"


def memory_words(size: int | None) -> str:
    """Return an amount of memory with its unit."""
    return "" if size is None else f"{size / 1e6:.3g}{_SPACE}MB"


def page_text(found: Sequence[Recommendation], machine: str) -> str:
    """Return the tables of the page, as Markdown, a table for each question."""
    parts = [f"Measured on: {machine}.", "", NAMES.replace("{", "`{").replace("}", "}`"), ""]
    for diagram in dict.fromkeys(each.diagram for each in found):
        parts += [
            f"### {diagram.title}",
            "",
            diagram.question,
            f"Error: {diagram.measure}",
            "",
            "| wanted | write | error | new parameters | model ready | memory | best other |",
            "|---|---|---|---|---|---|---|",
        ]
        for each in found:
            if each.diagram is diagram:
                wanted, call, *others = (cell.replace("|", " ") for cell in recommended_cells(each))
                parts.append(f"| {wanted} | {call if each.point is None else f'`{call}`'} | {' | '.join(others)} |")
        parts.append("")
    return "\n".join(parts)
