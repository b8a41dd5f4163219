"""What was found of a design, and the one way it is told: on a terminal, in a notebook, as numbers, as a report."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any, ClassVar

import numpy as np

from boomctl.exchange.controller_files import controller_contents
from boomctl.printing import compact, table_html
from boomctl.report import Report, Section, Table, number

_CONTROLLER = "controller"  # name of the files of a design's controller


@dataclass(frozen=True)
class Finding:
    """One thing that was found of a design.

    Attributes
    ----------
    name : str
        What it is about; empty where its text says so.
    value : object
        A number, or the result whose certificate vouches for it.
    unit : str
        Of the number in the text.
    proved : bool or None
        Whether what it claims is proved, or computed where that is all there is, as poles on a finer mesh; None of what
        claims nothing, such as the largest value of some runs.
    text : str
        It as people read it; empty of what ``results.json`` alone holds.
    key : str
        Its name in ``results.json``; empty of what is not there.
    """

    name: str
    value: Any = None
    unit: str = ""
    proved: bool | None = None
    text: str = ""
    key: str = ""

    __repr__ = compact


def stored(**values: Any) -> tuple[Finding, ...]:
    """Return what ``results.json`` alone holds as findings, by its names there."""
    return tuple(Finding("", value, key=key) for key, value in values.items())


def numbers(found: Iterable[Finding]) -> dict[str, Any]:
    """Return the values of findings by their keys."""
    return {each.key: each.value for each in found if each.key}


def words(found: Iterable[Finding]) -> dict[str, str]:
    """Return the texts of findings by their names."""
    return {each.name: each.text for each in found if each.text}


def facts(said: Mapping[str, str]) -> tuple[Finding, ...]:
    """Return what synthesis and reduction say of themselves as findings: each in words, and all together as numbers."""
    return (*(Finding(name, text=text) for name, text in said.items()), *stored(synthesis=dict(said)))


def scalars(record: Any) -> dict[str, Any]:
    """Return the fields of a record that are numbers, words or not there: without curves and other records."""
    values = {each.name: getattr(record, each.name) for each in fields(record)}
    return {name: value for name, value in values.items() if value is None or isinstance(value, (str, int, float))}


def picked(records: Iterable[object], columns: Iterable[str]) -> list[dict[str, Any]]:
    """Return some attributes of each record."""
    return [{key: getattr(each, key) for key in columns} for each in records]


def tabled(records: Iterable[object], columns: Mapping[str, str]) -> Table:
    """Return some attributes of each record as a table; columns: their heads."""
    lines = tuple(tuple(map(_cell, each.values())) for each in picked(records, columns))
    return Table(tuple(columns.values()), lines)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    return value if isinstance(value, str) else number(value)


def finite(value: Any) -> Any:
    """Return numbers, arrays and what holds them with None for what is not finite."""
    if isinstance(value, Mapping):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (tuple, list, np.ndarray)):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def word_table(found: Mapping[str, str], heads: tuple[str, str] = ("synthesis", "says")) -> Table:
    """Return texts by what they are about as a table."""
    return Table(heads, tuple(found.items()), align="l")


class Judged(ABC):
    """What a design is worth: all that is shown of it follows from its verdict, its findings and its pictures.

    Attributes
    ----------
    design : object
        The design that was judged.
    """

    kind: ClassVar[str]
    """What the title of a report begins with."""
    about: ClassVar[str]
    """What a report is about, after its title."""

    design: Any

    @property
    @abstractmethod
    def verdict(self) -> str:
        """The result in a sentence."""

    @property
    def lead(self) -> str:
        """What the report is about, in a sentence."""
        return f"{self.design.title}: {self.about}."

    @property
    @abstractmethod
    def findings(self) -> tuple[Finding, ...]:
        """What was found, in the order in which it is told."""

    @abstractmethod
    def _sections(self, files: tuple[str, ...]) -> Iterable[Section]:
        """Return what stands in the report; ``files``: names of those of the controller."""

    def __str__(self) -> str:
        """Return what a terminal shows."""
        said = (f"{each.name}: {each.text}" if each.name else each.text for each in self.findings if each.text)
        return "\n  ".join([f"{self.design.title}: {self.verdict}", *said])

    def _repr_html_(self) -> str:
        rows = [(each.name, each.text) for each in self.findings if each.text]
        return table_html(f"{self.design.title}: {self.verdict}", ("", "found"), rows)

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names, numbers and texts that JSON can hold.
        """
        return numbers(self.findings)

    def report(self) -> Report:
        """Return the report: pictures, tables, and the numbers of ``results.json``.

        Returns
        -------
        Report
            ``.write(folder)`` writes it.
        """
        files = self.controller_files()
        sections = tuple(self._sections(tuple(files)))
        return Report(f"{self.kind}{self.design.title}", (self.lead,), sections, self.as_dict(), files)

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 with its limits where it is sampled.

        Returns
        -------
        dict of str to bytes or str
            What the files hold, by their names; none without a controller.
        """
        return {}

    def _controller_files(
        self, vouched: Mapping[str, str], suffixes: Iterable[str], **c: Any
    ) -> dict[str, bytes | str]:
        """Return the controller as files of such suffixes, with what vouches for it; ``c``: for C alone."""
        design = self.design
        shared: dict[str, Any] = {
            "certificate": dict(vouched),
            "provenance": {"design": design.name, "title": design.title, **design.facts},
        }
        found = {}
        for suffix in suffixes:
            given = shared | (c if suffix == ".c" else {})
            found |= controller_contents(design.controller, _CONTROLLER, suffix, **given)
        return found


def files_section(names: tuple[str, ...], *more: str) -> Section:
    """Return what lies beside the report for other programs."""
    said = "Beside this report lies the controller for other programs: " + ", ".join(names) + "."
    return Section("The controller in files", (said, *more))
