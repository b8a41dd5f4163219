"""Structures of controllers: their free parameters, and their systems as CasADi expressions."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise, product
from math import exp, inf, log
from typing import TypeAlias, TypeVar

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance, known
from boomctl.printing import listed
from boomctl.tunable.blocks import Block, filtered, parallel, series, static

GAIN, RATE, RATIO, PHYSICAL = "gain", "rate", "ratio", "physical"
_SPAN = 100.0  # default bounds of rates: the plant's band times this factor on either side
_DAMPING = (0.05, 2.0)  # bounds of the damping ratio of a positive position feedback: no second resonance
_DEEP, _WIDE = (1e-3, 1.0), (0.02, 3.0)  # bounds of the damping ratios of a notch's zeros and poles


@dataclass(frozen=True)
class Free:
    """Free parameter: name, kind, bounds, and scale of the search variable.

    The search variable of a positive parameter is its logarithm.
    """

    name: str
    kind: str
    low: float = -inf
    high: float = inf
    scale: float = 1.0

    @property
    def logarithmic(self) -> bool:
        """True if the search variable is the logarithm."""
        return self.kind in (RATE, RATIO)

    def ends(self) -> tuple[float, float]:
        """Return the bounds of the search variable: logarithms, or -1 to 1 for a plant parameter."""
        if self.logarithmic:
            return log(self.low), log(self.high)
        return (-1.0, 1.0) if self.kind == PHYSICAL else (self.low, self.high)

    def value(self, x: float) -> float:
        """Return the parameter value of a search variable."""
        if self.logarithmic:
            return float(min(max(exp(x), self.low), self.high))
        if self.kind == PHYSICAL:
            return (
                0.5 * (1.0 - float(x)) * self.low + 0.5 * (1.0 + float(x)) * self.high
            )  # at -1 and 1 the ends themselves
        return self.scale * float(x)

    def expression(self, x: ca.SX) -> ca.SX:
        """Return the value of a gain, a rate or a ratio as an expression of the search variable."""
        return ca.exp(x) if self.logarithmic else self.scale * x

    def number(self, value: float) -> float:
        """Return the search variable of a parameter value."""
        if self.logarithmic:
            return log(value)
        if self.kind == PHYSICAL:
            return (value - 0.5 * (self.low + self.high)) / (0.5 * (self.high - self.low))
        return value / self.scale


@dataclass(frozen=True)
class Ports:
    """Ports of a structure: measurements and controls, their magnitudes, and the plant's band.

    Attributes
    ----------
    measurements, controls : tuple of str
        Names, empty for a part inside a series.
    reads, acts : ndarray
        Scales of the measurements and controls, such that gains are near one.
    rate : float
        Unit of rates [rad/s].
    slowest, fastest : float
        Slowest and fastest rate of the plant [rad/s].
    """

    measurements: tuple[str, ...]
    controls: tuple[str, ...]
    reads: Array
    acts: Array
    rate: float
    slowest: float
    fastest: float

    @property
    def shape(self) -> tuple[int, int]:
        """Number of controls and of measurements."""
        return len(self.acts), len(self.reads)

    def part(self, rows: Sequence[int], columns: Sequence[int]) -> "Ports":
        """Return the ports of a part between some of the signals."""
        return replace(
            self,
            measurements=tuple(self.measurements[i] for i in columns),
            controls=tuple(self.controls[i] for i in rows),
            reads=self.reads[list(columns)],
            acts=self.acts[list(rows)],
        )

    def rates(self, low: float | None, high: float | None) -> tuple[float, float]:
        """Return the range of a rate, by default far beyond the plant's band."""
        return (self.slowest / _SPAN if low is None else low), (self.fastest * _SPAN if high is None else high)


Vector = TypeVar("Vector", Array, ca.SX)
Realization: TypeAlias = tuple[ca.SX, ca.SX, ca.SX, float | ca.SX]
"""Matrices A, B, C and D of a filter."""


