"""What is tuned: plants, a structure between them in well-chosen units, and what its free numbers are."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti
from boomctl.synthesis.plants.channels import Channel, signal_indices
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tunable.blocks import Differentiated
from boomctl.tunable.structures import PHYSICAL, ControllerForm, Free, Ports
from boomctl.tuning.plants import Plants

_POINTS = 24  # frequencies at which plants are looked at (a choice)
_ROUNDS = 30  # of scaling rows and columns in turn: each takes the square of what is left (a choice)
_SLOWEST = 1e-6  # share of the fastest pole below which a slow one says nothing about the band (a choice)
_LOW = 1e-3  # share of its peak down to which a response says how large it is: tails of rods fall for ever (a choice)
_NOTHING = (
    1e-10  # share of what its entry and exit alone would let through below which a response is rounding (a choice)
)
_BESIDE = np.log(1e3)  # below all in its row and in its column, by which a response says nothing of sizes (a choice)
_LARGEST_GAIN = 1e6  # times its natural size, beyond which no free number goes: an infimum at infinite gain (a choice)
CONTROLLER = -1  # stands in place of a plant
GAIN_LIMIT, FASTEST_POLE, DAMPING, DECAY, EDGE = -1, -2, -3, -4, -5  # these in place of a channel
BOUNDS = {GAIN_LIMIT: "max_gain", FASTEST_POLE: "fastest_pole", DAMPING: "min_damping_ratio", DECAY: "min_decay_rate"}
"""What bounds are called."""


@dataclass(frozen=True)
class Problem:
    """Everything that the search needs.

    Attributes
    ----------
    structure : ControllerForm
    plants : Plants
    channels : tuple of Channel
    ports : Ports
    limits : mapping of int to float
        Of the bounds that are asked for.
    columns, rows : tuple of ndarray
        Of each channel among the plants' disturbances and performance signals.
    """

    structure: ControllerForm
    plants: Plants
    channels: tuple[Channel, ...]
    ports: Ports
    limits: Mapping[int, float]
    columns: tuple[Array, ...]
    rows: tuple[Array, ...]

    @classmethod
    def of(
        cls, structure: ControllerForm, plants: Plants, channels: tuple[Channel, ...], limits: Mapping[int, float]
    ) -> "Problem":
        """Return the problem of tuning a structure for plants, in units in which these are near one."""
        ports = ports_of(plants.middle)
        fastest = limits.get(FASTEST_POLE, np.inf)
        ports = replace(ports, fastest=min(ports.fastest, fastest), rate=min(ports.rate, fastest))
        first = plants.middle[0]
        for channel in channels:
            for name in channel.inputs or ():
                known("disturbance", name, first.disturbances)
            for name in channel.outputs or ():
                known("performance signal", name, first.performance)
        ends = [signal_indices(first, channel) for channel in channels]
        columns, rows = (tuple(np.array(item[k]) for item in ends) for k in (0, 1))
        return cls(structure, plants, channels, ports, limits, columns, rows)

    @cached_property
    def free(self) -> tuple[Free, ...]:
        """The free numbers."""
        return self.structure.free(self.ports)

    @cached_property
    def low(self) -> Array:
        """Lower ends of the search's numbers."""
        return np.array([max(item.ends()[0], -_LARGEST_GAIN) for item in self.free])

    @cached_property
    def high(self) -> Array:
        """Upper ends of the search's numbers."""
        return np.array([min(item.ends()[1], _LARGEST_GAIN) for item in self.free])

    @cached_property
    def physical(self) -> Array:
        """Places of the physical parameters among the free numbers."""
        return np.array([i for i, item in enumerate(self.free) if item.kind == PHYSICAL], dtype=int)

    @cached_property
    def matrix(self) -> Differentiated:
        """``[[A, B], [C, D]]`` of the controller in the users' units, with derivatives by the free numbers."""
        x = ca.SX.sym("x", len(self.free))
        values = [item.expression(number) for item, number in zip(self.free, ca.vertsplit(x), strict=True)]
        return Differentiated(x, self.structure.block(ca.vertcat(*values), self.ports).matrix)

    @property
    def order(self) -> int:
        """Of the controller."""
        return self.matrix.shape[0] - len(self.ports.controls)

    def offset(self, channel: int) -> float:
        """Return the logarithm of what a norm counts in."""
        return log((self.limits[channel] if channel < 0 else self.channels[channel].budget) or 1.0)

    @cached_property
    def budgets_alone(self) -> bool:
        """Whether all channels have budgets, of which the one used up the most is to be small."""
        return all(item.budget is not None for item in self.channels)

    def is_limit(self, channel: int) -> bool:
        """Return whether a norm, or another bound, is only to stay below its budget."""
        return channel < 0 or (self.channels[channel].budget is not None and not self.budgets_alone)

    def values(self, x: Array) -> dict[str, float]:
        """Return what the free numbers stand for, in the users' units."""
        return {item.name: item.value(number) for item, number in zip(self.free, x, strict=True)}

    def physical_values(self, x: Array) -> dict[str, float]:
        """Return the physical parameters alone."""
        return {self.free[i].name: self.free[i].value(x[i]) for i in self.physical}

    @property
    def middle(self) -> Array:
        """Free numbers in the middle of their ranges."""
        return 0.5 * (self.low + self.high)

    def clipped(self, x: Array) -> Array:
        """Return numbers within their ends."""
        return np.minimum(np.maximum(x, self.low), self.high)

    def lti(self, x: Array) -> Lti:
        """Return the controller as a system."""
        K, n = self.matrix.value(x), self.order
        labels = (self.ports.measurements, self.ports.controls, tuple(f"k[{i}]" for i in range(n)))
        return Lti(K[:n, :n], K[:n, n:], K[n:, :n], K[n:, n:], *labels)


