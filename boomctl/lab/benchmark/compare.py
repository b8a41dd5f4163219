"""A benchmark beside an earlier one: what got slower, what got less exact, what is new and what is gone, in one table."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.files import plain
from boomctl.lab.benchmark.report import BenchmarkReport

if TYPE_CHECKING:
    from rich.console import Group

SLOWER = 1.25  # ratio of times from which on a job got slower: medians of two runs of the same code differ by less (a choice)
LESS_EXACT = 2.0  # ratio of errors from which on a job got less exact: a bit of accuracy (a choice)
ROUNDING = 1e-12  # relative error below which one is as good as another: rounding, some 1e4 eps (a choice)
_PEERS = 3  # jobs of peers, timed in both runs, that tell how fast the machine was; fewer may mislead (a choice)
_WORSE = ("slower", "less exact", "promise missed", "gone")
_HEADS = ("job", "before \\[ms]", "now \\[ms]", "ratio", "error before", "error now", "ratio", "")


@dataclass(frozen=True)
class Change:
    """One job, before and now.

    Attributes
    ----------
    job : str
        Section and job.
    seconds_before, seconds : float or None
        Median processor time [s].
    error_before, error : float or None
        Largest relative error.
    slower : float or None
        Time now over time before, on a machine as fast as before.
    less_exact : float or None
        Error now over error before; both count as rounding at least.
    verdict : tuple of str
        What is to be said of it: "slower", "faster", "less exact", "more exact", "promise missed", "promise held", "new",
        "gone"; empty if nothing is.
    """

    job: str
    seconds_before: float | None
    seconds: float | None
    error_before: float | None
    error: float | None
    slower: float | None
    less_exact: float | None
    verdict: tuple[str, ...]

    @property
    def worse(self) -> bool:
        """Whether something got worse."""
        return any(word in _WORSE for word in self.verdict)


@dataclass(frozen=True)
class Comparison:
    """All jobs of two runs.

    Attributes
    ----------
    changes : tuple of Change
        What got worse first.
    machine : float or None
        How much longer the peers' same jobs took, which says how fast the machine was; None where too few were timed.
    environment : dict of str to (str, str)
        What the two runs ran on and with, where that differs.
    """

    changes: tuple[Change, ...]
    machine: float | None
    environment: dict[str, tuple[str, str]]

    @property
    def worse(self) -> tuple[Change, ...]:
        """What got slower, less exact, misses its promise, or is gone."""
        return tuple(change for change in self.changes if change.worse)

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON knows."""
        return plain(
            {
                "changes": [asdict(change) for change in self.changes],
                "worse": [change.job for change in self.worse],
                "machine": self.machine,
                "environment": self.environment,
                "thresholds": {"slower": SLOWER, "less_exact": LESS_EXACT, "rounding": ROUNDING},
            }
        )

    def render(self) -> "Group":
        """Return the table and what it means, ready for ``rich.print``."""
        from rich.console import Group
        from rich.markup import escape
        from rich.table import Table
        from rich.text import Text

        said = [change for change in self.changes if change.verdict]
        table = Table(title="beside the earlier run", title_justify="left", pad_edge=False, box=None, padding=(0, 1))
        for k, head in enumerate(_HEADS):
            table.add_column(head, justify="left" if k in (0, len(_HEADS) - 1) else "right", overflow="fold")
        for change in said:
            times = (_shown(change.seconds_before, 1e3), _shown(change.seconds, 1e3), _shown(change.slower))
            errors = (*(_error(value) for value in (change.error_before, change.error)), _shown(change.less_exact))
            verdict = ", ".join(change.verdict)
            table.add_row(
                escape(change.job), *times, *errors, f"[bold red]{verdict}[/bold red]" if change.worse else verdict
            )
        notes = [
            f"Slower: {SLOWER:g} times the time and more; less exact: {LESS_EXACT:g} times the error and more, beyond"
            f" rounding ({ROUNDING:g}).",
            "Too few jobs of peers to tell how fast the machine was: times are compared as they are."
            if self.machine is None
            else f"The peers' same jobs took {self.machine:.3g} times as long (median): ratios of times are over that.",
            *(f"{name}: {before} before, {now} now" for name, (before, now) in self.environment.items()),
        ]
        alike = len(self.changes) - len(said)
        summary = f"{len(self.worse)} worse, {len(said) - len(self.worse)} otherwise changed, {alike} alike"
        parts = [table] if said else []
        return Group(*parts, Text(), *(Text(f"- {note}") for note in notes), Text(), Text(summary, style="bold"))


