"""The table of a stress run: for the terminal, as JSON, as a report that stands alone, and as a page of known limits."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

from boomctl.files import Page
from boomctl.lab.stress.case import Line, Outcome
from boomctl.report import Report, Section, Table

if TYPE_CHECKING:
    from rich.console import Group

PAGE = Page(
    "<!-- what follows is written by `boomctl stress --page` -->",
    "<!-- what precedes is written by `boomctl stress --page` -->",
)
_REASON = 90  # letters of a reason in a table; the report has all of it
_SHADES = {"held": "#e3f4e3", "refused": "#eef1f5", "uncertified": "#fff4d6", "BROKEN": "#f9d6d5"}


@dataclass(frozen=True)
class StressReport:
    """All lines of a run, and how long it took [s]."""

    lines: tuple[Line, ...]
    seconds: float

    @property
    def broken(self) -> tuple[Line, ...]:
        """The lines that are neither held, nor refused with a reason, nor said to be uncertain."""
        return tuple(line for line in self.lines if line.outcome is Outcome.BROKEN)

    @property
    def summary(self) -> str:
        """How many lines ended how."""
        counted = Counter(line.outcome for line in self.lines)
        words = ", ".join(f"{counted[outcome]} {outcome}" for outcome in Outcome if counted[outcome])
        return f"{len(self.lines)} rows in {self.seconds:.0f} s: {words}"

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON knows."""
        return {
            "rows": [
                {
                    "area": line.case.area,
                    "what": line.case.what,
                    "amount": line.case.amount,
                    "promise": line.case.promise,
                    "measure": line.case.measure,
                    "outcome": str(line.outcome),
                    "error": line.error,
                    "said": line.said,
                    "seconds": round(line.seconds, 3),
                }
                for line in self.lines
            ],
            "outcomes": {str(o): sum(line.outcome is o for line in self.lines) for o in Outcome},
            "broken": [line.case.name for line in self.broken],
            "seconds": round(self.seconds, 1),
        }

    def render(self) -> "Group":
        """Return the table for a terminal, one line for amounts that ended alike."""
        from rich.console import Group
        from rich.markup import escape
        from rich.table import Table as Shown
        from rich.text import Text

        shown = Shown(title="boomctl stress", title_justify="left", pad_edge=False, box=None, padding=(0, 1))
        for head in ("what was tried", "promised", "seen", "outcome"):
            shown.add_column(head, overflow="fold", justify="right" if head in ("promised", "seen") else "left")
        colours = {Outcome.HELD: "green", Outcome.BROKEN: "bold red", Outcome.UNCERTIFIED: "yellow"}
        for area, lines in _gathered(self.lines, lambda line: line.case.area):
            shown.add_row(f"[bold]{escape(area)}[/bold]")
            for what, rows in _gathered(lines, lambda line: line.case.what):
                for outcome, alike in groupby(rows, lambda line: line.outcome):
                    run = list(alike)
                    colour = colours.get(outcome, "default")
                    ended = f"[{colour}]{outcome}[/{colour}]"
                    reason = f" {escape(_short(run[0].said))}" if outcome is not Outcome.HELD else ""
                    shown.add_row(
                        f"  {escape(what)}, {escape(_span(run))}", _promises(run), _errors(run), ended + reason
                    )
        return Group(shown, Text(), Text(self.summary, style="bold"))

    def report(self) -> Report:
        """Return the report: a table for each area, every line in it."""
        lead = (
            "Each row is one case: what was tried, the largest error that is promised, the error seen against a reference"
            " that shares nothing with the package, and how it ended: held, refused with a reason, said to be uncertain,"
            " or broken.",
            self.summary + ".",
        )
        heads = ("What was tried", "Amount", "Promised", "Seen", "Outcome", "Measure", "Said", "Seconds")
        sections = [
            Section(
                area,
                tables=(Table(heads, tuple(map(_cells, lines)), align="llrrlllr", shades=_SHADES),),
            )
            for area, lines in _gathered(self.lines, lambda line: line.case.area)
        ]
        return Report("What was tried where it is hardest", lead, tuple(sections), self.as_dict())

    def page(self) -> str:
        """Return the tables of the page of known limits, as Markdown."""
        parts = [f"{self.summary}.", ""]
        for area, lines in _gathered(self.lines, lambda line: line.case.area):
            parts += [f"### {area}", "", "| what was tried | error measured | outcome |", "|---|---|---|"]
            for what, rows in _gathered(lines, lambda line: line.case.what):
                ended = "; ".join(
                    _told(list(alike)) for _, alike in groupby(rows, lambda line: (line.outcome, _reason_key(line)))
                )
                parts.append(f"| {_plain(what)} | {_plain(rows[0].case.measure)} | {ended} |")
            parts.append("")
        return "\n".join(parts)


