"""What benchmarks are made of: subjects that return rows and sheets, and the report of all of them."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from boomctl.files import plain
from boomctl.lab.benchmark.timing import environment, one_thread

if TYPE_CHECKING:
    from rich.console import Group
    from rich.table import Table

Tell = Callable[[str], None]
"""Told in words what comes next."""

# head, width in characters (together 100, which a terminal shows) and side of each column
_COLUMNS: tuple[tuple[str, int, Literal["left", "right"]], ...] = (
    ("job", 32, "left"),
    ("ours \\[ms]", 7, "right"),
    ("peer \\[ms]", 7, "right"),
    ("ratio", 6, "right"),
    ("target", 16, "left"),
    ("error ours", 7, "right"),
    ("error peer", 7, "right"),
    ("met", 6, "left"),
)


@dataclass(frozen=True)
class Row:
    """One job, ours and a peer's.

    Attributes
    ----------
    section : str
        Heading under which it stands.
    job : str
        What is done.
    ours, peer : float or None
        Median processor time [s].
    target : str
        What was asked for, in words; empty without a target.
    error, peer_error : float or None
        Largest relative error, of what the report's notes say.
    met : bool or None
        Whether the target is met; None without a target, or where this run did not try it.
    note : str
        Stands where ``met`` would, if that is None.
    """

    section: str
    job: str
    ours: float | None = None
    peer: float | None = None
    target: str = ""
    error: float | None = None
    peer_error: float | None = None
    met: bool | None = None
    note: str = ""

    @property
    def name(self) -> str:
        """Section, without what is said of the peer, and job."""
        return f"{self.section.split(';')[0]}: {self.job}"

    @property
    def ratio(self) -> float | None:
        """How many times faster ours is than the peer's."""
        return self.peer / self.ours if self.peer is not None and self.ours else None


@dataclass(frozen=True)
class Sheet:
    """A table of its own: a title, column names, lines of text and numbers."""

    title: str
    columns: tuple[str, ...]
    lines: tuple[tuple[str | float | int | None, ...], ...]


@dataclass(frozen=True)
class Measured:
    """Processor time [s] and error of one side of a race; NaN where there is none."""

    seconds: float = math.nan
    error: float = math.nan


def race(section: str, job: str, ours: Measured, peer: Measured, target: str = "", met: bool | None = None) -> Row:
    """Return the row of a job that was done on both sides."""
    numbers = (ours.seconds, peer.seconds, ours.error, peer.error)
    mine, theirs, error, peer_error = (None if math.isnan(value) else value for value in numbers)
    return Row(section, job, mine, theirs, target, error=error, peer_error=peer_error, met=met)


Subject = Callable[[Tell], Iterable[Row | Sheet]]
"""Measures what belongs to one subject."""


@dataclass(frozen=True)
class BenchmarkReport:
    """All rows, further tables, what they mean, where they were measured, and what stands above them."""

    rows: tuple[Row, ...]
    sheets: tuple[Sheet, ...] = ()
    notes: tuple[str, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)
    title: str = "boomctl benchmark boom"

    @property
    def missed(self) -> tuple[Row, ...]:
        """The rows whose target is missed."""
        return tuple(row for row in self.rows if row.met is False)

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON knows: rows (with ratio), tables, notes, environment."""
        return plain(
            {
                "rows": [{**asdict(row), "ratio": row.ratio} for row in self.rows],
                "tables": [asdict(sheet) for sheet in self.sheets],
                "notes": list(self.notes),
                "environment": dict(self.environment),
                "missed": [row.name for row in self.missed],
            }
        )

    def table(self) -> "Table":
        """Return the rows as a table for the terminal."""
        from rich.table import Table

        table = Table(title=self.title, title_justify="left", pad_edge=False, box=None, padding=(0, 1))
        for head, width, justify in _COLUMNS:
            table.add_column(head, justify=justify, max_width=width, overflow="fold")
        section = None
        for row in self.rows:
            if row.section != section:
                section = row.section
                table.add_row(f"[bold]{section}[/bold]")
            table.add_row(*_cells(row))
        return table

    def sheet_tables(self) -> list[Any]:
        """Return the further tables for the terminal, an empty line before each."""
        from rich.markup import escape
        from rich.table import Table
        from rich.text import Text

        parts: list[Any] = []
        for sheet in self.sheets:
            small = Table(title=sheet.title, title_justify="left", pad_edge=False, box=None, padding=(0, 1))
            for i, column in enumerate(sheet.columns):
                small.add_column(escape(column), justify="right" if i else "left")
            for line in sheet.lines:
                small.add_row(*(escape(_text(cell)) for cell in line))
            parts += [Text(), small]
        return parts

    def render(self) -> "Group":
        """Return everything, ready for ``rich.print``."""
        from rich.console import Group
        from rich.text import Text

        parts: list[Any] = [self.table(), *self.sheet_tables()]
        parts += [Text(), *(Text(f"- {note}") for note in self.notes)]
        parts += [Text(), Text(", ".join(f"{name} {value}" for name, value in self.environment.items()), style="dim")]
        tried = [row for row in self.rows if row.met is not None]
        summary = f"{sum(row.met is True for row in tried)} of {len(tried)} targets met"
        if self.missed:
            summary += "; missed: " + ", ".join(row.name for row in self.missed)
        return Group(*parts, Text(), Text(summary, style="bold"))


def measured(
    title: str, subjects: Sequence[Subject], notes: Sequence[str], tell: Tell | None = None
) -> BenchmarkReport:
    """Measure one subject after another, on one thread."""
    with one_thread():
        found = [line for subject in subjects for line in subject(tell or (lambda text: None))]
    rows = tuple(line for line in found if isinstance(line, Row))
    sheets = tuple(line for line in found if isinstance(line, Sheet))
    return BenchmarkReport(rows, sheets, tuple(notes), environment(), f"boomctl benchmark {title}")


def _cells(row: Row) -> tuple[str, ...]:
    met = {True: "[green]yes[/green]", False: "[bold red]NO[/bold red]", None: row.note}[row.met]
    ratio = "" if row.ratio is None else f"{row.ratio:,.0f}" if row.ratio >= 100 else f"{row.ratio:.3g}"
    times = ("" if value is None else _milliseconds(value) for value in (row.ours, row.peer))
    errors = ("" if value is None else f"{value:.1e}" for value in (row.error, row.peer_error))
    return (f"  {row.job}", *times, ratio, row.target, *errors, met)


def _milliseconds(seconds: float) -> str:
    value = 1e3 * seconds
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 1000 else f"{value:,.0f}"


def _text(cell: str | float | int | None) -> str:
    if cell is None:
        return ""
    if isinstance(cell, float):
        return f"{cell:.1e}" if math.isfinite(cell) and (abs(cell) < 0.01 or abs(cell) >= 1e4) else f"{cell:.4g}"
    return f"{cell:,}" if isinstance(cell, int) else cell
