"""Base classes of designs and their evaluations, with their report."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field
from datetime import date
from typing import Any

from boomctl import __version__
from boomctl.analysis.box.robustness import RobustStability
from boomctl.analysis.box.scheduled import ScheduledController
from boomctl.analysis.box.worst_case import WorstCase
from boomctl.analysis.norm import NormBounds
from boomctl.exchange.controller_files import controller_contents
from boomctl.printing import compact, table_html
from boomctl.report import Report, Section, Table, number

PEAK_DIGITS = 4  # Significant digits of peaks in tables.


@dataclass(frozen=True, eq=False)
class Design:
    """Design of a machine with its controller or maneuver.

    Attributes
    ----------
    name, title : str
        Identifier, and title in one line.
    synthesis_info : mapping of str to str
        Results of synthesis and reduction: gamma and bounds, errors, orders.
    notes : tuple of str
        Notes for the reader of the report.
    results : mapping of str to Any
        Further numbers for ``results.json``.
    sections : tuple of Section
        Further sections of the report: title, text, tables, figures.
    """

    name: str
    title: str
    _: KW_ONLY
    synthesis_info: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    results: Mapping[str, Any] = field(default_factory=dict)
    sections: tuple[Section, ...] = ()

    __repr__ = compact


@dataclass(frozen=True)
class Finding:
    """One result of an evaluation.

    Attributes
    ----------
    name : str
        Name of the quantity, with the unit of the text.
    text : str
        Result for a table; empty for values of ``results.json`` only.
    value : object
        A number, or the result that certifies or proves it.
    proved : bool or None
        True if the claim is proved, or verified numerically if no proof exists, as for poles on a finer mesh; None for
        results without a claim, such as the largest value of some runs.
    key : str
        Name in ``results.json``; empty if it is not there.
    method : str
        Method that verifies the value.
    """

    name: str
    text: str = ""
    value: Any = None
    proved: bool | None = None
    key: str = ""
    method: str = ""

    __repr__ = compact


def words(findings: Iterable[Finding]) -> dict[str, str]:
    """Return the texts of findings by their names."""
    return {item.name: item.text for item in findings if item.text}


def numbers(findings: Iterable[Finding]) -> dict[str, Any]:
    """Return the values of findings by their keys."""
    return {item.key: item.value for item in findings if item.key}


def table_of(rows: Iterable[Mapping[str, Any]], columns: Iterable[str], caption: str = "") -> Table:
    """Return some columns of rows as a table; a mapping gives the heads of the columns by their keys."""
    heads = columns if isinstance(columns, Mapping) else {key: key.replace("_", " ") for key in columns}
    return Table(tuple(heads.values()), tuple(tuple(_cell(row[key]) for key in heads) for row in rows), caption)


def _cell(value: Any) -> str:
    return value if isinstance(value, str) else "\u2013" if value is None else number(value)


def word_table(texts: Mapping[str, str], heads: tuple[str, str] = ("synthesis", "result")) -> Table:
    """Return texts by name as a table."""
    return Table(heads, tuple(texts.items()), align="l")


def peak_finding(name: str, bounds: NormBounds, key: str = "") -> Finding:
    """Return the largest singular value of a system; the method of one that is not verified is the reason."""
    text = number(bounds.lower_bound, PEAK_DIGITS) + ("" if bounds.verified else ", NOT verified")
    return Finding(name, text, bounds.lower_bound, bounds.verified, key, bounds.method)


def stability_finding(name: str, result: RobustStability, K: Any) -> Finding:
    """Return stability over a box of parameters, with a controller or without one."""
    return Finding(name, result.summary, result, result.proved, method=box_method("zero exclusion", result, K))


def box_method(how: str, result: RobustStability | WorstCase, K: Any) -> str:
    """Return how a result over a box of parameters is verified; the loops of a discrete controller are approximated."""
    loops = " of polynomials" if getattr(K, "dt", 0) else ""
    return f"{how}{loops}; cells: {result.method}" if result.method else "evaluated points"


def finding_table(*columns: Iterable[Finding], heads: tuple[str, ...] = ("value",), align: str = "l") -> Table:
    """Return quantities, their values in one or several evaluations, their units, and the methods that verify them."""
    lines = []
    for row in zip(*columns, strict=True):
        quantity, _, unit = row[0].name.partition(" [")
        methods = dict.fromkeys(item.method for item in row if item.method)
        lines.append((quantity, *(item.text for item in row), unit.removesuffix("]"), "; ".join(methods)))
    return Table(("quantity", *heads, "unit", "verified by"), tuple(lines), align=align)


class Evaluation(ABC):
    """Evaluation of a design: verdict, words, results and sections.

    Attributes
    ----------
    design : Design
        The design that was evaluated.
    """

    design: Any

    @property
    @abstractmethod
    def verdict(self) -> str:
        """The result in a sentence."""

    @property
    @abstractmethod
    def words(self) -> Mapping[str, str]:
        """The findings by name, in the order in which they are shown."""

    @abstractmethod
    def _results(self) -> Mapping[str, Any]:
        """Return the numbers for ``results.json``."""

    @abstractmethod
    def _sections(self) -> Iterable[Section]:
        """Return the sections of the report."""

    def __str__(self) -> str:
        """Return the evaluation as text."""
        result = (f"{name}: {text}" for name, text in self.words.items())
        return "\n  ".join([f"{self.design.title}: {self.verdict}", *result])

    def _repr_html_(self) -> str:
        return table_html(f"{self.design.title}: {self.verdict}", ("", "result"), self.words.items())

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names, numbers and texts that JSON can hold.
        """
        return {**self._results(), **self.design.results}

    def report(self) -> Report:
        """Return the report: figures, tables, and the values of ``results.json``.

        Returns
        -------
        Report
            ``.write(folder)`` writes it.
        """
        files, sections = self.controller_files(), [*self._sections(), *self.design.sections]
        if files:
            listed = (
                f"The controller for other programs: {', '.join(files)}. boomctl.read_controller reads the JSON file."
            )
            sections.append(Section("The controller in files", (listed,)))
        lead = f"{self.verdict[:1].upper()}{self.verdict[1:]}"
        origin = f"boomctl {__version__}, {date.today().isoformat()}, boomctl design {self.design.name}."
        return Report(self.design.title, (lead, origin), tuple(sections), self.to_dict(), files)

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 with its limits where it is sampled.

        Returns
        -------
        dict of str to bytes or str
            Contents of the files by name; none without a controller that is one linear system, no C code of one that is too
            fast for its sampling time.
        """
        return {}

    def _controller_files(
        self, certificate: Mapping[str, str], sample_time: float | None, control_limit: float | None
    ) -> dict[str, bytes | str]:
        design = self.design
        if design.controller is None or isinstance(design.controller, ScheduledController):
            return {}
        provenance = {"design": design.name, "title": design.title, **design.synthesis_info}
        metadata: dict[str, Any] = {"certificate": dict(certificate), "provenance": provenance}
        result = {}
        for suffix in (".json", ".mat"):
            result |= controller_contents(design.controller, "controller", suffix, **metadata)
        if sample_time is not None:
            metadata |= {"sample_time": sample_time, "control_limit": control_limit}
            with suppress(ValueError):
                result |= controller_contents(design.controller, "controller", ".c", **metadata)
        return result