class ControllerForm:
    """Tunable controller structure: parts can be added, and connected in series by ``*``, the right one first."""

    square = False  # True if the number of outputs equals that of inputs

    def free(self, ports: Ports) -> tuple[Free, ...]:
        """Return the free parameters."""
        raise NotImplementedError

    def block(self, values: ca.SX, ports: Ports) -> Block:
        """Return the system for values of the free parameters, in the units of the signals."""
        raise NotImplementedError

    def physicals(self) -> "tuple[Physical, ...]":
        """Return the plant parameters among the parts."""
        return ()

    def check(self, ports: Ports) -> None:
        """Raise an error if the structure does not fit the signals."""
        if self.square and len(ports.measurements) != len(ports.controls):
            raise ValueError(
                f"structure: a filter without gains between {len(ports.measurements)} measurement(s) and"
                f" {len(ports.controls)} control(s); put it in series with a gain"
            )

    def drawn(self, ports: Ports, rng: np.random.Generator, level: float, quiet: bool) -> Array:
        """Return random initial parameters: gains of about ``level`` natural sizes, rates within the plant's band."""
        result = []
        band = np.log([ports.slowest, ports.fastest])
        for free in self.free(ports):
            low, high = free.ends()
            if free.kind == GAIN:
                result.append(level * rng.normal())
            elif free.kind == PHYSICAL and quiet:
                result.append(0.0)
            else:
                inner = np.clip(band, low, high) if free.kind == RATE else np.array([low, high])
                low, high = inner if inner[0] < inner[1] else (low, high)
                result.append(rng.uniform(low, high))
        return np.array(result)

    def lower(self) -> "ControllerForm | None":
        """Return the structure with one state less, if any."""
        return None

    def grown(self, x: Array, ports: Ports, rng: np.random.Generator, size: float) -> Array:
        """Return parameters of `lower` as those of the structure itself, with gains ``size`` of the new state."""
        raise NotImplementedError

    @property
    def text(self) -> str:
        """The structure in a word or two."""
        return type(self).__name__

    def __repr__(self) -> str:
        arguments = {field.name: getattr(self, field.name) for field in fields(self) if field.repr}  # type: ignore[arg-type]
        words = [
            f"{name}={value:.6g}" if isinstance(value, float) else f"{name}={value!r}"
            for name, value in arguments.items()
            if value is not None
        ]
        return f"{type(self).__name__}({', '.join(words)})"

    def __add__(self, other: object) -> "Sum":
        added = instance("structure", other, ControllerForm, "a structure to add")
        return Sum((*terms(self), *terms(added)))

    def __mul__(self, other: object) -> "Series":
        first = instance("structure", other, ControllerForm, "a structure to put in series")
        if self.physicals() or first.physicals():
            raise ValueError("structure: a plant parameter cannot be in a series; add it")
        if isinstance(self, Decentralized) or isinstance(first, Decentralized):
            raise ValueError("structure: decentralized cannot be in a series; put the series into it")
        return Series(self, first)


def terms(structure: ControllerForm) -> tuple[ControllerForm, ...]:
    """Return the parts of a sum, or the structure itself."""
    return structure.parts if isinstance(structure, Sum) else (structure,)


def _gains(name: str, rows: Iterable[object], acts: Array, columns: Iterable[object], reads: Array) -> list[Free]:
    """Return free gains between signals with scales."""
    ends = product(zip(rows, acts, strict=True), zip(columns, reads, strict=True))
    return [Free(f"{name}[{u}, {y}]", GAIN, scale=float(act / read)) for (u, act), (y, read) in ends]


def _cut(x: Vector, sizes: list[int]) -> list[Vector]:
    """Return consecutive parts of a vector."""
    return [x[start:end] for start, end in pairwise(np.cumsum([0, *sizes]).tolist())]


def _by_rows(values: ca.SX, rows: int, columns: int) -> ca.SX:
    return ca.reshape(values, columns, rows).T


# name of the gains, unit of their rate, further free parameters, and the filter with these parameters
Term: TypeAlias = tuple[str, float, tuple[Free, ...], Callable[..., Realization]]


class Filtered(ControllerForm):
    """A sum of terms: gains from each measurement to each control, behind a filter on each measurement."""

    def terms(self, ports: Ports) -> list[Term]:
        """Return the terms."""
        raise NotImplementedError

    def free(self, ports: Ports) -> tuple[Free, ...]:
        result: list[Free] = []
        for name, rate, own, _ in self.terms(ports):
            result += [*_gains(name, ports.controls, rate * ports.acts, ports.measurements, ports.reads), *own]
        return tuple(result)

    def block(self, values: ca.SX, ports: Ports) -> Block:
        size, start, result, numbers = len(ports.acts) * len(ports.reads), 0, [], ca.vertsplit(values)
        for _, _, own, realization in self.terms(ports):
            end = start + size + len(own)
            gains = _by_rows(values[start : start + size], *ports.shape)
            result.append(filtered(gains, *realization(*numbers[start + size : end])))
            start = end
        return parallel(*result)


