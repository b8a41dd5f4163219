"""Which points a sweep has: what is swept, by what its values are called, and how they combine."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from math import isnan, prod
from typing import Any

import numpy as np

from boomctl.checks import instance, known, mapping, sequence, shown

GRID, ZIP = "grid", "zip"
_MOST = 1_000_000  # points of a sweep: their table alone then takes a gigabyte (a choice)

Label = bool | int | float | str | None
"""What a value is called by: itself, if it is a number or a word."""


@dataclass(frozen=True)
class Axis:
    """What is swept: a parameter with its values.

    Attributes
    ----------
    name : str
        Of the parameter.
    labels : tuple
        What its values are called by: numbers and words.
    values : tuple
        What the function is given.
    single : bool
        Whether it is one value for all points.
    named : bool
        Whether the labels tell the values apart also in another run; places in a list of objects do not.
    """

    name: str
    labels: tuple[Label, ...]
    values: tuple[Any, ...]
    single: bool = False
    named: bool = True

    @classmethod
    def of(cls, name: str, given: object) -> "Axis":
        """Return the axis of what a user gives: a value, values in a row, or values by name."""
        what = f"over[{name!r}]"
        if isinstance(given, Mapping):
            for key in given:
                instance(f"a name in {what}", key, str)
            labels, values = tuple(given), tuple(given.values())
        elif _is_single(given):
            value = _bare(given)
            label = value if _is_label(value) else _name_of(value)
            named = label is not None or value is None
            return cls(name, (_told(what, label if named else type(value).__name__),), (value,), True, named)
        else:
            values = tuple(_bare(value) for value in sequence(what, given))
            names = [value if _is_label(value) else _name_of(value) for value in values]
            if any(label is None and value is not None for label, value in zip(names, values, strict=True)):
                return cls(name, tuple(range(len(values))), values, named=False)
            labels = tuple(_told(what, label) for label in names)
        if not labels:
            raise ValueError(f"{what}: expected at least one value, got none")
        seen: set[Label] = set()
        for label in labels:
            if label in seen:
                raise ValueError(f"{what}: {shown(label)} is there twice; expected values that differ")
            seen.add(label)
        return cls(name, labels, values)


@dataclass(frozen=True)
class Plan:
    """The points of a sweep, in order.

    Attributes
    ----------
    axes : tuple of Axis
    combine : str
        "grid": every value with every other, the last axis fastest.  "zip": first with first, second with second.
    """

    axes: tuple[Axis, ...]
    combine: str

    @classmethod
    def of(cls, over: object, combine: object) -> "Plan":
        """Return the plan of what a user gives; a ValueError or TypeError says what is wrong with it."""
        if not mapping("over", over, "parameters to values"):
            raise ValueError("over: expected at least one parameter")
        plan = cls(
            tuple(Axis.of(instance("a name in over", name, str), given) for name, given in over.items()),  # type: ignore[attr-defined]
            known("combine", combine, (GRID, ZIP)),
        )
        counts = {axis.name: len(axis.labels) for axis in plan.swept}
        if plan.combine == ZIP and len(set(counts.values())) > 1:
            told = ", ".join(f"{count} of {name}" for name, count in counts.items())
            raise ValueError(f"over: expected as many values of each with combine = 'zip', got {told}")
        if plan.count > _MOST:
            raise ValueError(f"over: expected at most {_MOST:,} points, got {plan.count:,}")
        return plan

    @property
    def swept(self) -> tuple[Axis, ...]:
        """The axes that have more than one value, or a row of one."""
        return tuple(axis for axis in self.axes if not axis.single)

    @property
    def count(self) -> int:
        """Number of points; of values that are zipped, as many as each has."""
        sizes = [len(axis.labels) for axis in self.swept]
        return prod(sizes if self.combine == GRID else sizes[:1])

    def places(self) -> list[tuple[int, ...]]:
        """Return, for each point, which value of each axis it has."""
        if self.combine == GRID:
            return list(product(*(range(len(axis.labels)) for axis in self.axes)))
        return [tuple(0 if axis.single else k for axis in self.axes) for k in range(self.count)]

    def points(self) -> list[dict[str, Label]]:
        """Return what each point is called by."""
        return [{a.name: a.labels[k] for a, k in zip(self.axes, at, strict=True)} for at in self.places()]

    def arguments(self) -> list[dict[str, Any]]:
        """Return what the function is given at each point."""
        return [{a.name: a.values[k] for a, k in zip(self.axes, at, strict=True)} for at in self.places()]


def _is_label(value: object) -> bool:
    return value is None or isinstance(value, (bool, int, float, str, np.generic))


def _is_single(value: object) -> bool:
    """Return whether something is one value, not values in a row; so is a system, whatever can be listed of it."""
    listed = isinstance(value, Iterable) and getattr(value, "ndim", 1) > 0 and not hasattr(value, "ninputs")
    return _is_label(value) or not listed


def _bare(value: Any) -> Any:
    """Return a number of NumPy's as one of Python's."""
    return value.item() if isinstance(value, np.generic) or getattr(value, "ndim", None) == 0 else value


def _name_of(value: object) -> str | None:
    """Return what an object calls itself: a design, a function."""
    name = getattr(value, "name", None) or getattr(value, "__name__", None)
    return name if isinstance(name, str) else None


def _told(what: str, label: Label) -> Label:
    if isinstance(label, float) and isnan(label):
        raise ValueError(f"{what}: expected numbers, got nan")
    return label
