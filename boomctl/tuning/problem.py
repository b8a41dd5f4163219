"""The loops that are tuned: plants in well-chosen units, a structure between them, and what its free numbers are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance, blocks
from boomctl.lti.modal import block_diagonal
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti
from boomctl.synthesis.plants.channels import Channel
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tunable.jets import Jet
from boomctl.tunable.structures import PHYSICAL, ControllerForm, Free, Ports

_POINTS = 24  # frequencies at which plants are looked at (a choice)
_ROUNDS = 30  # of scaling rows and columns in turn: each takes the square of what is left (a choice)
_SLOWEST = 1e-6  # share of the fastest pole below which a slow one says nothing about the band (a choice)
_MARGIN = 1e-9  # share of a loop's own band by which its poles stay left of the axis: above rounding (a choice)
_INDEPENDENT = 1e7  # size of the inverse of eigenvectors up to which responses keep eight digits (a choice)
_HAIR = 1e-7  # share of itself by which such an eigenvalue is moved: far less than norms are tuned to
_LOW = 1e-3  # share of its peak down to which a response says how large it is: tails of rods fall for ever (a choice)
_NOTHING = (
    1e-10  # share of what its entry and exit alone would let through below which a response is rounding (a choice)
)
_BESIDE = np.log(1e3)  # below all in its row and in its column, by which a response says nothing of sizes (a choice)
_ILL_POSED = 1e-10  # least singular value of I - K D22 up to which a loop is not well-posed (a choice)


@dataclass
class ScaledPlant(GeneralizedPlant):
    """A generalized plant in units in which its gains are near one, and with balanced states.

    Attributes
    ----------
    slopes, bends : ndarray or None
        First and second derivatives of ``matrix`` by physical parameters, (k, r, c) and (k, k, r, c), where they are known.
    """

    slopes: Array | None = None
    bends: Array | None = None
    _frames: dict[int, tuple[Array, Array, Array, Array]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def of(cls, plant: GeneralizedPlant, states: Array | None = None) -> "ScaledPlant":
        """Return a plant with its states divided by ``states``, by default by what balances it."""
        s = plant.system
        if states is None:
            states = balance(s.A)[1]
        A = _without_jordan_blocks(s.A * states / states[:, None])
        return cls(replace(s, A=A, B=s.B / states[:, None], C=s.C * states), plant.nmeas, plant.ncon)

    def moving(self, slopes: Array, bends: Array, states: Array) -> "ScaledPlant":
        """Return the plant with derivatives of its matrices, its states having been divided by ``states``."""
        rows = np.concatenate([states, np.ones(slopes.shape[1] - len(states))])[:, None]
        columns = np.concatenate([states, np.ones(slopes.shape[2] - len(states))])
        return replace(self, slopes=slopes / rows * columns, bends=bends / rows * columns)

    def frame(self, order: int) -> tuple[Array, Array, Array, Array]:
        """Return the plant with the states of a controller of some order beside its own, that read and do nothing yet.

        These are ``[[A, B], [C, D]]`` from disturbances to performance, what the rates of the controller's states and its
        controls add to that, and what the states and the measurements read of it; last what these read of the controls.
        """
        if order not in self._frames:
            n, nu, ny, nw, nz = len(self.A), self.ncon, self.nmeas, self.nw, self.nz
            M12 = np.zeros((n + order + nz, order + nu))
            M12[:n, order:], M12[n + order :, order:] = self.B2, self.D12
            M12[n : n + order, :order] = np.eye(order)
            M21 = np.zeros((order + ny, n + order + nw))
            M21[order:, :n], M21[order:, n + order :] = self.C2, self.D21
            M21[:order, n : n + order] = np.eye(order)
            M = np.zeros((n + order + nz, n + order + nw))
            M[:n, :n], M[:n, n + order :] = self.A, self.B1
            M[n + order :, :n], M[n + order :, n + order :] = self.C1, self.D11
            through = np.zeros((order + ny, order + nu))
            through[order:, order:] = self.D22
            self._frames[order] = M, M12, M21, through
        return self._frames[order]

    @property
    def matrix(self) -> Array:
        """All of it in one matrix."""
        s = self.system
        return blocks([[s.A, s.B], [s.C, s.D]])


def _without_jordan_blocks(A: Array) -> Array:
    """Return a matrix whose equal eigenvalues without eigenvectors of their own, as of weights, are a hair apart.

    The search alone uses it: responses are then fast, and off by no more than that hair.
    """
    if not len(A) or independent(A) is not None:
        return A
    blocks, columns, widths = block_diagonal(A, _INDEPENDENT**0.5)
    start, apart = 0, np.zeros_like(A)
    for width in widths:
        part = slice(start, start + width)
        block = blocks[part, part]
        if width > 1 and independent(block) is None:  # the transpose of what is nilpotent tells them apart the most
            nilpotent = block - np.eye(width) * np.trace(block) / width
            size = float(np.linalg.norm(nilpotent))
            apart[part, part] = _HAIR * float(np.linalg.norm(block)) * nilpotent.T / max(size, TINY)
        start += width
    result = A + columns @ apart @ np.linalg.inv(columns)
    return result if independent(result) is not None else A


def independent(A: Array) -> tuple[Array, Array, Array] | None:
    """Return eigenvalues, the inverse of the eigenvectors and the eigenvectors, if these are independent."""
    try:
        values, vectors = np.linalg.eig(A)
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    if not np.abs(inverse).sum(axis=1).max() <= _INDEPENDENT:  # of vectors of length one
        return None
    return values.astype(complex), inverse.astype(complex), vectors.astype(complex)


@dataclass(frozen=True)
class Closed:
    """A closed loop, and what carries changes of the controller's matrices ``[[A, B], [C, D]]`` into it.

    A change ``d`` of the controller changes ``[[A, B], [C, D]]`` of the loop by ``before @ d @ after``, to first order, and
    reads itself through ``around``.  Where the plant moves with physical parameters, ``d`` is that of the controller and that
    of the plant's matrix on a diagonal.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    before: Array
    after: Array
    around: Array

    @cached_property
    def coordinates(self) -> tuple[Array, Array, Array]:
        """``A`` in coordinates in which solving is fast, and the ways into them and out of them.

        Those of the eigenvectors, where these are independent, ``A`` being the vector of the eigenvalues; else those of
        the Schur form.
        """
        if not len(self.A):
            return np.zeros(0, complex), self.A.astype(complex), self.A.astype(complex)
        result = independent(self.A)
        if result is not None:
            return result
        T, Z = linalg.schur(self.A, output="complex", check_finite=False)
        return T, Z.conj().T, Z

    @cached_property
    def poles(self) -> Array:
        """Eigenvalues [rad/s]."""
        if "coordinates" not in self.__dict__:  # which take longer, and are not always asked for
            return np.linalg.eigvals(self.A).astype(complex) if len(self.A) else np.zeros(0, complex)
        A = self.coordinates[0]
        return A if A.ndim == 1 else np.diagonal(A)

    @property
    def abscissa(self) -> float:
        """Largest real part of the poles."""
        return float(self.poles.real.max(initial=-np.inf))

    @property
    def margin(self) -> float:
        """By how much the poles are to stay left of the axis, so that rounding cannot take them over it."""
        return _MARGIN * float(np.abs(self.poles).max(initial=0.0))

    def part(self, columns: Array, rows: Array) -> tuple[Array, Array, Array]:
        """Return ``B``, ``C`` and ``D`` of a channel."""
        return self.B[:, columns], self.C[rows], self.D[rows][:, columns]


