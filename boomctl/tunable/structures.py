"""Structures of controllers: what their free numbers are, and the system that these make, with its derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import exp, inf, log

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance
from boomctl.printing import listed
from boomctl.tunable.jets import Jet, SystemJet, entries, fixed, repeated, static

GAIN, RATE, RATIO, PHYSICAL = "gain", "rate", "ratio", "physical"
_SPAN = 100.0  # times the plant's own band, to either side: where rates may lie that nobody bounds (a choice)
_DAMPING = (0.05, 2.0)  # damping ratios of a positive position feedback (a choice: a filter, and no second resonance)
_DEEP, _WIDE = (1e-3, 1.0), (0.02, 3.0)  # damping ratios of a notch's zeros and poles (choices)


@dataclass(frozen=True)
class Free:
    """One free number: its name, what it is, the ends of its range, and what a one of the search stands for.

    What is positive is searched for as its logarithm.
    """

    name: str
    kind: str
    low: float = -inf
    high: float = inf
    scale: float = 1.0

    @property
    def logarithmic(self) -> bool:
        """Whether the search goes along the logarithm."""
        return self.kind in (RATE, RATIO)

    def ends(self) -> tuple[float, float]:
        """Return the range in the search's own number: logarithms, or for a physical parameter from -1 to 1."""
        if self.logarithmic:
            return log(self.low), log(self.high)
        return (-1.0, 1.0) if self.kind == PHYSICAL else (self.low, self.high)

    def value(self, x: float) -> float:
        """Return what a number of the search stands for."""
        if self.logarithmic:
            return float(min(max(exp(x), self.low), self.high))
        if self.kind == PHYSICAL:
            return (
                0.5 * (1.0 - float(x)) * self.low + 0.5 * (1.0 + float(x)) * self.high
            )  # at -1 and 1 the ends themselves
        return self.scale * float(x)

    def number(self, value: float) -> float:
        """Return the number of the search that stands for a value."""
        if self.logarithmic:
            return log(value)
        if self.kind == PHYSICAL:
            return (value - 0.5 * (self.low + self.high)) / (0.5 * (self.high - self.low))
        return value / self.scale


