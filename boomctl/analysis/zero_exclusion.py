"""Proof that no eigenvalue of ``E(delta) x' = A(delta) x`` crosses the imaginary axis within a cell of parameters.

In the eigenvectors of the cell's centre the pencil ``s E - A`` is diagonal but for what the parameters change.  What
they change on the diagonal moves each pole by itself, exactly accounted for: in a lightly damped structure mostly along
the axis, which a small-gain test would take for a loss of damping.  What they change off the diagonal couples the
modes.  At a frequency the pencil is regular over the whole cell if the matrix of the couplings, each row divided by the
least modulus of its diagonal entry, has a spectral radius below one (a diagonal scaling then makes it diagonally
dominant).  Moduli and couplings are bounded over intervals of frequency that cover the axis, infinity included; the
entries are multilinear in frequency and the products of parameters, so their values lie in the convex hull of those at
the corners.  The eigenvectors follow the parameters to first order, so that the couplings are of second order.
"""

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from scipy import linalg

from boomctl.analysis.closed_pencil import Pencil
from boomctl.arrays import Array, Complex

__all__ = ["Cell", "CellProof", "prove_cell"]

_DIRECTIONS = np.exp(-0.25j * np.pi * np.arange(8))
_TURN = 0.5
_WIDTHS = np.array([-27.0, -3.0, 3.0, 27.0])
_HOPELESS = 3.0
_DEPTH = 5
_SWEEPS = 15
_BATCH = 256


@dataclass(frozen=True)
class Cell:
    """A box of parameters: its middle and half its widths."""

    middle: Array
    reach: Array

    def halves(self, axis: int) -> tuple["Cell", "Cell"]:
        """Return the two halves across an axis."""
        step = np.zeros(len(self.middle))
        step[axis] = 0.5 * self.reach[axis]
        reach = np.where(np.arange(len(step)) == axis, 0.5 * self.reach, self.reach)
        return Cell(self.middle - step, reach), Cell(self.middle + step, reach)


@dataclass(frozen=True)
class CellProof:
    """What is known of a cell.

    Attributes
    ----------
    abscissa : float
        Largest real part of the poles at its middle.
    proved : bool
        Whether no pole touches the imaginary axis anywhere in the cell.
    axis : int
        The parameter that couples modes most, to be halved next.
    """

    abscissa: float
    proved: bool
    axis: int