def _gathered(lines: Iterable[Line], key: Callable[[Line], str]) -> Iterator[tuple[str, list[Line]]]:
    """Gather lines of one area, or of one thing tried, in the order of first appearance."""
    gathered: dict[str, list[Line]] = {}
    for line in lines:
        gathered.setdefault(key(line), []).append(line)
    return iter(gathered.items())


def _span(run: list[Line]) -> str:
    """Return the amounts of a run, from the first to the last; what is not a number is said once."""
    first, last = run[0].case.amount, run[-1].case.amount
    if len(run) == 1:
        return first
    words, other = first.split(), last.split()
    while other[1:] and words[0] == other[0] and not words[0][0].isdigit():
        words, other = words[1:], other[1:]
    return f"{first} to {' '.join(other)}"


def _promises(run: list[Line]) -> str:
    """Return what is promised over a run of amounts, from the loosest to the tightest."""
    given = [line.case.promise for line in run if line.case.promise is not None]
    if not given:
        return "refusal"
    ends = f"{max(given):.0e}", f"{min(given):.0e}"
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def _errors(run: list[Line]) -> str:
    """Return the largest error of a run; where the promise differs, that of its loosest and of its tightest amount."""
    seen = [line for line in run if line.error is not None]
    promises = [line.case.promise or 0.0 for line in seen]
    if not seen:
        return ""
    if max(promises) == min(promises):
        return f"{max(line.error or 0.0 for line in seen):.0e}"
    ends = (
        max(line.error or 0.0 for line in seen if line.case.promise == end) for end in (max(promises), min(promises))
    )
    return " to ".join(f"{error:.0e}" for error in ends)


def _short(text: str) -> str:
    return text if len(text) <= _REASON else text[: _REASON - 3].rsplit(" ", 1)[0] + " ..."


def _cells(line: Line) -> tuple[str, ...]:
    case = line.case
    promised = "a refusal" if case.promise is None else f"{case.promise:.1e}"
    seen = "" if line.error is None else f"{line.error:.1e}"
    return (
        case.what,
        case.amount,
        promised,
        seen,
        str(line.outcome),
        case.measure,
        line.said,
        f"{line.seconds:.1f}",
    )


def _reason_key(line: Line) -> str:
    """Return what is said, numbers aside: amounts that are refused alike stand together."""
    return "" if line.outcome is Outcome.HELD else re.sub(r"[-+0-9.e]+", "#", line.said)


def _told(run: list[Line]) -> str:
    span = _plain(_span(run))
    if run[0].outcome is Outcome.HELD:
        return f"{span}: held, {_errors(run)} (promised {_promises(run)})"
    word = f"**{run[0].outcome}**" if run[0].outcome is Outcome.BROKEN else str(run[0].outcome)
    seen = f", {_errors(run)}" if _errors(run) else ""
    said = f": {_plain(_short(run[0].said))}" if run[0].said else ""
    return f"{span}: {word}{seen}{said}"


def _plain(text: str) -> str:
    """Return text that Markdown shows as it stands."""
    return re.sub(r"([|*_<>`\[\]\\])", r"\\\1", text)
