"""The report of run time against error: what to use, whose front is ahead, all diagrams, growth, limits, how to reproduce."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, get_args

from boomctl.files import plain
from boomctl.lab.benchmark.precision.claim import conclusion, verdict_table, verdicts
from boomctl.lab.benchmark.precision.diagram import Diagram, Lead, Point, Way
from boomctl.lab.benchmark.precision.growth import Growth
from boomctl.lab.benchmark.precision.limits import Limit, Rates
from boomctl.lab.benchmark.precision.recommended import (
    Recommendation,
    duration,
    error_words,
    memory_words,
    page_text,
    recommendation_table,
    recommendations,
)
from boomctl.lab.benchmark.precision.scenes.lumped_masses import DISCRETE, FINITE
from boomctl.lab.benchmark.report import BenchmarkReport, Row, Sheet
from boomctl.report import Picture, Report, Section, Table, number

if TYPE_CHECKING:
    from rich.console import Group

_TITLE = "Run time against error"
_LUMPED = "lumped-masses-"
_WAY_WORDS: dict[Way, str] = {"cold": "from new parameters", "hot": "with the model ready"}


@dataclass(frozen=True)
class PrecisionReport:
    """All that a run measured.

    Attributes
    ----------
    diagrams : tuple of Diagram
    growths : tuple of Growth
    rates : Rates or None
        Of the machine, on one thread.
    limits : tuple of Limit
    environment : mapping of str to str
        Machine and versions.
    command : str
        What reproduces the run.
    seconds : float
        How long it took [s].
    """

    diagrams: tuple[Diagram, ...]
    growths: tuple[Growth, ...] = ()
    rates: Rates | None = None
    limits: tuple[Limit, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)
    command: str = "boomctl benchmark precision"
    seconds: float = 0.0

    @property
    def recommended(self) -> tuple[Recommendation, ...]:
        """What to use for each error wanted; diagrams of lumped masses are a study and recommend nothing."""
        return recommendations(d for d in self.diagrams if not d.key.startswith(_LUMPED))

    @property
    def lumped(self) -> dict[float, Diagram]:
        """The diagrams of lumped masses, by their mass over that of the beam."""
        found = {float(d.key.removeprefix(_LUMPED)): d for d in self.diagrams if d.key.startswith(_LUMPED)}
        return dict(sorted(found.items()))

    @property
    def benchmark(self) -> BenchmarkReport:
        """All points as rows that another run can be compared with."""
        rows = [
            Row(
                d.key,
                f"{p.competitor}, {p.label}, {way}",
                ours=p.seconds(way) if p.ours else None,
                peer=None if p.ours else p.seconds(way),
                error=p.error if p.ours else None,
                peer_error=None if p.ours else p.error,
            )
            for d in self.diagrams
            for p in d.points
            for way in get_args(Way)
            if (p.cold if way == "cold" else p.hot) is not None
        ]
        rows += [
            Row("growth", f"{g.what}, {size:g}", ours=s)
            for g in self.growths
            for size, s in zip(g.sizes, g.seconds, strict=True)
        ]
        rows += [Row("limits", limit.path, ours=limit.seconds) for limit in self.limits]
        return BenchmarkReport(tuple(rows), environment=self.environment, title="boomctl benchmark precision")

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON knows."""
        return plain(
            {
                "rows": self.benchmark.as_dict()["rows"],
                "diagrams": [_diagram_dict(diagram) for diagram in self.diagrams],
                "recommended": [
                    {
                        "scene": r.diagram.key,
                        "wanted": r.wanted,
                        "setting": None if r.point is None else asdict(r.point),
                        "best_other": None if r.other is None else asdict(r.other),
                    }
                    for r in self.recommended
                ],
                "growth": [{**asdict(g), "exponent": g.exponent, "verdict": g.verdict} for g in self.growths],
                "rates": None if self.rates is None else asdict(self.rates),
                "limits": [{**asdict(limit), "ratio": limit.ratio} for limit in self.limits],
                "lumped_masses": list(conclusion(self.lumped)),
                "environment": dict(self.environment),
                "command": self.command,
                "seconds": round(self.seconds, 1),
            }
        )

    def report(self) -> Report:
        """Return the report that stands alone."""
        lead = (
            "Run time and error belong together: each point below is one way to answer a question, measured in one run in"
            " which all take turns. First what to use for an error of 1 %, 0.1 % and 1e-6; then where this package is"
            " ahead of others and where it is not; then every diagram with all its points.",
        )
        sections = [
            Section("What to use", tables=(recommendation_table(self.recommended),)) if self.recommended else None,
            Section("Whose front is ahead", (_ahead_words(self.diagrams),), (_lead_table(self.diagrams),)),
            *(_diagram_section(d) for d in self.diagrams if d not in self.lumped.values()),
            self._claim_section(),
            *(_diagram_section(d) for d in self.lumped.values()),
            self._growth_section(),
            self._limit_section(),
            self._reproduce_section(),
        ]
        return Report(_TITLE, lead, tuple(s for s in sections if s is not None), self.as_dict())

    def page(self) -> str:
        """Return the tables of the page of recommended settings, as Markdown."""
        return page_text(self.recommended, _machine_words(self.environment))

    def render(self) -> "Group":
        """Return recommendations, leads, growth and limits, ready for ``rich.print``."""
        from rich.console import Group
        from rich.text import Text

        shown = [_sheet("What to use", recommendation_table(self.recommended))]
        shown.append(_sheet("Whose front is ahead", _lead_table(self.diagrams)))
        shown += [_sheet("How cost grows", _growth_table(self.growths))] if self.growths else []
        shown += [_sheet("Distance from the limit", _limit_table(self.limits))] if self.limits else []
        tables = BenchmarkReport((), tuple(shown)).sheet_tables()
        words = [_ahead_words(self.diagrams), *conclusion(self.lumped), *_missing(self.diagrams)]
        return Group(*tables, Text(), *(Text(f"- {line}") for line in words))

    def _claim_section(self) -> Section | None:
        if len(self.lumped) < 2:
            return None
        text = (
            "Anthonis & Ramon (2003) close with: 'Structures consisting of undeformable masses, interconnected by beams with"
            " negligible mass, fit better to the discrete element approach.' Here is an arm of two links, clamped at the"
            " shoulder, with a motor at the elbow and a payload at the tip that together are so many times heavier than"
            " the beam; the first two natural frequencies are wanted. Discrete elements are massless cubic beams with half"
            " of each element's mass at either end, finite elements have the consistent mass matrix.",
            *conclusion(self.lumped),
        )
        return Section(
            "Lumped masses on light beams: finite or discrete elements?",
            text,
            (verdict_table(verdicts(self.lumped)),),
            (_sizes_picture(self.lumped),),
        )

    def _growth_section(self) -> Section | None:
        if not self.growths:
            return None
        text = (
            "The exponent is the slope of run time over size on logarithmic axes, fitted to the upper half of the sizes: what"
            " a call costs beside the growing part makes it smaller.",
        )
        return Section("How cost grows", text, (_growth_table(self.growths),))

    def _limit_section(self) -> Section | None:
        if self.rates is None:
            return None
        text = (
            "For each of the hottest paths, what its method cannot do without is counted; the limit is the time that it takes"
            f" at the rates of this machine, on one thread: {self.rates.operations / 1e9:.3g}·10⁹ operations in a second in"
            f" matrix products, {self.rates.bytes / 1e9:.3g} GB/s copied, {self.rates.exponentials / 1e6:.3g}·10⁶ complex"
            " exponentials in a second. What lies above the limit: matrices too small for the full rate, NumPy's calls and"
            " temporary arrays, checks and certificates.",
        )
        return Section("Distance from the limit of arithmetic and memory", text, (_limit_table(self.limits),))

    def _reproduce_section(self) -> Section:
        text = (
            f"{self.command} (this run took {self.seconds:.0f} s). All settings of a scene answer once and are judged;"
            " then they take turns, on one thread, and the median of each stands for it. Processor time, that of processes"
            " waited for included; short calls are repeated to 20 ms a turn. Cold: a parameter is changed in each call, so"
            " that nothing kept from a call before serves it. Hot: the model is there, with what it keeps by itself.",
            "Memory is what Python and NumPy allocate in a call, at its peak; work space of compiled solvers is not in it.",
            *_missing(self.diagrams),
        )
        facts = Table(("", ""), tuple((name, str(value)) for name, value in self.environment.items()), align="ll")
        return Section("Machine, versions, and how to reproduce", text, (facts,))


