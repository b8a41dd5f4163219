"""Where discrete elements are better on lumped masses: read from diagrams of error against the number of unknowns."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import log

from boomctl.lab.benchmark.precision.diagram import Diagram, Point
from boomctl.lab.benchmark.precision.recommended import LEVELS, error_words, level_words
from boomctl.lab.benchmark.precision.scenes.lumped_masses import DISCRETE, FINITE
from boomctl.report import Table


@dataclass(frozen=True)
class Verdict:
    """Who needs fewer unknowns, and who less time, for an error at a ratio of masses.

    Attributes
    ----------
    ratio, wanted : float
        Lumped mass over beam mass; largest error.
    finite, discrete : Point or None
        The fewest unknowns of either that do.
    fast_finite, fast_discrete : Point or None
        The fastest of either that does, from new parameters.
    """

    ratio: float
    wanted: float
    finite: Point | None
    discrete: Point | None
    fast_finite: Point | None
    fast_discrete: Point | None

    @property
    def fewer(self) -> str:
        """Who needs fewer unknowns: "discrete", "finite", "both alike" or "none"."""
        return _winner(*(None if p is None else p.size for p in (self.finite, self.discrete)))

    @property
    def faster(self) -> str:
        """Who takes less time."""
        return _winner(*(None if p is None else p.seconds("cold") for p in (self.fast_finite, self.fast_discrete)))


def _winner(finite: float | None, discrete: float | None) -> str:
    if finite is None or discrete is None:
        return "none" if finite is discrete else "discrete" if finite is None else "finite"
    return "both alike" if finite == discrete else "discrete" if discrete < finite else "finite"


def verdicts(diagrams: Mapping[float, Diagram]) -> tuple[Verdict, ...]:
    """Return the verdicts of all ratios, ascending, level by level."""
    found = []
    for ratio, diagram in sorted(diagrams.items()):
        both = [diagram.competitors.get(name, ()) for name in (FINITE, DISCRETE)]
        for level in LEVELS:
            within = [[p for p in points if p.error <= level and p.size is not None] for points in both]
            smallest = [min(points, key=lambda p: p.size or 0, default=None) for points in within]
            fastest = [diagram.cheapest(level, "cold", points) for points in both]
            found.append(Verdict(ratio, level, *smallest, *fastest))
    return tuple(found)


def conclusion(diagrams: Mapping[float, Diagram]) -> tuple[str, ...]:
    """Return what the data say of the paper's closing claim, in sentences."""
    found = verdicts(diagrams)
    if not found:
        return ()
    better = [v for v in found if v.fewer == "discrete"]
    said = [
        f"Of {len(found)} cases (ratio of masses, error wanted), discrete elements need fewer unknowns in {len(better)},"
        f" finite elements in {sum(v.fewer == 'finite' for v in found)}; discrete elements take less time in"
        f" {sum(v.faster == 'discrete' for v in found)}."
    ]
    for level in LEVELS:
        ratios = [v.ratio for v in better if v.wanted == level]
        words = f"For {level_words(level)}: discrete elements need fewer unknowns"
        if ratios:
            said.append(f"{words} where the lumped masses are {', '.join(f'{r:g}' for r in ratios)} times the beam's.")
        else:
            said.append(f"{words} at none of the ratios tried.")
    sizes = [v.discrete.size for v in better if v.discrete is not None and v.discrete.size is not None]
    if sizes:
        said.append(
            f"Where they do, they get by with {max(sizes)} unknowns or fewer: a node without a slope that has mass is one"
            " unknown less."
        )
    return (*said, *_falls(diagrams))


def _falls(diagrams: Mapping[float, Diagram]) -> Iterator[str]:
    """Yield how the error of the coarsest mesh falls with the ratio of masses, between the two largest."""
    ratios = sorted(ratio for ratio in diagrams if ratio > 0.0)[-2:]
    if len(ratios) < 2:
        return
    for name in (FINITE, DISCRETE):
        first, last = (diagrams[ratio].competitors[name][0] for ratio in ratios)
        power = log(first.error / last.error) / log(ratios[1] / ratios[0])
        yield (
            f"From {ratios[0]:g} to {ratios[1]:g} times the beam's mass the error of {name} on the coarsest mesh,"
            f" {first.label}, falls from {error_words(first.error)} to {error_words(last.error)}, as the ratio to the power"
            f" {-power:.2f}."
        )


def verdict_table(found: tuple[Verdict, ...]) -> Table:
    """Return the table of the verdicts."""

    def words(point: Point | None) -> tuple[str, str]:
        return ("", "") if point is None else (str(point.size), error_words(point.error))

    lines = tuple(
        (f"{v.ratio:g}", level_words(v.wanted), *words(v.finite), *words(v.discrete), v.fewer, v.faster) for v in found
    )
    heads = (
        "Lumped over beam mass",
        "Wanted",
        "Unknowns, finite",
        "Error",
        "Unknowns, discrete",
        "Error",
        "Fewer",
        "Faster",
    )
    return Table(heads, lines, align="llrrrrll")