@dataclass(frozen=True, repr=False)
class Gain(Filtered):
    """A matrix of gains."""

    def terms(self, ports: Ports) -> list[Term]:
        return [("gain", 1.0, (), _passed)]


@dataclass(frozen=True, repr=False)
class Pid(Filtered):
    """Proportional, integral and filtered derivative gains."""

    integral: bool = True
    derivative: bool = True
    low: float | None = None
    high: float | None = None

    def terms(self, ports: Ports) -> list[Term]:
        corner = Free("filter", RATE, *ports.rates(self.low, self.high))
        result: list[Term] = [("proportional", 1.0, (), _passed)]
        result += [("integral", ports.rate, (), _integrated)] if self.integral else []
        return result + ([("derivative", 1.0 / ports.rate, (corner,), _differentiated)] if self.derivative else [])


@dataclass(frozen=True, repr=False)
class Ppf(Filtered):
    """Positive position feedback: ``G w^2/(s^2 + 2 z w s + w^2)``, a sum of one or more."""

    modes: int = 1
    low: float | None = None
    high: float | None = None

    def terms(self, ports: Ports) -> list[Term]:
        ends = ports.rates(self.low, self.high)
        tags = [""] if self.modes == 1 else [str(i + 1) for i in range(self.modes)]
        own = [(Free(f"frequency{tag}", RATE, *ends), Free(f"damping{tag}", RATIO, *_DAMPING)) for tag in tags]
        return [(f"ppf{tag}", 1.0, parameters, _resonated) for tag, parameters in zip(tags, own, strict=True)]


def _passed() -> Realization:
    return ca.SX(0, 0), ca.SX(0, 1), ca.SX(1, 0), 1.0


def _integrated() -> Realization:
    return ca.SX(1, 1), ca.SX(1), ca.SX(1), 0.0


def _differentiated(corner: ca.SX) -> Realization:
    return -corner, corner, -corner, corner


def _resonated(rate: ca.SX, damping: ca.SX) -> Realization:
    A = ca.blockcat([[0.0, rate], [-rate, -2.0 * damping * rate]])
    return A, ca.vertcat(0.0, rate), ca.SX([[1.0, 0.0]]), 0.0


@dataclass(frozen=True, repr=False)
class Notch(ControllerForm):
    """A notch on each of the signals that pass: ``(s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2)``."""

    low: float | None = None
    high: float | None = None
    square = True

    def free(self, ports: Ports) -> tuple[Free, ...]:
        ends = ports.rates(self.low, self.high)
        return (Free("notch", RATE, *ends), Free("depth", RATIO, *_DEEP), Free("width", RATIO, *_WIDE))

    def block(self, values: ca.SX, ports: Ports) -> Block:
        rate, deep, wide = ca.vertsplit(values)
        A, _, _, _ = _resonated(rate, wide)
        # the numerator less the denominator: 2 (a - b) w s; with the states w x1 = s^-1 x2, that is 2 (a - b) w x2
        C = ca.horzcat(0.0, 2.0 * (deep - wide) * rate)
        return filtered(ca.SX.eye(len(ports.acts)), A, ca.SX([0.0, 1.0]), C, 1.0)