def ports_of(plants: tuple[GeneralizedPlant, ...]) -> Ports:
    """Return the ports of a controller: the sizes of its signals are such that ``P22`` is near one in the plant's band."""
    poles = (np.abs(plant.system.poles) for plant in plants)
    sizes = [rates[rates > _SLOWEST * rates.max(initial=0.0)] for rates in poles]
    rates = np.concatenate([size for size in sizes if len(size)] or [np.ones(1)])
    omega, first = np.geomspace(rates.min() / 3.0, rates.max() * 3.0, _POINTS), plants[0]
    rows, columns = np.zeros(first.nmeas), np.zeros(first.ncon)
    if first.nmeas and first.ncon:
        size = np.zeros((first.nmeas, first.ncon))
        for plant in plants:
            part = replace(plant.system, B=plant.B2, C=plant.C2, D=plant.D22, input_labels=(), output_labels=())
            size += _size(part, omega)
        size /= len(plants)
        lines = [np.fmax.reduce(size, axis=k, initial=-np.inf, keepdims=True) for k in (0, 1)]
        size = np.where(size < np.minimum(*lines) - _BESIDE, np.nan, size)
        for _ in range(_ROUNDS):
            rows = _mean(size + columns, 1)
            columns = -_mean(size - rows[:, None], 0)
    return Ports(
        first.measurements,
        first.controls,
        np.exp(rows),
        np.exp(columns),
        float(np.exp(np.mean(np.log(rates)))),
        float(rates.min()),
        float(rates.max()),
    )


def _size(part: Lti, omega: Array) -> Array:
    """Return logarithms of the sizes of responses, by their upper three decades; nan where nothing but rounding passes."""
    part, n = part.balanced(), len(part.A)
    result = np.abs(part.response(omega, quiet=True))
    if n:
        states = replace(part, C=np.eye(n), D=np.zeros((n, part.D.shape[1])), output_labels=())
        moved = np.abs(states.response(omega, quiet=True)).max(axis=0)
        result = np.where(result > _NOTHING * np.linalg.norm(part.C, axis=1)[:, None, None] * moved, result, 0.0)
    top = result.max(axis=2)
    there = (top > TINY) & np.isfinite(top)
    with np.errstate(divide="ignore"):
        size = np.log(np.maximum(result, _LOW * top[:, :, None])).mean(axis=2)
    return np.where(there, size, np.nan)


def _mean(values: Array, axis: int) -> Array:
    """Return means over what is there; zero where nothing is."""
    there = np.isfinite(values)
    return np.where(there, values, 0.0).sum(axis=axis) / np.maximum(there.sum(axis=axis), 1)