def _diagram_dict(diagram: Diagram) -> dict[str, Any]:
    return {
        **asdict(diagram),
        "fronts": {way: [f"{p.competitor}, {p.label}" for p in diagram.front(way)] for way in get_args(Way)},
        "leads": {way: [asdict(lead) for lead in diagram.leads(way)] for way in get_args(Way)},
    }


def _diagram_section(diagram: Diagram) -> Section:
    text = (diagram.question, f"Error: {diagram.measure}", *diagram.remarks)
    text += tuple(words for way in get_args(Way) if (words := lead_words(diagram, way)))
    text += diagram.missing
    return Section(diagram.title, text, (_point_table(diagram),), (_picture(diagram),))


def _picture(diagram: Diagram) -> Picture:
    from boomctl.plotting.canvas import picture
    from boomctl.plotting.studies.precision import precision_figure

    caption = "Lower left is better. Full lines: this package; dashed: others; grey: the front of all."
    return picture(diagram.key, precision_figure(diagram), caption)


def _sizes_picture(lumped: Mapping[float, Diagram]) -> Picture:
    from boomctl.plotting.canvas import picture
    from boomctl.plotting.studies.precision import sizes_figure

    named = {f"masses {ratio:g} x the beam's" if ratio else "the beam alone": d for ratio, d in lumped.items()}
    names = (FINITE, DISCRETE, "high-order elements")
    caption = (
        "Error of the first two natural frequencies over the number of unknowns that move with a mass of their own."
    )
    return picture("lumped-masses", sizes_figure(named, names), caption)


