"""Tuning problem: plants, controller structure, channels and free parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.lti.rounding import ALIKE, LEVEL, TINY
from boomctl.lti.system import Lti
from boomctl.synthesis.plants.channels import Channel, signal_indices
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tunable.blocks import Differentiated
from boomctl.tunable.structures import PHYSICAL, ControllerForm, Free, Ports
from boomctl.tuning.plants import Plants

_POINTS = 24  # frequencies at which the magnitudes of plants are evaluated
_ROUNDS = 30  # iterations of scaling rows and columns; the error converges quadratically
_LOW = 1e-3  # fraction of its peak at which a response is clipped for its mean magnitude
_LOG_RATIO = np.log(1e3)  # log ratio to the rest of its row and column below which a response is ignored for scaling
_LARGEST_GAIN = 1e6  # largest free parameter over its natural size: bounds infima at infinite gain
CONTROLLER = -1  # model index of the controller itself
GAIN_LIMIT, FASTEST_POLE, DAMPING, DECAY, EDGE = -1, -2, -3, -4, -5  # channel indices of bounds
BOUNDS = {GAIN_LIMIT: "max_gain", FASTEST_POLE: "fastest_pole", DAMPING: "min_damping_ratio", DECAY: "min_decay_rate"}
"""Names of the bounds."""


@dataclass(frozen=True)
class Problem:
    """Data of the search.

    Attributes
    ----------
    structure : ControllerForm
    plants : Plants
    channels : tuple of Channel
    ports : Ports
    limits : mapping of int to float
        Values of the specified bounds.
    columns, rows : tuple of ndarray
        Indices of each channel among the plants' disturbances and performance signals.
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
        """Return the problem of tuning a structure for plants, with scaled signals."""
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
        """Free parameters."""
        return self.structure.free(self.ports)

    @cached_property
    def low(self) -> Array:
        """Lower bounds of the search variables."""
        return np.array([max(item.ends()[0], -_LARGEST_GAIN) for item in self.free])

    @cached_property
    def high(self) -> Array:
        """Upper bounds of the search variables."""
        return np.array([min(item.ends()[1], _LARGEST_GAIN) for item in self.free])

    @cached_property
    def physical(self) -> Array:
        """Indices of the plant parameters among the free parameters."""
        return np.array([i for i, item in enumerate(self.free) if item.kind == PHYSICAL], dtype=int)

    @cached_property
    def matrix(self) -> Differentiated:
        """``[[A, B], [C, D]]`` of the controller in the users' units, with derivatives by the search variables."""
        x = ca.SX.sym("x", len(self.free))
        values = [item.expression(number) for item, number in zip(self.free, ca.vertsplit(x), strict=True)]
        return Differentiated(x, self.structure.block(ca.vertcat(*values), self.ports).matrix)

    @property
    def order(self) -> int:
        """Order of the controller."""
        return self.matrix.shape[0] - len(self.ports.controls)

    def offset(self, channel: int) -> float:
        """Return the logarithm of the unit of a norm: its limit, or 1."""
        return log((self.limits[channel] if channel < 0 else self.channels[channel].limit) or 1.0)

    @cached_property
    def constraints_alone(self) -> bool:
        """True if all channels have limits: then the largest ratio of a norm to its limit is minimized."""
        return all(item.limit is not None for item in self.channels)

    def is_limit(self, channel: int) -> bool:
        """Return True for a constraint: a bound, or a norm with a limit next to objectives."""
        return channel < 0 or (self.channels[channel].limit is not None and not self.constraints_alone)

    def values(self, x: Array) -> dict[str, float]:
        """Return the free parameters in the user's units."""
        return {item.name: item.value(number) for item, number in zip(self.free, x, strict=True)}

    def physical_values(self, x: Array) -> dict[str, float]:
        """Return the plant parameters only."""
        return {self.free[i].name: self.free[i].value(x[i]) for i in self.physical}

    @property
    def middle(self) -> Array:
        """Search variables at the middle of their ranges."""
        return 0.5 * (self.low + self.high)

    def clipped(self, x: Array) -> Array:
        """Return search variables clipped to their bounds."""
        return np.minimum(np.maximum(x, self.low), self.high)

    def lti(self, x: Array) -> Lti:
        """Return the controller as a system."""
        K, n = self.matrix.value(x), self.order
        labels = (self.ports.measurements, self.ports.controls, tuple(f"k[{i}]" for i in range(n)))
        return Lti(K[:n, :n], K[:n, n:], K[n:, :n], K[n:, n:], *labels)


def ports_of(plants: tuple[GeneralizedPlant, ...]) -> Ports:
    """Return the ports of a controller, with signals scaled such that ``P22`` is near one in the plant's band."""
    poles = (np.abs(plant.system.poles) for plant in plants)
    sizes = [rates[rates > LEVEL * rates.max(initial=0.0)] for rates in poles]
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
        size = np.where(size < np.minimum(*lines) - _LOG_RATIO, np.nan, size)
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
    """Return log magnitudes of responses, averaged over their upper three decades; nan for rounding error only."""
    part, n = part.balanced(), len(part.A)
    result = np.abs(part.response(omega, quiet=True))
    if n:  # below this fraction of the product of state and output magnitudes a response is rounding error
        states = replace(part, C=np.eye(n), D=np.zeros((n, part.D.shape[1])), output_labels=())
        moved = np.abs(states.response(omega, quiet=True)).max(axis=0)
        result = np.where(result > ALIKE * np.linalg.norm(part.C, axis=1)[:, None, None] * moved, result, 0.0)
    top = result.max(axis=2)
    there = (top > TINY) & np.isfinite(top)
    with np.errstate(divide="ignore"):
        size = np.log(np.maximum(result, _LOW * top[:, :, None])).mean(axis=2)
    return np.where(there, size, np.nan)


def _mean(values: Array, axis: int) -> Array:
    """Return the means over the finite entries, or 0."""
    there = np.isfinite(values)
    return np.where(there, values, 0.0).sum(axis=axis) / np.maximum(there.sum(axis=axis), 1)
