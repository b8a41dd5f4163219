"""Points of a sweep: the values of each parameter by label, combined as a grid or zipped."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product, repeat
from math import prod
from typing import Any

import numpy as np

from boomctl.checks import instance, known, mapping, sequence, shown

GRID, ZIP = "grid", "zip"
_MAX_POINTS = 1_000_000  # the table of a larger sweep takes more than a gigabyte

Label = bool | int | float | str | None
"""The name of a value: the value itself if it is a number or a string."""


@dataclass(frozen=True)
class Points:
    """The points of a sweep, in order.

    Attributes
    ----------
    axes : dict of str to dict
        Values of each parameter by label.
    fixed : tuple of str
        Parameters with one value at all points.
    combine : {"grid", "zip"}
        "grid": all combinations, the last parameter fastest.  "zip": the k-th value of each.
    """

    axes: dict[str, dict[Label, Any]]
    fixed: tuple[str, ...]
    combine: str

    @classmethod
    def of(cls, over: object, combine: object) -> "Points":
        """Return the points of values by parameter."""
        if not mapping("over", over, "parameters to values"):
            raise ValueError("over: expected at least one parameter")
        axes, fixed = {}, []
        for name, values in over.items():  # type: ignore[attr-defined]
            what = f"over[{instance('a name in over', name, str)!r}]"
            if not isinstance(values, Mapping) and _is_single(values):
                fixed.append(name)
                axes[name] = _labeled(what, (values,), (type(values).__name__,))
            else:
                axes[name] = _labeled(what, values)
        points = cls(axes, tuple(fixed), known("combine", combine, (GRID, ZIP)))
        sizes = {name: len(values) for name, values in axes.items() if name not in fixed}
        if combine == ZIP and len(set(sizes.values())) > 1:
            counts = ", ".join(f"{size} of {name}" for name, size in sizes.items())
            raise ValueError(f"over: expected as many values of each with combine = 'zip', got {counts}")
        if combine == GRID and prod(sizes.values()) > _MAX_POINTS:
            raise ValueError(f"over: expected at most {_MAX_POINTS:,} points, got {prod(sizes.values()):,}")
        return points

    def labels(self) -> list[dict[str, Label]]:
        """Return the labels of each point."""
        if self.combine == GRID:
            rows: Iterable[tuple[Label, ...]] = product(*self.axes.values())
        elif len(self.fixed) == len(self.axes):
            rows = [tuple(next(iter(axis)) for axis in self.axes.values())]
        else:
            rows = zip(
                *(repeat(*axis) if name in self.fixed else axis for name, axis in self.axes.items()), strict=False
            )
        return [dict(zip(self.axes, row, strict=True)) for row in rows]


def _labeled(what: str, given: Any, names: tuple[Label, ...] | None = None) -> dict[Label, Any]:
    """Return values by label: by key, by themselves, by name, or else by ``names`` or position."""
    if isinstance(given, Mapping):
        for key in given:
            instance(f"a name in {what}", key, str)
        labels, values = list(given), list(given.values())
    else:
        values = [
            value.item() if isinstance(value, np.generic) or getattr(value, "ndim", None) == 0 else value
            for value in sequence(what, given)
        ]
        labels = [value if _is_label(value) else _name_of(value) for value in values]
        if any(label is None and value is not None for label, value in zip(labels, values, strict=True)):
            labels = list(names or range(len(values)))
    if not labels:
        raise ValueError(f"{what}: expected at least one value, got none")
    found: dict[Label, Any] = {}
    for label, value in zip(labels, values, strict=True):
        if label != label:
            raise ValueError(f"{what}: expected numbers, got nan")
        if label in found:
            raise ValueError(f"{what}: {shown(label)} is there twice; expected values that differ")
        found[label] = value
    return found


def _is_label(value: object) -> bool:
    return value is None or isinstance(value, (bool, int, float, str))


def _is_single(value: object) -> bool:
    """Return whether ``value`` is one value rather than several; a system is one, although it is iterable."""
    several = isinstance(value, Iterable) and getattr(value, "ndim", 1) > 0 and not hasattr(value, "ninputs")
    return isinstance(value, str) or not several


def _name_of(value: object) -> str | None:
    name = getattr(value, "name", None) or getattr(value, "__name__", None)
    return name if isinstance(name, str) else None