def _point_table(diagram: Diagram) -> Table:
    fronts = {way: diagram.front(way) for way in get_args(Way)}
    lines = []
    for p in diagram.points:
        on = ", ".join(way for way in get_args(Way) if p in fronts[way])
        error = p.failed or error_words(p.error)
        lines.append((p.competitor, p.label, error, duration(p.cold), duration(p.hot), memory_words(p.memory), on))
    heads = ("Competitor", "Setting", "Error", "Cold", "Hot", "Memory", "On the front")
    return Table(heads, tuple(lines), align="llrrrrl")


def lead_words(diagram: Diagram, way: Way) -> str:
    """Return in a sentence whether our front is ahead of the others', over the whole range of errors."""
    leads = diagram.leads(way)
    if not leads:
        return ""
    behind = [lead for lead in leads if lead.ratio < 1.0]
    if not behind:
        least = min(leads, key=lambda lead: lead.ratio)
        return (
            f"{_WAY_WORDS[way].capitalize()}, our front is ahead of all others over the whole range of their errors, by"
            f" {number(least.ratio, 2)} times at least ({_at(least)})."
        )
    worst = min(behind, key=lambda lead: lead.ratio)
    beyond, at = [lead for lead in behind if lead.ours is None], [lead.error for lead in behind]
    words = (
        f"{_WAY_WORDS[way].capitalize()}, our front is NOT ahead at {len(behind)} of {len(leads)} points of theirs: "
    )
    if beyond:
        return words + f"none of ours is as exact as {_at(beyond[-1])}."
    return words + (
        f"errors from {error_words(min(at))} to {error_words(max(at))}, most at"
        f" {_at(worst)}, where we take {number(1.0 / worst.ratio, 2)} times as long, {_excess(worst, way)} more."
    )


