"""Proof that no eigenvalue of ``E(delta) x' = A(delta) x`` crosses the imaginary axis within a cell of parameters.

In the eigenvectors at the cell's midpoint the pencil ``s E - A`` is diagonal except for the changes by the parameters.
Changes of the diagonal shift each pole separately and are accounted for exactly: in a lightly damped structure the shift is
mostly along the axis, which a small-gain test would treat as a loss of damping.  Changes off the diagonal couple the modes.
At a frequency the pencil is regular over the entire cell if the matrix of the couplings, each row divided by the least
modulus of its diagonal entry, has a spectral radius below one (a diagonal scaling then makes the pencil diagonally dominant).
Moduli and couplings are bounded over intervals of frequency that cover the axis, infinity included: the entries are
multilinear in frequency and the products of parameters, so their values are in the convex hull of the values at the
vertices, and couplings, convex in frequency, are largest at an end of an interval.  Products of more than three parameters,
which occur only in matrices that are polynomials of them, are small and count by their magnitudes.  Any positive vector ``x``
bounds the radius of a nonnegative matrix by the largest ``(H x)_k/x_k`` (Collatz & Wielandt).  An interval that fails is cut;
if a single frequency fails, the cell fails at once, because no cut helps.  The eigenvectors follow the parameters to first
order, so that the couplings are of second order.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from boomctl.analysis.box.polynomials import Cell, Polynomial, about
from boomctl.arrays import Array, balance
from boomctl.chebyshev import FEW_PARAMETERS
from boomctl.lti.rounding import EPS, SUMMED, TINY

# Directions for lower bounds of a modulus: the best is within 8 % of the modulus (cos 22.5 deg).
_DIRECTIONS = np.exp(-0.25j * np.pi * np.arange(8))
_TURN = 0.5  # Largest first-order change of eigenvectors across a parameter's range; larger entries are not followed.
# Ends of the first intervals around a resonance, in half-widths.
_WIDTHS = np.array([-27.0, -3.0, 3.0, 27.0])
BATCH = 2**17  # Entries of the matrices in one batch, which fit into the cache: 4 % faster than half as many.
TOP = 4.0  # Start of the last interval, relative to the fastest pole: no resonances above it.
_DEPTH = 5  # Largest number of subdivisions of an interval that fails.
_PARTS = 4  # Parts of a subdivided interval.
_SWEEPS = 20  # Largest number of power iterations.
_ROUNDING = 32.0 * EPS  # Rounding error of sums of products of a few terms.
BELOW = 1.0 - 1e-9  # Below one by more than the rounding error of a matrix-vector product, or of a gain.
_PRODUCTS = 3  # Largest order of a product whose matrix is stored with phases; longer products are small.


@dataclass(frozen=True)
class _Modes:
    """Pencil over a cell, ``sum_t w_t (s E_t - A_t)`` and ``s - poles`` on the diagonal, ``low <= w <= high``.

    The diagonals of the first ``exact`` terms are accounted for exactly; those of the other, small terms in magnitude.
    ``powers[t, i]`` is the power of parameter ``i`` in the weight of term ``t``.  The entries of the remainder are at most
    ``rest[0]`` in E and ``rest[1]`` in A.
    """

    poles: Array
    E: Array
    A: Array
    low: Array
    high: Array
    exact: int
    powers: NDArray[np.int_]
    rest: tuple[Array, Array]

    def halved(self, axis: int) -> "_Modes":
        """Return the pencil over the central half of a parameter's range."""
        factor = 0.5 ** self.powers[:, axis]
        return replace(self, low=factor * self.low, high=factor * self.high)

    @property
    def size(self) -> Array:
        """Largest magnitude of each weight."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    @property
    def own(self) -> tuple[Array, Array]:
        """Diagonals of the terms that are accounted for exactly."""
        E, A = (np.diagonal(X[: self.exact], axis1=1, axis2=2) for X in (self.E, self.A))
        return E, A


Factors = tuple[Array, Array]
"""Two factors of a matrix."""


def axis_to_halve(terms: Polynomial, cell: Cell, holds: bool, error: Array) -> int | None:
    """Return None if no eigenvalue is imaginary anywhere in a cell; otherwise the parameter to be halved next.

    ``holds`` is True if the statement holds at the midpoint; ``error`` bounds the errors of the entries of ``E`` and ``A``.
    """
    modes = _modes(about(terms, cell.middle), cell.reach, error) if holds else None
    if modes is None:
        return int(np.argmax(cell.reach))
    point = _unexcluded_frequency(modes)
    if point is None:
        return None

    def left(axis: int) -> tuple[bool, float]:
        """Return a measure of the coupling of the modes at the point, with the range of a parameter halved."""
        half = modes.halved(axis)
        coupling = _couplings(_squares(half), point[None]).reshape(modes.E.shape[1:])
        distance = _along(half, point[None])[:, 0].max(axis=0)
        if (distance <= 0.0).any():
            return True, -float(distance.min())
        return False, float(np.abs(np.linalg.eigvals(coupling / distance[:, None])).max())

    return min(range(len(cell.reach)), key=left)


def _modes(local: Polynomial, reach: Array, error: Array) -> _Modes | None:
    E, A = local[()]
    try:
        state = np.linalg.solve(E, A)
        balanced, scale = balance(state)
        poles, V = linalg.eig(balanced)  # type: ignore[misc]
        V = V.astype(complex) * np.asarray(scale)[:, None]  # real if all poles are real
        W = np.linalg.inv(E @ V)
    except np.linalg.LinAlgError:  # a singular E
        return None

    def factors(X: Array) -> tuple[Array, Array]:
        rows = np.flatnonzero(X.any(axis=1))  # A parameter changes few rows: products of low-rank factors are fast.
        return W[:, rows], X[rows] @ V

    both = {power: (factors(pencil[0]), factors(pencil[1])) for power, pencil in local.items()}
    own = zip(both.pop(()), (np.eye(len(poles)), np.diag(poles)), strict=True)
    off = np.abs(W) @ error @ np.abs(V) + np.array([np.abs(F @ G - X) for (F, G), X in own])  # rounding included
    return _straightened(poles, both, reach, off) if np.isfinite(off).all() else None


def _straightened(
    poles: Array, changes: Mapping[tuple[int, ...], tuple[Factors, Factors]], reach: Array, error: Array
) -> _Modes:
    """Return the pencil in eigenvectors that follow the parameters to first order, so that couplings are of second order.

    ``(1 + sum d_i Y_i)(s E - A)(1 + sum d_i X_i)`` is regular only if ``s E - A`` is; ``error`` bounds the errors of the
    entries of ``E`` and of ``A``.  Products of more than ``order`` parameters count by bounds of their magnitudes: of three
    factors, by the product of the magnitudes.
    """
    k, n = len(reach), len(poles)
    order = _PRODUCTS if k <= FEW_PARAMETERS else 2
    gaps = poles[:, None] - poles[None, :]
    gaps[gaps == 0.0] = np.inf
    none, eye = (np.zeros((n, 0)), np.zeros((0, n))), np.eye(n, dtype=complex)
    E, A = (
        np.array([F @ G for i in range(k) for F, G in [changes.get((i,), (none, none))[j]]]).reshape(k, n, n)
        for j in (0, 1)
    )
    X = (E * poles - A) / gaps
    X *= 1.0 - np.eye(n)
    X[np.abs(X) * reach[:, None, None] > _TURN] = 0.0
    Y = -E - X
    lefts, rights = (np.concatenate([eye[None], Z]) for Z in (Y, X))
    terms: dict[tuple[int, ...], Array] = {}
    for power, pair in [((), ((eye, eye), (eye, np.diag(poles)))), *changes.items()]:
        for j, (F, G) in enumerate(pair):
            if len(power) > order or not G.size:
                continue
            before, after = lefts @ F, G @ rights
            for left, right in product(range(-1, k), repeat=2):  # -1: the identity
                whole = tuple(sorted((*(i for i in (left, right) if i >= 0), *power)))
                if whole and len(whole) <= order:
                    total = terms.setdefault(whole, np.zeros((2, n, n), complex))
                    total[j] += before[left + 1] @ after[right + 1]
    rest = _beyond(changes, (Y, X), reach, order, error)
    keys = sorted(terms, key=lambda power: (len(power), power))
    bounds = np.array([_range(power, reach) for power in keys])
    return _Modes(
        poles=poles,
        E=np.array([terms[power][0] for power in keys]),
        A=np.array([terms[power][1] for power in keys]),
        low=bounds[:, 0],
        high=bounds[:, 1],
        exact=sum(len(power) <= 2 for power in keys),
        powers=np.array([[power.count(i) for i in range(k)] for power in keys]),
        rest=(rest[0], rest[1]),
    )


def _beyond(
    changes: Mapping[tuple[int, ...], tuple[Factors, Factors]],
    turns: tuple[Array, Array],
    reach: Array,
    order: int,
    error: Array,
) -> Array:
    """Return bounds of the entries, for E and for A, of products of more than ``order`` parameters and of the errors."""
    Y, X = (np.einsum("i,ijk->jk", reach, np.abs(T)) for T in turns)
    before, after = np.eye(len(Y)) + Y, np.eye(len(X)) + X
    rest = before @ error @ after
    for length in {len(power) for power in changes}:
        size = sum(
            _range(power, reach)[1] * np.array([np.abs(F @ G) for F, G in pair])
            for power, pair in changes.items()
            if len(power) == length
        )
        for more, term in enumerate((size, Y @ size + size @ X, Y @ size @ X)):
            rest += term * (length + more > order)
    return rest


def _range(power: tuple[int, ...], reach: Array) -> tuple[float, float]:
    """Return the range of a product of parameters."""
    size = float(np.prod(reach[list(power)]))
    return (0.0 if len(power) == 2 and power[0] == power[1] else -size), size


def _unexcluded_frequency(modes: _Modes) -> Array | None:
    """Return a frequency that could not be excluded, or None if the positive imaginary axis is excluded.

    A frequency is a point ``(a, b)`` with the pencil ``j a E - b A``; infinity is ``(1, 0)``.
    """
    squares, batch = _squares(modes), max(2 * _PARTS, BATCH // len(modes.poles) ** 2)
    ends = _breaks(modes)
    chain, tail = np.column_stack([ends, np.ones(len(ends))]), np.array([[1.0, 1.0 / ends[-1]], [1.0, 0.0]])
    lines = [chain[None, i : i + batch + 1] for i in range(0, len(chain) - 1, batch)] + [tail[None]]
    rest = np.zeros((0, 2, 2))
    for _ in range(_DEPTH + 1):
        open_ = []
        for line in lines:
            failed, point = _failed(modes, squares, line)
            if point is not None:
                return point
            open_.append(np.stack([line[:, :-1][failed], line[:, 1:][failed]], axis=1))
        rest = np.concatenate(open_)
        if not len(rest):
            return None
        fraction = np.linspace(0.0, 1.0, _PARTS + 1)[:, None]
        cut = (1.0 - fraction) * rest[:, :1] + fraction * rest[:, 1:]
        step = max(1, batch // _PARTS)
        lines = [cut[i : i + step] for i in range(0, len(cut), step)]
    return rest[0, 0]


def _breaks(modes: _Modes) -> Array:
    """Return the ends of frequency intervals, from zero, over which no resonance changes much."""
    ends = (modes.poles.imag[:, None] + np.abs(modes.poles.real)[:, None] * _WIDTHS).ravel()
    top = TOP * float(np.abs(modes.poles).max())
    ends = np.sort(ends[(ends > 0.0) & (ends < top)])
    return np.concatenate([[0.0], ends, [top]])


def _squares(modes: _Modes) -> Array:
    """Return, for each term, the coefficients of ``a^2, b^2, a b`` in the squared moduli of ``w (j a E - b A)``.

    Rounding error, which cancellation could amplify, is added; diagonals that are accounted for exactly are omitted.
    """
    E, A = (modes.size[:, None, None] * X for X in (modes.E, modes.A))
    result = np.stack([np.abs(E) ** 2, np.abs(A) ** 2, -2.0 * (1j * E * A.conj()).real], axis=1)
    result[:, :2] *= 1.0 + _ROUNDING
    np.einsum("tqkk->tqk", result)[: modes.exact] = 0.0
    E, A = modes.rest
    result = np.concatenate([result, [(1.0 + _ROUNDING) * np.array([E**2, A**2, 2.0 * E * A])]])
    return result.reshape(len(result), 3, -1)


def _failed(modes: _Modes, squares: Array, points: Array) -> tuple[NDArray[np.bool_], Array | None]:
    """Return a mask of the intervals of ``points[line, column]`` that are not excluded, and a hopeless point, or None."""
    lines, columns, n = *points.shape[:2], len(modes.poles)
    flat = points.reshape(-1, 2)
    coupling = _couplings(squares, flat).reshape(lines, columns, n, n)
    along = _along(modes, flat).reshape(-1, lines, columns, n)
    distance = np.minimum(along[:, :, :-1], along[:, :, 1:]).max(axis=0)
    failed = (distance <= 0.0).any(axis=2)
    H = np.maximum(coupling[:, :-1], coupling[:, 1:])[~failed] / distance[~failed][:, :, None]
    failed[~failed] = ~_below_one(H)
    if not failed.any():
        return failed, None
    touched = np.zeros((lines, columns), dtype=bool)
    touched[:, :-1] |= failed
    touched[:, 1:] |= failed
    at = _fail(coupling[touched], along.max(axis=0)[touched])
    return failed, None if at is None else points[touched][at]


def _couplings(squares: Array, points: Array) -> Array:
    """Return upper bounds of the magnitudes of the couplings at each point, shape (points, n squared)."""
    weights = np.column_stack([points**2, points[:, 0] * points[:, 1]])
    return sum((np.sqrt(np.maximum(weights @ square, 0.0)) for square in squares), np.zeros(()))


def _along(modes: _Modes, points: Array) -> Array:
    """Return the distance of the diagonal from zero along each direction, at each point and over the entire cell."""
    own_E, own_A = modes.own
    low, high = (bound[: modes.exact, None, None] for bound in (modes.low, modes.high))
    base = 1j * points[:, :1] - points[:, 1:] * modes.poles
    rounding = _ROUNDING * (points[:, :1] + points[:, 1:] * np.abs(modes.poles))
    result = np.empty((len(_DIRECTIONS), *base.shape))
    for i, direction in enumerate(_DIRECTIONS):
        change = points @ np.stack([(1j * direction * own_E).real, -(direction * own_A).real], axis=1)
        result[i] = (base * direction).real - rounding + np.minimum(low * change, high * change).sum(axis=0)
    return result


def _fail(coupling: Array, distance: Array) -> int | None:
    """Return the index of the frequency of the strongest couplings if they exclude a proof; otherwise None."""
    if (distance <= 0.0).any():
        return int(np.argmin(distance.min(axis=1)))
    H = coupling / distance[:, :, None]
    at = int(np.argmax(np.linalg.norm(H, axis=(1, 2))))
    return at if np.abs(np.linalg.eigvals(H[at])).max() >= 1.0 else None


def _below_one(H: Array) -> NDArray[np.bool_]:
    """Return a mask of the nonnegative matrices ``H[f]`` that are shown to have a spectral radius below one."""
    shown, rest = np.zeros(len(H), dtype=bool), np.arange(len(H))
    x = np.ones((*H.shape[:2], 1))
    for _ in range(_SWEEPS):
        if not len(rest):
            break
        y = H @ x
        good = (y < BELOW * x).all(axis=(1, 2))
        x = evened(x, y)
        shown[rest[good]] = True
        if good.any():
            rest, H, x = rest[~good], H[~good], x[~good]
    return shown


def evened(x: Array, y: Array) -> Array:
    """Return positive vectors whose ratios to their products with nonnegative matrices, ``y = H x``, vary less."""
    x = np.sqrt(x * np.maximum(y, TINY))
    return np.maximum(x / x.max(axis=1, keepdims=True), SUMMED)