def close(plant: ScaledPlant, K: Array, order: int) -> Closed | None:
    """Return a plant closed by a controller ``[[A, B], [C, D]]`` of some order; None where the loop is not well-posed."""
    n, nu, ny, nw, nz = len(plant.A), plant.ncon, plant.nmeas, plant.nw, plant.nz
    M, M12, M21, through = plant.frame(order)
    gain, before, after, around, inverse = K, M12, M21, through, np.eye(len(K))
    if through.any():
        left = np.eye(len(K)) - K @ through
        if linalg.svdvals(left)[-1] <= _ILL_POSED:
            return None
        inverse = np.linalg.inv(left)
        gain = inverse @ K
        before, after, around = M12 @ inverse, (np.eye(len(M21)) + through @ gain) @ M21, through @ inverse
    M = M + M12 @ gain @ M21
    end = n + order
    if plant.slopes is not None:  # what the plant adds to its states, outputs and measurements, and what it reads
        adds, reads = np.zeros((end + nz, n + nz + ny)), np.zeros((n + nw + nu, end + nw))
        adds[:n, :n], adds[end:, n : n + nz] = np.eye(n), np.eye(nz)
        adds[:, n + nz :] = M12 @ gain[:, order:]
        reads[:n, :n], reads[n : n + nw, end:] = np.eye(n), np.eye(nw)
        reads[n + nw :] = gain[order:] @ M21
        controls, measured = order + ny + n + nw, order + nu + n + nz  # where these begin among what is read and added
        whole = np.zeros((controls + nu, measured + ny))
        whole[: order + ny, : order + nu] = around
        whole[order : order + ny, measured:] = np.eye(ny) + plant.D22 @ gain[order:, order:]
        whole[controls:, : order + nu] = inverse[order:]
        whole[controls:, measured:] = gain[order:, order:]
        before, after, around = np.hstack([before, adds]), np.vstack([after, reads]), whole
    return Closed(M[:end, :end], M[:end, end:], M[end:, :end], M[end:, end:], before, after, around)