@dataclass(frozen=True)
class _Modes:
    """The pencil over a cell, ``sum_t w_t (s E_t - A_t)`` and ``s - poles`` on the diagonal, ``low <= w <= high``.

    Of the first ``exact`` terms the diagonal is accounted for exactly; of the others, small ones, in magnitude.
    """

    poles: Complex
    E: Complex
    A: Complex
    low: Array
    high: Array
    exact: int

    @property
    def size(self) -> Array:
        """Largest magnitude of each weight."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    @property
    def own(self) -> tuple[Complex, Complex]:
        """Diagonals of the terms that are accounted for exactly."""
        E, A = (np.diagonal(X[: self.exact], axis1=1, axis2=2) for X in (self.E, self.A))
        return E, A


def prove_cell(centre: Pencil, slopes: tuple[Pencil, ...], cell: Cell) -> CellProof:
    """Try to prove that the poles stay on their side of the imaginary axis throughout a cell."""
    E = centre.E + sum(d * s.E for d, s in zip(cell.middle, slopes, strict=True))
    A = centre.A + sum(d * s.A for d, s in zip(cell.middle, slopes, strict=True))
    here = Pencil(np.asarray(E), np.asarray(A))
    abscissa = here.abscissa
    modes = None if abscissa >= 0.0 else _modes(here, slopes, cell)
    if modes is None:
        return CellProof(abscissa, False, int(np.argmax(cell.reach)))
    k = len(cell.reach)
    change = np.abs(1j * modes.poles.imag[:, None] * modes.E[:k] - modes.A[:k]).sum(axis=2)
    axis = int(np.argmax(cell.reach * (change / np.abs(modes.poles.real)).max(axis=1)))
    return CellProof(abscissa, _excluded(modes), axis)


def _modes(here: Pencil, slopes: tuple[Pencil, ...], cell: Cell) -> _Modes | None:
    state = np.linalg.solve(here.E, here.A)
    balanced, (scale, _) = linalg.matrix_balance(state, permute=False, separate=True)
    poles, V = linalg.eig(balanced)  # type: ignore[misc]
    V = V * np.asarray(scale)[:, None]
    try:
        W = np.linalg.inv(here.E @ V)
    except np.linalg.LinAlgError:
        return None
    E, A = (
        np.array([W @ here_X @ V, *(W @ X @ V for X in changes)])
        for here_X, changes in ((here.E, [s.E for s in slopes]), (here.A, [s.A for s in slopes]))
    )
    E[0] -= np.eye(len(poles))
    A[0] -= np.diag(poles)
    return _straightened(poles, E, A, cell.reach) if np.isfinite(E).all() and np.isfinite(A).all() else None


def _straightened(poles: Complex, E: Complex, A: Complex, reach: Array) -> _Modes:
    """Return the pencil in eigenvectors that follow the parameters to first order, so that couplings are of second.

    ``(1 + sum d_i Y_i)(s E - A)(1 + sum d_i X_i)`` is regular only if ``s E - A`` is; ``E[0], A[0]`` are rounding.
    """
    k, n = len(reach), len(poles)
    gaps = poles[:, None] - poles[None, :]
    gaps[gaps == 0.0] = np.inf
    X = (E[1:] * poles - A[1:]) / gaps
    X *= 1.0 - np.eye(n)
    X[np.abs(X) * reach[:, None, None] > _TURN] = 0.0
    Y = -E[1:] - X
    eye, diagonal = np.eye(n, dtype=complex), np.diag(poles)
    terms: dict[tuple[int, ...], list[Complex]] = {}
    for (left, L), (middle, e, a), (right, R) in product(
        [((), eye), *(((i,), Y[i]) for i in range(k))],
        [((), eye, diagonal), *(((i,), E[1 + i], A[1 + i]) for i in range(k)), ((-1,), E[0], A[0])],
        [((), eye), *(((i,), X[i]) for i in range(k))],
    ):
        power = tuple(sorted((*left, *middle, *right)))
        if power:
            sums = terms.setdefault(power, [np.zeros((n, n), complex), np.zeros((n, n), complex)])
            sums[0] += L @ e @ R
            sums[1] += L @ a @ R
    order = sorted(terms, key=lambda power: (-1 in power or len(power) > 2, len(power), power))
    bounds = np.array([_range(power, reach) for power in order])
    return _Modes(
        poles,
        np.array([terms[power][0] for power in order]),
        np.array([terms[power][1] for power in order]),
        bounds[:, 0],
        bounds[:, 1],
        sum(-1 not in power and len(power) <= 2 for power in order),
    )


def _range(power: tuple[int, ...], reach: Array) -> tuple[float, float]:
    """Return between which values a product of parameters (and of one, for rounding) lies."""
    size = float(np.prod([reach[i] for i in power if i >= 0]))
    return (0.0 if len(power) == 2 and power[0] == power[1] >= 0 else -size), size


def _excluded(modes: _Modes) -> bool:
    """Return whether the whole imaginary axis is excluded; of conjugate frequencies one suffices."""
    ends = _breaks(modes)
    intervals = np.array([[a, b, 1.0, 1.0] for a, b in pairwise(ends)])
    intervals = np.vstack([intervals, [1.0, 1.0, 0.0, 1.0 / ends[-1]]])
    for depth in range(_DEPTH + 1):
        radius = np.concatenate([_radius(modes, intervals[i : i + _BATCH]) for i in range(0, len(intervals), _BATCH)])
        failed = ~(radius < 1.0)
        if not failed.any():
            return True
        if depth == _DEPTH or (depth > 1 and not (radius < _HOPELESS * 10.0 ** (_DEPTH - depth)).all()):
            return False
        intervals = _quartered(intervals[failed])
    return False


def _breaks(modes: _Modes) -> Array:
    """Return frequencies, from zero, between which no resonance changes much."""
    own_E, own_A = modes.own
    drift = np.einsum("i,ik->k", modes.size[: modes.exact], np.abs(1j * modes.poles.imag * own_E - own_A))
    width = np.abs(modes.poles.real)
    offsets = np.sign(_WIDTHS) * drift[:, None] + width[:, None] * _WIDTHS
    ends = (modes.poles.imag[:, None] + offsets).ravel()
    top = 4.0 * float(np.abs(modes.poles).max())
    ends = np.sort(ends[(ends > 0.0) & (ends < top)])
    gap = 1e-4 * float(width.min())
    kept = ends[np.concatenate([[True], np.diff(ends) > gap])] if len(ends) else ends
    return np.concatenate([[0.0], kept, [top]])


def _quartered(intervals: Array) -> Array:
    parts = []
    for a, b in ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)):
        lows, highs = intervals[:, [0, 2]], intervals[:, [1, 3]]
        begin, end = lows + a * (highs - lows), lows + b * (highs - lows)
        parts.append(np.column_stack([begin[:, 0], end[:, 0], begin[:, 1], end[:, 1]]))
    return np.vstack(parts)


def _radius(modes: _Modes, intervals: Array) -> Array:
    """Return, for each interval of ``j a E - b A``, an upper bound of the spectral radius of scaled couplings."""
    coupling = np.zeros((len(intervals), len(modes.poles), len(modes.poles)))
    for t, (weight, E, A) in enumerate(zip(modes.size, modes.E, modes.A, strict=True)):
        ends = [
            np.abs(1j * intervals[:, p, None, None] * E - intervals[:, q, None, None] * A) for p, q in ((0, 2), (1, 3))
        ]
        largest = np.maximum(*ends)
        if t < modes.exact:
            np.einsum("fkk->fk", largest)[:] = 0.0
        coupling += weight * largest
    distance = _distance(modes, intervals)
    clear = (distance > 0.0).all(axis=1)
    H = coupling / np.where(distance > 0.0, distance, 1.0)[:, :, None]
    x = np.ones(H.shape[:2])
    for _ in range(_SWEEPS):
        x = np.einsum("fkj,fj->fk", H, x) + 1e-2 * x
        x = np.maximum(x / x.max(axis=1, keepdims=True), 1e-12)
    radius = (np.einsum("fkj,fj->fk", H, x) / x).max(axis=1)
    return np.where(clear, radius, np.inf)


def _distance(modes: _Modes, intervals: Array) -> Array:
    """Return lower bounds of the moduli of the diagonal over each interval and the whole cell."""
    own_E, own_A = modes.own
    least = np.full((len(_DIRECTIONS), len(intervals), len(modes.poles)), np.inf)
    for p, q in ((0, 2), (1, 3)):
        base = 1j * intervals[:, [p]] - intervals[:, [q]] * modes.poles
        change = 1j * intervals[None, :, p, None] * own_E[:, None] - intervals[None, :, q, None] * own_A[:, None]
        for i, direction in enumerate(_DIRECTIONS):
            seen = direction.real * change.real - direction.imag * change.imag
            shift = np.minimum(
                modes.low[: modes.exact, None, None] * seen, modes.high[: modes.exact, None, None] * seen
            )
            least[i] = np.minimum(least[i], (base * direction).real + shift.sum(axis=0))
    return np.maximum(least.max(axis=0), 0.0)