@dataclass(frozen=True)
class Ports:
    """What a structure is put between: measurements and controls, their sizes, and the plant's band.

    Attributes
    ----------
    measurements, controls : tuple of str
        Names, none where a part lies within a series.
    reads, acts : ndarray
        Sizes of the measurements and of the controls, so that a gain of one is neither small nor large.
    rate : float
        What rates count in [rad/s].
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


class ControllerForm:
    """What a controller is made of: parts can be added, and put in series by ``*``, the right one reading first."""

    square = False  # whether there are as many outputs as inputs, whatever their number

    def free(self, ports: Ports) -> tuple[Free, ...]:
        """Return the free numbers."""
        raise NotImplementedError

    def system(self, x: Array, ports: Ports) -> SystemJet:
        """Return the system that free numbers make, in the units of the signals."""
        raise NotImplementedError

    def physicals(self) -> "tuple[Physical, ...]":
        """Return the physical parameters among the parts."""
        return ()

    @property
    def text(self) -> str:
        """The structure in a word or two."""
        return type(self).__name__

    def __repr__(self) -> str:
        given = {field.name: getattr(self, field.name) for field in fields(self) if field.repr}  # type: ignore[arg-type]
        words = [
            f"{name}={value:.6g}" if isinstance(value, float) else f"{name}={value!r}"
            for name, value in given.items()
            if value is not None
        ]
        return f"{type(self).__name__}({', '.join(words)})"

    def __add__(self, other: object) -> "Sum":
        added = instance("structure", other, ControllerForm, "a structure to add")
        return Sum((*_parts(self), *_parts(added)))

    def __mul__(self, other: object) -> "Series":
        first = instance("structure", other, ControllerForm, "a structure to put in series")
        if self.physicals() or first.physicals():
            raise ValueError("structure: a physical parameter cannot stand in a series; add it")
        return Series(self, first)


def _parts(structure: ControllerForm) -> tuple[ControllerForm, ...]:
    return structure.parts if isinstance(structure, Sum) else (structure,)


def _each(ports: Ports, name: str, rate: float = 1.0) -> tuple[Free, ...]:
    """Return a free gain from each measurement to each control."""
    return tuple(
        Free(f"{name}[{u}, {y}]", GAIN, scale=float(act / read) * rate)
        for u, act in zip(ports.controls, ports.acts, strict=True)
        for y, read in zip(ports.measurements, ports.reads, strict=True)
    )


def _scaled(jet: Jet, ports: Ports) -> Jet:
    return jet.times(ports.acts, 1.0 / ports.reads)


@dataclass(frozen=True, repr=False)
class Gain(ControllerForm):
    """A matrix of gains."""

    def free(self, ports: Ports) -> tuple[Free, ...]:
        return _each(ports, "gain")

    def system(self, x: Array, ports: Ports) -> SystemJet:
        return static(_scaled(entries(x, *ports.shape), ports))


@dataclass(frozen=True, repr=False)
class Pid(ControllerForm):
    """Proportional, integral and filtered derivative gains."""

    integral: bool = True
    derivative: bool = True
    low: float | None = None
    high: float | None = None

    def free(self, ports: Ports) -> tuple[Free, ...]:
        result = _each(ports, "proportional")
        if self.integral:
            result += _each(ports, "integral", ports.rate)
        if self.derivative:
            result += (
                *_each(ports, "derivative", 1.0 / ports.rate),
                Free("filter", RATE, *ports.rates(self.low, self.high)),
            )
        return result

    def system(self, x: Array, ports: Ports) -> SystemJet:
        (rows, columns), k = ports.shape, len(x)
        size, unit = rows * columns, np.eye(columns)
        result = static(_scaled(entries(x, rows, columns, 0, k), ports))
        start = size
        if self.integral:
            C = _scaled(entries(x * ports.rate, rows, columns, start, k), ports)
            C = Jet(C.value, C.slopes * ports.rate)
            still = fixed(np.zeros((columns, columns)), k)
            result = result.beside(SystemJet(still, fixed(unit, k), C, fixed(np.zeros((rows, columns)), k)))
            start += size
        if self.derivative:
            rate, by = exp(x[-1]), np.zeros((k, 1, 1))
            by[-1] = rate
            corner = Jet(rate * unit, by * unit)
            gains = _scaled(entries(x / ports.rate, rows, columns, start, k), ports)
            gains = Jet(gains.value, gains.slopes / ports.rate)
            direct = gains @ corner
            result = result.beside(
                SystemJet(Jet(-corner.value, -corner.slopes), corner, Jet(-direct.value, -direct.slopes), direct)
            )
        return result


@dataclass(frozen=True, repr=False)
class Lead(ControllerForm):
    """A gain with a zero and a pole: ``G (s/z + 1)/(s/p + 1)``."""

    low: float | None = None
    high: float | None = None

    def free(self, ports: Ports) -> tuple[Free, ...]:
        ends = ports.rates(self.low, self.high)
        return (*_each(ports, "gain"), Free("zero", RATE, *ends), Free("pole", RATE, *ends))

    def system(self, x: Array, ports: Ports) -> SystemJet:
        (rows, columns), k = ports.shape, len(x)
        zero, pole, unit = exp(x[-2]), exp(x[-1]), np.eye(columns)
        by_pole, by_zero = np.zeros((k, 1, 1)), np.zeros((k, 1, 1))
        by_pole[-1], by_zero[-2] = 1.0, 1.0
        corner = Jet(pole * unit, pole * by_pole * unit)
        # (s/z + 1)/(s/p + 1) = p/z + (1 - p/z) p/(s + p)
        ratio = pole / zero
        slope = ratio * (by_pole - by_zero)
        through = Jet(ratio * unit, slope * unit)
        rest = Jet((1.0 - ratio) * unit, -slope * unit)
        system = SystemJet(Jet(-corner.value, -corner.slopes), corner, rest, through)
        return static(_scaled(entries(x, rows, columns, 0, k), ports)).after(system)


@dataclass(frozen=True, repr=False)
class Notch(ControllerForm):
    """A notch on each of the signals that pass: ``(s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2)``."""

    low: float | None = None
    high: float | None = None
    square = True

    def free(self, ports: Ports) -> tuple[Free, ...]:
        ends = ports.rates(self.low, self.high)
        return (Free("notch", RATE, *ends), Free("depth", RATIO, *_DEEP), Free("width", RATIO, *_WIDE))

    def system(self, x: Array, ports: Ports) -> SystemJet:
        rate, deep, wide = (exp(value) for value in x)
        A = Jet(np.array([[0.0, rate], [-rate, -2.0 * wide * rate]]), np.zeros((3, 2, 2)))
        A.slopes[0] = A.value
        A.slopes[2, 1, 1] = -2.0 * wide * rate
        B = Jet(np.array([[0.0], [1.0]]), np.zeros((3, 2, 1)))
        # the numerator less the denominator: 2 (a - b) w s; with the states w x1 = s^-1 x2, that is 2 (a - b) w x2
        gain = 2.0 * (deep - wide) * rate
        C = Jet(np.array([[0.0, gain]]), np.zeros((3, 1, 2)))
        C.slopes[0, 0, 1], C.slopes[1, 0, 1], C.slopes[2, 0, 1] = gain, 2.0 * deep * rate, -2.0 * wide * rate
        return repeated(SystemJet(A, B, C, fixed(np.ones((1, 1)), 3)), ports.shape[0])


@dataclass(frozen=True, repr=False)
class Ppf(ControllerForm):
    """Positive position feedback: ``G w^2/(s^2 + 2 z w s + w^2)``, a sum of one or more."""

    modes: int = 1
    low: float | None = None
    high: float | None = None

    def free(self, ports: Ports) -> tuple[Free, ...]:
        result: tuple[Free, ...] = ()
        for i in range(self.modes):
            tag = "" if self.modes == 1 else f"{i + 1}"
            result += _each(ports, f"ppf{tag}")
            result += (Free(f"frequency{tag}", RATE, *ports.rates(self.low, self.high)),)
            result += (Free(f"damping{tag}", RATIO, *_DAMPING),)
        return result

    def system(self, x: Array, ports: Ports) -> SystemJet:
        (rows, columns), k = ports.shape, len(x)
        size, result = rows * columns, None
        for start in range(0, k, size + 2):
            rate, damping = exp(x[start + size]), exp(x[start + size + 1])
            A = Jet(np.array([[0.0, rate], [-rate, -2.0 * damping * rate]]), np.zeros((k, 2, 2)))
            A.slopes[start + size] = A.value
            A.slopes[start + size + 1, 1, 1] = -2.0 * damping * rate
            B = Jet(np.array([[0.0], [rate]]), np.zeros((k, 2, 1)))
            B.slopes[start + size, 1, 0] = rate
            C = fixed(np.array([[1.0, 0.0]]), k)
            filters = repeated(SystemJet(A, B, C, fixed(np.zeros((1, 1)), k)), columns)
            mode = static(_scaled(entries(x, rows, columns, start, k), ports)).after(filters)
            result = mode if result is None else result.beside(mode)
        assert result is not None
        return result


@dataclass(frozen=True, repr=False)
class StateSpace(ControllerForm):
    """All matrices free."""

    order: int
    strictly_proper: bool = False

    def free(self, ports: Ports) -> tuple[Free, ...]:
        states, rate, acts, reads = np.ones(self.order), ports.rate, ports.acts, ports.reads
        parts = {
            "A": rate * np.outer(states, states),
            "B": rate * np.outer(states, 1.0 / reads),
            "C": np.outer(acts, states),
            "D": np.outer(acts, 1.0 / reads),
        }
        kept = [letter for letter in parts if letter != "D" or not self.strictly_proper]
        return tuple(
            Free(f"{letter}[{i}, {j}]", GAIN, scale=float(parts[letter][i, j]))
            for letter in kept
            for i in range(parts[letter].shape[0])
            for j in range(parts[letter].shape[1])
        )

    def system(self, x: Array, ports: Ports) -> SystemJet:
        (rows, columns), n, k = ports.shape, self.order, len(x)
        rate, one = np.full(n, ports.rate), np.ones(n)
        A = entries(x, n, n, 0, k).times(rate, one)
        B = entries(x, n, columns, n * n, k).times(rate, 1.0 / ports.reads)
        C = entries(x, rows, n, n * (n + columns), k).times(ports.acts, one)
        if self.strictly_proper:
            return SystemJet(A, B, C, fixed(np.zeros((rows, columns)), k))
        D = entries(x, rows, columns, n * (n + columns + rows), k)
        return SystemJet(A, B, C, _scaled(D, ports))


@dataclass(frozen=True, repr=False)
class Physical(ControllerForm):
    """A parameter of the plant."""

    name: str
    low: float
    high: float

    @property
    def number(self) -> Free:
        """What is searched for."""
        return Free(self.name, PHYSICAL, self.low, self.high)

    def free(self, ports: Ports) -> tuple[Free, ...]:
        return (self.number,)

    def system(self, x: Array, ports: Ports) -> SystemJet:
        return static(fixed(np.zeros(ports.shape), 1))

    def physicals(self) -> "tuple[Physical, ...]":
        return (self,)

    @property
    def text(self) -> str:
        return f"Physical {self.name} {self.low:.6g} to {self.high:.6g}"


class Composed(ControllerForm):
    """Structures together, which are shown as their words say."""

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True, repr=False)
class Sum(Composed):
    """Parts that read the same measurements and whose outputs add up."""

    parts: tuple[ControllerForm, ...]

    def free(self, ports: Ports) -> tuple[Free, ...]:
        return _uniquely_named([part.free(ports) for part in self.parts])

    def system(self, x: Array, ports: Ports) -> SystemJet:
        result, start = static(fixed(np.zeros(ports.shape), len(x))), 0
        for part in self.parts:
            size = len(part.free(ports))
            result = result.beside(part.system(x[start : start + size], ports).moved(start, len(x)))
            start += size
        return result

    @property
    def text(self) -> str:
        return f"Sum({listed([part.text for part in self.parts], 80)})"

    def physicals(self) -> tuple[Physical, ...]:
        return tuple(item for part in self.parts for item in part.physicals())


@dataclass(frozen=True, repr=False)
class Series(Composed):
    """One part after the other: the right one reads the measurements."""

    last: ControllerForm
    first: ControllerForm

    @property
    def text(self) -> str:
        return f"Series({self.last.text}, {self.first.text})"

    @property
    def square(self) -> bool:  # type: ignore[override]
        return self.last.square and self.first.square

    def _ports(self, ports: Ports) -> tuple[Ports, Ports]:
        """Return the ports of either part; between them signals count in ones."""
        if self.first.square:  # what passes unchanged keeps names and sizes
            return ports, replace(
                ports, controls=ports.measurements, acts=np.ones(len(ports.reads)), reads=np.ones(len(ports.reads))
            )
        if self.last.square:
            ones = np.ones(len(ports.acts))
            return replace(ports, measurements=ports.controls, reads=ones, acts=ones), ports
        inner = ports.shape[0]
        names, ones = tuple(f"v{i + 1}" for i in range(inner)), np.ones(inner)
        behind, before = replace(ports, measurements=names, reads=ones), replace(ports, controls=names, acts=ones)
        return behind, before

    def free(self, ports: Ports) -> tuple[Free, ...]:
        behind, before = self._ports(ports)
        return _uniquely_named([self.last.free(behind), self.first.free(before)])

    def system(self, x: Array, ports: Ports) -> SystemJet:
        behind, before = self._ports(ports)
        size = len(self.last.free(behind))
        last = self.last.system(x[:size], behind).moved(0, len(x))
        return last.after(self.first.system(x[size:], before).moved(size, len(x)))


@dataclass(frozen=True, repr=False)
class Decentralized(Composed):
    """Parts between signals of their own: each from some measurements to some controls."""

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

    def _own(self, ports: Ports) -> Ports:
        """Return ports in which the same numbers mean the same gains in the users' units, where loops share them."""
        if not self.shared:
            return ports
        reads, acts = (np.full(len(sizes), np.exp(np.mean(np.log(sizes)))) for sizes in (ports.reads, ports.acts))
        return replace(ports, reads=reads, acts=acts)

    def free(self, ports: Ports) -> tuple[Free, ...]:
        own = self._own(ports)
        result = [part.free(own.part(rows, columns)) for rows, columns, part in self._loops(ports)]
        return result[0] if self.shared else _uniquely_named(result)

    def system(self, x: Array, ports: Ports) -> SystemJet:
        result, start, own = static(fixed(np.zeros(ports.shape), len(x))), 0, self._own(ports)
        for rows, columns, part in self._loops(ports):
            mine = own.part(rows, columns)
            size = len(part.free(mine))
            system = part.system(x[start : start + size], mine).moved(start, len(x))
            result = result.beside(system.placed(rows, columns, ports.shape))
            start += 0 if self.shared else size
        return result


def _uniquely_named(groups: list[tuple[Free, ...]]) -> tuple[Free, ...]:
    """Return free numbers of several parts; names that come twice get the number of their part."""
    names = [free.name for group in groups for free in group]
    result = []
    for i, group in enumerate(groups):
        for free in group:
            twice = names.count(free.name) > 1
            result.append(replace(free, name=f"{free.name}.{i + 1}" if twice else free.name))
    return tuple(result)