@dataclass(frozen=True, repr=False)
class StateSpace(ControllerForm):
    """State space with all matrices free."""

    order: int
    strictly_proper: bool = False

    def _split(self, x: Vector, ports: Ports) -> list[Vector]:
        """Return the parts of a vector that are A, B, C and D, each row by row."""
        (rows, columns), n = ports.shape, self.order
        return _cut(x, [n * n, n * columns, rows * n, 0 if self.strictly_proper else rows * columns])

    def free(self, ports: Ports) -> tuple[Free, ...]:
        (rows, columns), n, one = map(range, ports.shape), range(self.order), np.ones(self.order)
        parts = [*_gains("A", n, ports.rate * one, n, one), *_gains("B", n, ports.rate * one, columns, ports.reads)]
        parts += _gains("C", rows, ports.acts, n, one)
        return (*parts, *([] if self.strictly_proper else _gains("D", rows, ports.acts, columns, ports.reads)))

    def block(self, values: ca.SX, ports: Ports) -> Block:
        (rows, columns), n = ports.shape, self.order
        A, B, C, D = self._split(values, ports)
        through = ca.SX(rows, columns) if self.strictly_proper else _by_rows(D, rows, columns)
        return Block(_by_rows(A, n, n), _by_rows(B, n, columns), _by_rows(C, rows, n), through)

    def lower(self) -> ControllerForm | None:
        if self.order == 1:
            return None if self.strictly_proper else Gain()
        return StateSpace(self.order - 1, self.strictly_proper)

    def grown(self, x: Array, ports: Ports, rng: np.random.Generator, size: float) -> Array:
        (rows, columns), old = ports.shape, self.order - 1
        A, B, C, D = StateSpace(old, self.strictly_proper)._split(x, ports)
        rate = np.exp(rng.uniform(np.log(ports.slowest), np.log(ports.fastest))) / ports.rate
        states = np.pad(A.reshape(old, old), ((0, 1), (0, 1)))
        states[-1, -1] = -rate
        reads = np.append(B, rng.normal(size=columns) * np.sqrt(rate))
        acts = np.column_stack([C.reshape(rows, old), size * rng.normal(size=rows) * np.sqrt(rate)])
        return np.concatenate([states.ravel(), reads, acts.ravel(), D])


@dataclass(frozen=True, repr=False)
class Physical(ControllerForm):
    """A parameter of the plant."""

    name: str
    low: float
    high: float

    @property
    def number(self) -> Free:
        """Free parameter of the search."""
        return Free(self.name, PHYSICAL, self.low, self.high)

    def free(self, ports: Ports) -> tuple[Free, ...]:
        return (self.number,)

    def block(self, values: ca.SX, ports: Ports) -> Block:
        return static(ca.SX(*ports.shape))

    def physicals(self) -> "tuple[Physical, ...]":
        return (self,)

    @property
    def text(self) -> str:
        return f"Physical {self.name} {self.low:.6g} to {self.high:.6g}"


class Composed(ControllerForm):
    """Composite of structures, printed as the composition."""

    def placed(self, ports: Ports) -> list[tuple[ControllerForm, Ports]]:
        """Return the parts with free parameters, and their ports."""
        raise NotImplementedError

    def free(self, ports: Ports) -> tuple[Free, ...]:
        """Return the free parameters of all parts; repeated names get the index of their part."""
        groups = [part.free(own) for part, own in self.placed(ports)]
        names = [free.name for group in groups for free in group]
        return tuple(
            replace(free, name=f"{free.name}.{i}") if names.count(free.name) > 1 else free
            for i, group in enumerate(groups, 1)
            for free in group
        )

    def split(self, x: Vector, ports: Ports) -> list[Vector]:
        """Return the parameters of each part."""
        return _cut(x, [len(part.free(own)) for part, own in self.placed(ports)])

    def blocks(self, values: ca.SX, ports: Ports) -> list[Block]:
        """Return the system of each part."""
        pairs = zip(self.placed(ports), self.split(values, ports), strict=True)
        return [part.block(own, there) for (part, there), own in pairs]

    def check(self, ports: Ports) -> None:
        for part, own in self.placed(ports):
            part.check(own)

    def drawn(self, ports: Ports, rng: np.random.Generator, level: float, quiet: bool) -> Array:
        return np.concatenate([part.drawn(own, rng, level, quiet) for part, own in self.placed(ports)])

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True, repr=False)
class Sum(Composed):
    """Sum of parts with the same measurements and controls."""

    parts: tuple[ControllerForm, ...]

    @property
    def text(self) -> str:
        return f"Sum({listed([part.text for part in self.parts], 80)})"

    def placed(self, ports: Ports) -> list[tuple[ControllerForm, Ports]]:
        return [(part, ports) for part in self.parts]

    def block(self, values: ca.SX, ports: Ports) -> Block:
        return parallel(*self.blocks(values, ports))

    def physicals(self) -> tuple[Physical, ...]:
        return tuple(item for part in self.parts for item in part.physicals())

    def lower(self) -> ControllerForm | None:
        for i, part in enumerate(self.parts):
            less = part.lower()
            if less is not None:
                return Sum((*self.parts[:i], less, *self.parts[i + 1 :]))
        return None

    def grown(self, x: Array, ports: Ports, rng: np.random.Generator, size: float) -> Array:
        i = next(i for i, part in enumerate(self.parts) if part.lower() is not None)
        less = self.lower()
        assert isinstance(less, Sum)
        result = less.split(x, ports)
        result[i] = self.parts[i].grown(result[i], ports, rng, size)
        return np.concatenate(result)