def read_results(path: Path) -> Mapping[str, Any]:
    """Return what ``boomctl benchmark --json`` printed.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        It holds something else; the message names the file.
    """
    expected = f"{path}: expected what 'boomctl benchmark --json' printed"
    try:
        found = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError):
        raise ValueError(f"{expected}; it is no JSON") from None
    rows = found.get("rows") if isinstance(found, dict) else None
    if not isinstance(rows, list) or not all(
        isinstance(row, dict) and {"section", "job"} <= row.keys() for row in rows
    ):
        raise ValueError(f"{expected}, which has rows of jobs")
    for row in rows:
        for name in ("ours", "peer", "error"):
            if not isinstance(row.get(name), (int, float, type(None), str)):
                raise ValueError(f"{expected}; {name} = {row[name]!r} of {row['job']!r} is no number")
    return found


def compared(before: Mapping[str, Any], now: BenchmarkReport) -> Comparison:
    """Return an earlier run's results beside those of a report.

    Raises
    ------
    ValueError
        They have no job in common: it is another benchmark.
    """
    old, new = _jobs(before["rows"]), _jobs(plain(now.rows))
    if not old.keys() & new.keys():
        raise ValueError("--compare: expected results of the same benchmark; they have no job in common")
    machine = _machine(old, new)
    changes = [_change(job, old.get(job), new.get(job), machine or 1.0) for job in {**old, **new}]
    order = sorted(range(len(changes)), key=lambda k: (not changes[k].worse, -(changes[k].slower or 0.0), k))
    facts = [before.get("environment") or {}, now.environment]
    names = [name for name in dict.fromkeys([*facts[0], *facts[1]]) if facts[0].get(name) != facts[1].get(name)]
    differ = {name: (str(facts[0].get(name, "none")), str(facts[1].get(name, "none"))) for name in names}
    return Comparison(tuple(changes[k] for k in order), machine, differ)


def _jobs(rows: Iterable[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return rows by section and job."""
    return {f"{row['section']}: {row['job']}": row for row in rows}


def _machine(old: Mapping[str, Mapping[str, Any]], new: Mapping[str, Mapping[str, Any]]) -> float | None:
    """Return how much longer the peers' jobs took; None of too few."""
    pairs = [(_number(old[job], "peer"), _number(new[job], "peer")) for job in old.keys() & new.keys()]
    ratios = [after / before for before, after in pairs if before and after]
    return float(np.median(ratios)) if len(ratios) >= _PEERS else None


def _change(job: str, old: Mapping[str, Any] | None, new: Mapping[str, Any] | None, machine: float) -> Change:
    before, now = old or {}, new or {}
    times, errors = ([_number(row, name) for row in (before, now)] for name in ("ours", "error"))
    slower = times[1] / times[0] / machine if times[0] and times[1] else None
    counted = [max(error, ROUNDING) for error in errors if error is not None]
    less_exact = counted[1] / counted[0] if len(counted) == 2 else None
    verdict = ["new"] if old is None else ["gone"] if new is None else []
    for ratio, limit, worse, better in (
        (slower, SLOWER, "slower", "faster"),
        (less_exact, LESS_EXACT, "less exact", "more exact"),
    ):
        if ratio is not None and ratio >= limit:
            verdict.append(worse)
        elif ratio is not None and ratio <= 1.0 / limit:
            verdict.append(better)
    met = before.get("met"), now.get("met")
    if None not in met and met[0] is not met[1]:
        verdict.append("promise held" if met[1] else "promise missed")
    return Change(job, times[0], times[1], errors[0], errors[1], slower, less_exact, tuple(verdict))


def _number(row: Mapping[str, Any], name: str) -> float | None:
    """Return a number of a row; infinite ones stand as words in JSON, what is none is None."""
    try:
        value = float(row[name])
    except (KeyError, TypeError, ValueError):
        return None
    return None if np.isnan(value) else value


def _shown(value: float | None, scale: float = 1.0) -> str:
    return "" if value is None else f"{scale * value:,.0f}" if abs(scale * value) >= 1000.0 else f"{scale * value:.3g}"


def _error(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"