@dataclass(frozen=True)
class Problem:
    """Everything that the search needs.

    Attributes
    ----------
    structure : ControllerForm
    ports : Ports
    free : tuple of Free
    low, high : ndarray
        Ends of the search's numbers, infinite where there are none.
    plants : function
        Returns the scaled plants at values of the physical parameters.
    count : int
        Number of plants.
    channels : tuple of Channel
    columns, rows : tuple of ndarray
        Of each channel in the plant's signals.
    order : int
        Of the controller.
    fastest_pole, max_gain, min_damping_ratio, min_decay_rate : float or None
        Bounds.
    edge : float or None
        How far from the edge of stability the search keeps for now: decay of a pole over its size.
    """

    structure: ControllerForm
    ports: Ports
    free: tuple[Free, ...]
    low: Array
    high: Array
    plants: Callable[[Array], tuple[ScaledPlant, ...]]
    count: int
    channels: tuple[Channel, ...]
    columns: tuple[Array, ...]
    rows: tuple[Array, ...]
    order: int
    fastest_pole: float | None
    max_gain: float | None
    min_damping_ratio: float | None
    min_decay_rate: float | None
    edge: float | None = None

    @cached_property
    def physical(self) -> Array:
        """Places of the physical parameters among the free numbers."""
        return np.array([i for i, item in enumerate(self.free) if item.kind == PHYSICAL], dtype=int)

    @cached_property
    def linear(self) -> bool:
        """Whether the controller's matrices depend on the free numbers in straight lines."""
        middle = np.where(np.isfinite(self.high), 0.5 * (np.maximum(self.low, -1e300) + self.high), 0.0)
        drawn = np.random.default_rng(0).normal(size=(2, len(middle)))
        one, other = (self.structure.system(middle + 0.1 * item, self.ports).matrix().slopes for item in drawn)
        return bool((one == other).all())

    @cached_property
    def _line(self) -> tuple[Array, Jet]:
        """Free numbers, zeros where these may be, and the controller there."""
        x = self.clipped(np.zeros(len(self.free)))
        return x, self.structure.system(x, self.ports).matrix()

    def controller(self, x: Array) -> Jet:
        """Return ``[[A, B], [C, D]]`` of the controller in the users' units, with derivatives."""
        if not self.linear:
            return self.structure.system(x, self.ports).matrix()
        start, there = self._line
        moved = (x - start) @ there.slopes.reshape(len(x), there.value.size)
        return Jet(there.value + moved.reshape(there.value.shape), there.slopes)

    def values(self, x: Array) -> dict[str, float]:
        """Return what the free numbers stand for, in the users' units."""
        return {item.name: item.value(number) for item, number in zip(self.free, x, strict=True)}

    def physical_values(self, x: Array) -> dict[str, float]:
        """Return the physical parameters alone."""
        return {self.free[i].name: self.free[i].value(x[i]) for i in self.physical}

    def clipped(self, x: Array) -> Array:
        """Return numbers within their ends."""
        return np.minimum(np.maximum(x, self.low), self.high)

    def lti(self, x: Array, measurements: tuple[str, ...], controls: tuple[str, ...]) -> Lti:
        """Return the controller as a system."""
        K, n = self.controller(x).value, self.order
        states = tuple(f"k[{i}]" for i in range(n))
        return Lti(K[:n, :n], K[:n, n:], K[n:, :n], K[n:, n:], measurements, controls, states)


def band_of(systems: Sequence[Lti]) -> tuple[Array, Array]:
    """Return the rates of the poles of systems, and frequencies around all of these at which the systems are looked at."""
    sizes = [rates[rates > _SLOWEST * rates.max(initial=0.0)] for rates in (np.abs(s.poles) for s in systems)]
    rates = np.concatenate([size for size in sizes if len(size)] or [np.ones(1)])
    return rates, np.geomspace(rates.min() / 3.0, rates.max() * 3.0, _POINTS)


def ports_of(plants: tuple[GeneralizedPlant, ...]) -> Ports:
    """Return the ports of a controller: the sizes of its signals are such that ``P22`` is near one in the plant's band."""
    rates, omega = band_of([plant.system for plant in plants])
    first = plants[0]
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