@dataclass(frozen=True, repr=False)
class Series(Composed):
    """Series of parts: the right one reads the measurements."""

    last: ControllerForm
    first: ControllerForm

    @property
    def text(self) -> str:
        return f"Series({self.last.text}, {self.first.text})"

    @property
    def square(self) -> bool:  # type: ignore[override]
        return self.last.square and self.first.square

    def placed(self, ports: Ports) -> list[tuple[ControllerForm, Ports]]:
        """Return the parts with their ports; unchanged signals keep their names and scales."""
        names, sizes = tuple(f"v{i + 1}" for i in range(len(ports.controls))), np.ones(len(ports.controls))
        if self.first.square:
            names, sizes = ports.measurements, ports.reads
        elif self.last.square:
            names, sizes = ports.controls, ports.acts
        behind, before = replace(ports, measurements=names, reads=sizes), replace(ports, controls=names, acts=sizes)
        return [(self.last, behind), (self.first, before)]

    def block(self, values: ca.SX, ports: Ports) -> Block:
        return series(*self.blocks(values, ports))

    def drawn(self, ports: Ports, rng: np.random.Generator, level: float, quiet: bool) -> Array:
        one = self.last.square or self.first.square  # of which gains alone are drawn
        return super().drawn(ports, rng, level if one else level**0.5, quiet)


@dataclass(frozen=True, repr=False)
class Decentralized(Composed):
    """Decentralized parts: each from some measurements to some controls."""

    loops: tuple[tuple[tuple[str, ...], tuple[str, ...], ControllerForm], ...]
    each: ControllerForm | None = None
    shared: bool = False

    @property
    def text(self) -> str:
        if self.each is not None:
            return f"Decentralized(each: {self.each.text}{', shared' if self.shared else ''})"
        loops = [f"{', '.join(ys)} -> {', '.join(us)}: {part.text}" for ys, us, part in self.loops]
        return f"Decentralized({listed(loops, 80)})"

    def _loops(self, ports: Ports) -> list[tuple[list[int], list[int], ControllerForm]]:
        """Return rows, columns and structure of each loop."""
        if self.each is not None:
            return [([i], [i], self.each) for i in range(len(ports.controls))]
        return [
            ([ports.controls.index(u) for u in us], [ports.measurements.index(y) for y in ys], structure)
            for ys, us, structure in self.loops
        ]

    def placed(self, ports: Ports) -> list[tuple[ControllerForm, Ports]]:
        """Return the parts with their ports; shared parameters have the same scales in all loops."""
        if self.shared:
            reads, acts = (np.full(len(sizes), np.exp(np.mean(np.log(sizes)))) for sizes in (ports.reads, ports.acts))
            ports = replace(ports, reads=reads, acts=acts)
        result = [(part, ports.part(rows, columns)) for rows, columns, part in self._loops(ports)]
        return result[:1] if self.shared else result

    def block(self, values: ca.SX, ports: Ports) -> Block:
        loops = self._loops(ports)
        blocks = self.blocks(values, ports) * (len(loops) if self.shared else 1)
        pairs = zip(loops, blocks, strict=True)
        return parallel(*(block.between(rows, columns, ports.shape) for (rows, columns, _), block in pairs))

    def check(self, ports: Ports) -> None:
        if self.each is not None and len(ports.measurements) != len(ports.controls):
            raise ValueError(
                f"decentralized: expected as many measurements as controls, got {len(ports.measurements)} and"
                f" {len(ports.controls)}; name the signals of each loop"
            )
        for measurements, controls, _ in self.loops:
            for name in measurements:
                known("measurement", name, ports.measurements)
            for name in controls:
                known("control", name, ports.controls)
        super().check(ports)
