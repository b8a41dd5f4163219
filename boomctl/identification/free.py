"""The free parameters of a fit: positive ones by their logarithms, others by shares of a range."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import function_of, known, mapping, names, real
from boomctl.structure.families import Family, interval

_AROUND = 2.0  # Factor up and down within which starts are drawn for a parameter without a range.
_FAR = 1e4  # Factor up and down within which the end of an interval is searched without a range.


@dataclass(frozen=True)
class FreeParameters:
    """Free parameters of a record, in dimensionless coordinates that are zero at the start.

    A parameter that is above zero has the coordinate ``ln(value/start)``, others ``(value - start)/scale``.

    Attributes
    ----------
    names : tuple of str
    record : dataclass or dict
        Initial parameters.
    start : (p,) ndarray
        Values of the free ones there.
    scale : (p,) ndarray
        Unit of a coordinate; ``nan`` where it is a logarithm.
    low, high : (p,) ndarray
        Range of the coordinates; infinite where none was given.
    """

    names: tuple[str, ...]
    record: Any
    start: Array
    scale: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, build: object, free: object, start: object) -> "FreeParameters":
        """Return what is free, checked against the record of parameters."""
        record = _start(build, free, start)
        if free is None and isinstance(build, Family):
            free = build.names
        if free is None:
            raise TypeError("free = None: expected names of parameters, or a mapping from names to (low, high)")
        numbers = _numbers(record)
        ranges: dict[str, Any] = dict(free) if isinstance(free, Mapping) else {}
        listed = names("free parameter", tuple(ranges) if ranges else free, tuple(numbers), "`initial` has")  # type: ignore[arg-type]
        if not listed:
            raise ValueError("free: expected at least one parameter, got none")
        if isinstance(build, Family):
            box = dict(zip(build.names, zip(build.low.tolist(), build.high.tolist(), strict=True), strict=True))
            ranges = {name: ranges.get(name) or box[name] for name in listed}
        first, scale, low, high = np.full((4, len(listed)), np.nan)
        for i, name in enumerate(listed):
            first[i] = value = real(f"start of {name}", numbers[name])
            ends = (-np.inf, np.inf) if ranges.get(name) is None else interval(name, ranges[name])
            if not ends[0] <= value <= ends[1]:
                raise ValueError(
                    f"`initial` of {name} must be in its range, {ends[0]:g} to {ends[1]:g}, got {value:g}."
                )
            if value > 0.0 and (ends[0] > 0.0 or ends[0] == -np.inf):
                low[i], high[i] = np.log(ends[0] / value) if ends[0] > 0.0 else -np.inf, np.log(ends[1] / value)
                continue
            scale[i] = ends[1] - ends[0] if ends[1] < np.inf else -value
            if scale[i] == 0.0:
                raise ValueError(f"`initial` of {name} must be above zero, or have a range in `free`, got 0.")
            low[i], high[i] = (ends[0] - value) / scale[i], (ends[1] - value) / scale[i]
        return cls(listed, record, first, scale, low, high)

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return len(self.names)

    @property
    def logarithmic(self) -> Array:
        """Which coordinates are logarithms."""
        return np.isnan(self.scale)

    def values(self, x: Array) -> Array:
        """Return the parameters at coordinates."""
        with np.errstate(over="ignore"):  # The model raises an error for overflow.
            grown = self.start * np.exp(np.where(self.logarithmic, x, 0.0))
        return np.where(self.logarithmic, grown, self.start + self.scale * np.where(self.logarithmic, 0.0, x))

    def derivatives(self, x: Array) -> Array:
        """Return the derivatives of the parameters with respect to their coordinates."""
        return np.where(self.logarithmic, self.values(x), self.scale)

    def at(self, x: Array) -> Any:
        """Return the whole record of parameters at coordinates."""
        result = {name: float(value) for name, value in zip(self.names, self.values(x), strict=True)}
        return changed(self.record, result)

    def drawn(self, count: int, seed: int) -> list[Array]:
        """Return so many starts: the first as given, the others drawn evenly over the ranges."""
        near = np.log(_AROUND)
        low = np.where(np.isfinite(self.low), self.low, -near)
        high = np.where(np.isfinite(self.high), self.high, near)
        others = np.random.default_rng(seed).uniform(low, high, (count - 1, self.size))
        return [np.zeros(self.size), *others]

    def reach(self, x: Array, sign: int) -> Array:
        """Return how far coordinates may go from ``x`` to the end of an interval."""
        end = self.high if sign > 0 else self.low
        far = np.where(self.logarithmic, np.log(_FAR), _FAR) + np.abs(x)
        return np.where(np.isfinite(end), np.abs(end - x), far)

    def described(self, i: int, x: float) -> str:
        """Return a change of one coordinate in words."""
        if self.logarithmic[i]:
            return f"{self.names[i]} × {np.exp(x):.6g}"  # enough digits for what is said of a product to hold
        return f"{self.names[i]} {'plus' if x > 0 else 'minus'} {abs(x) * self.scale[i]:.3g}"


def changed(record: Any, values: Mapping[str, float]) -> Any:
    """Return a record of parameters, a dataclass or a mapping, with some changed."""
    return {**record, **values} if isinstance(record, dict) else replace(record, **values)


def function_of_parameters(build: object) -> Callable[[Any], Any]:
    """Return the function that makes a model of parameters."""
    if isinstance(build, Family):
        return lambda parameters: build.at(build.normalize(parameters))
    return function_of("model", build, "the parameters, or a family")


def _start(build: object, free: object, start: object) -> Any:
    """Return the record to begin from: the one given, a family's middle, or the middle of the ranges."""
    if isinstance(build, Family):
        middle = build.denormalize(np.zeros(build.nparameters))
        if start is None:
            return middle
        for name in mapping("initial", start, "parameters of the family to numbers"):
            known("parameter", name, build.names)
        return {**middle, **start}  # type: ignore[dict-item]
    if isinstance(start, Mapping):
        return dict(start)
    if is_dataclass(start) and not isinstance(start, type):
        return start
    if start is not None:
        raise TypeError(f"initial: expected a dataclass or a mapping of parameters, got {type(start).__name__}")
    if isinstance(free, Mapping) and free and all(pair is not None for pair in free.values()):
        ends = {str(name): interval(str(name), pair) for name, pair in free.items()}
        return {n: float(np.sqrt(a) * np.sqrt(b)) if a > 0.0 else 0.5 * (a + b) for n, (a, b) in ends.items()}
    raise TypeError("initial: expected initial parameters, a dataclass or a mapping, got None")


def _numbers(record: Any) -> dict[str, Any]:
    """Return the parameters of a record by name."""
    if isinstance(record, dict):
        for name in record:
            if not isinstance(name, str):
                raise TypeError(f"initial: expected names of parameters, got {name!r}")
        return record
    return {field.name: getattr(record, field.name) for field in fields(record) if field.init}