def _at(lead: Lead) -> str:
    return f"{error_words(lead.error)}, {lead.other.competitor}, {lead.other.label}"


def _excess(lead: Lead, way: Way) -> str:
    """Return how much longer ours takes."""
    ours, other = None if lead.ours is None else lead.ours.seconds(way), lead.other.seconds(way)
    return duration((ours or 0.0) - (other or 0.0))


def _ahead_words(diagrams: tuple[Diagram, ...]) -> str:
    """Return on how many diagrams our front is ahead of all others over the whole range of their errors."""
    judged = [(d, way, leads) for d in diagrams for way in get_args(Way) if (leads := d.leads(way))]
    behind = [f"{d.key} ({way})" for d, way, leads in judged if any(lead.ratio < 1.0 for lead in leads)]
    words = f"Our front is ahead of all competitors, over the whole range of their errors, on {len(judged) - len(behind)} of"
    return f"{words} {len(judged)} panels" + (f"; not on {', '.join(behind)}." if behind else ".")


def _lead_table(diagrams: tuple[Diagram, ...]) -> Table:
    lines = []
    for diagram in diagrams:
        for way in get_args(Way):
            leads = diagram.leads(way)
            if not leads:
                continue
            least, most = (pick(leads, key=lambda lead: lead.ratio) for pick in (min, max))
            ends = [lead.error for lead in leads]
            lines.append(
                (
                    diagram.key,
                    way,
                    f"{error_words(max(ends))} to {error_words(min(ends))}",
                    "yes" if least.ratio >= 1.0 else "NO",
                    _times(least.ratio),
                    f"{_at(least)}; ours: {_named(least.ours)}",
                    _times(most.ratio),
                )
            )
    heads = ("Scene", "Panel", "Errors of others", "Ahead", "Least lead", "where", "Largest lead")
    return Table(heads, tuple(lines), align="lllrrlr", shades={"NO": "#f9d6d5", "yes": "#e3f4e3"})


def _times(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.2g}"


def _named(point: Point | None) -> str:
    return "none so exact" if point is None else f"{point.competitor}, {point.label}"


def _growth_table(growths: tuple[Growth, ...]) -> Table:
    lines = tuple(
        (
            g.what,
            f"{g.sizes[0]:,.0f} to {g.sizes[-1]:,.0f}",
            f"{duration(g.seconds[0])} to {duration(g.seconds[-1])}",
            f"{g.exponent:.2f}",
            f"{g.expected:g}",
            g.verdict,
            g.why,
        )
        for g in growths
    )
    heads = ("What", "Sizes", "Run time", "Exponent", "Expected", "Verdict", "Expected for")
    return Table(heads, lines, align="llrrrll", shades={"grows FASTER than expected": "#f9d6d5"})


def _limit_table(found: tuple[Limit, ...]) -> Table:
    lines = tuple(
        (limit.path, limit.counted, duration(limit.seconds), duration(limit.least), f"{limit.ratio:.3g}", limit.bound)
        for limit in found
    )
    return Table(("Path", "Counted", "Run time", "Limit", "Times the limit", "Limited by"), lines, align="llrrrl")


def _sheet(title: str, table: Table) -> Sheet:
    return Sheet(title, table.heads, tuple((*line, *[""] * (len(table.heads) - len(line))) for line in table.lines))


def _missing(diagrams: tuple[Diagram, ...]) -> tuple[str, ...]:
    return tuple(f"Missing: {words}" for words in dict.fromkeys(words for d in diagrams for words in d.missing))


def _machine_words(environment: Mapping[str, str]) -> str:
    names = ("processor", "system", "python", "numpy", "scipy")
    return ", ".join(f"{name} {environment[name]}" for name in names if name in environment)
