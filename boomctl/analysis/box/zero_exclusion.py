"""Proof that no eigenvalue of ``E(delta) x' = A(delta) x`` crosses the imaginary axis within a cell of parameters.

In the eigenvectors of the cell's center the pencil ``s E - A`` is diagonal but for what the parameters change.  What
they change on the diagonal moves each pole by itself, exactly accounted for: in a lightly damped structure mostly along
the axis, which a small-gain test would take for a loss of damping.  What they change off the diagonal couples the
modes.  At a frequency the pencil is regular over the whole cell if the matrix of the couplings, each row divided by the
least modulus of its diagonal entry, has a spectral radius below one (a diagonal scaling then makes it diagonally
dominant).  Moduli and couplings are bounded over intervals of frequency that cover the axis, infinity included: the
entries are multilinear in frequency and the products of parameters, so their values lie in the convex hull of those at
the corners, and couplings, convex in frequency, are largest at an interval's ends.  Products of more than three
parameters, which only matrices that are polynomials of them bring, are small and count by their magnitudes.  Any
positive vector ``x`` bounds the radius of a nonnegative matrix by the largest ``(H x)_k/x_k`` (Collatz & Wielandt).  An
interval that fails is cut; a cell is given up at once where a single frequency fails, for then no cut helps.  The
eigenvectors follow the parameters to first order, so that the couplings are of second order.
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
from boomctl.lti.rounding import EPS, TINY

# directions in which a diagonal may stay from zero: within 8 % of the best (cos 22.5)
_DIRECTIONS = np.exp(-0.25j * np.pi * np.arange(8))
_TURN = 0.5  # most that eigenvectors follow a parameter across its range: beyond, first order is no help (a choice)
# places around a resonance, in half-widths, at which intervals are cut first (a choice)
_WIDTHS = np.array([-27.0, -3.0, 3.0, 27.0])
TOP = 4.0  # where the last interval begins, relative to the fastest pole: from there on nothing resonates (a choice)
_DEPTH = 5  # how often intervals that fail are cut (a choice)
_PARTS = 4  # into how many
_SWEEPS = 20  # of the power iteration at most (a choice)
_BATCH = 2**17  # entries of the matrices handled at once: what stays in the cache
_ROUNDING = 32.0 * EPS  # of sums of products of a few terms each
BELOW = 1.0 - 1e-10  # below one by more than the rounding of a matrix times a vector
_LEAST = 1e-12  # smallest entry of the vector, relative: without it, entries could vanish
_CLOSE = 1e-4  # share of the narrowest half-width that no interval is narrower than, so that none is empty
_PRODUCTS = 3  # parameters in a product whose matrix keeps its phases; longer products are small (a choice)
_ASKED = 4  # of the hardest frequencies, whose spectral radius is computed (a choice)


@dataclass(frozen=True)
class _Modes:
    """The pencil over a cell, ``sum_t w_t (s E_t - A_t)`` and ``s - poles`` on the diagonal, ``low <= w <= high``.

    Of the first ``exact`` terms the diagonal is accounted for exactly; of the others, small ones, in magnitude.
    ``powers[t, i]`` tells how often the weight of a term has parameter ``i`` as a factor.  What is left besides has entries
    of at most ``rest[0]`` and ``rest[1]`` in E and A.
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
        """Return the same over the middle half of a parameter's range."""
        share = 0.5 ** self.powers[:, axis]
        return replace(self, low=share * self.low, high=share * self.high)

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
"""Two matrices in place of their product."""


def axis_to_halve(terms: Polynomial, cell: Cell, holds: bool, missed: Array) -> int | None:
    """Return None where no eigenvalue is imaginary anywhere in a cell; otherwise the parameter to be halved next.

    ``holds`` tells whether what is to be proved is true in its middle; ``missed`` is by how much entries of ``E`` and ``A``
    may be off.
    """
    modes = _modes(about(terms, cell.middle), cell.reach, missed) if holds else None
    if modes is None:
        return int(np.argmax(cell.reach))
    point = _unexcluded_frequency(modes)
    if point is None:
        return None

    def left(axis: int) -> tuple[bool, float]:
        """Return how much couples the modes there, the range of a parameter halved."""
        half = modes.halved(axis)
        coupling = _couplings(_squares(half), point[None]).reshape(modes.E.shape[1:])
        distance = _along(half, point[None])[:, 0].max(axis=0)
        if (distance <= 0.0).any():
            return True, -float(distance.min())
        return False, float(np.abs(np.linalg.eigvals(coupling / distance[:, None])).max())

    return min(range(len(cell.reach)), key=left)


def _modes(local: Polynomial, reach: Array, missed: Array) -> _Modes | None:
    E, A = local[()]
    try:
        state = np.linalg.solve(E, A)
        balanced, scale = balance(state)
        poles, V = linalg.eig(balanced)  # type: ignore[misc]
        V = V.astype(complex) * np.asarray(scale)[:, None]  # of real poles alone they come as real numbers
        W = np.linalg.inv(E @ V)
    except np.linalg.LinAlgError:  # a singular E
        return None

    def factors(X: Array) -> tuple[Array, Array]:
        rows = np.flatnonzero(X.any(axis=1))  # A parameter changes few rows: factors of low rank make products cheap.
        return W[:, rows], X[rows] @ V

    both = {power: (factors(pencil[0]), factors(pencil[1])) for power, pencil in local.items()}
    eye = np.eye(len(poles), dtype=complex)
    rounding = [F @ G - X for (F, G), X in zip(both.pop(()), (eye, np.diag(poles)), strict=True)]
    both[(-1,)] = (eye, rounding[0]), (eye, rounding[1])
    off = np.abs(W) @ missed @ np.abs(V)
    finite = all(np.isfinite(X).all() for pair in both.values() for item in pair for X in item)
    return _straightened(poles, both, reach, off) if finite else None


def _straightened(
    poles: Array, changes: Mapping[tuple[int, ...], tuple[Factors, Factors]], reach: Array, missed: Array
) -> _Modes:
    """Return the pencil in eigenvectors that follow the parameters to first order, so that couplings are of second.

    ``(1 + sum d_i Y_i)(s E - A)(1 + sum d_i X_i)`` is regular only if ``s E - A`` is; ``changes[(-1,)]`` is rounding, and
    entries of ``E`` and ``A`` may be off by ``missed``.  Products of more parameters than are kept count by bounds of their
    magnitudes: of three factors, the product of those of each.
    """
    k, n = len(reach), len(poles)
    kept = _PRODUCTS if k <= FEW_PARAMETERS else 2
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
            if len(power) > kept or not G.size:
                continue
            before, after = lefts @ F, G @ rights
            for left, right in product(range(-1, k), repeat=2):  # -1: the identity
                whole = tuple(sorted((*(i for i in (left, right) if i >= 0), *power)))
                if whole and len(whole) <= kept:
                    total = terms.setdefault(whole, np.zeros((2, n, n), complex))
                    total[j] += before[left + 1] @ after[right + 1]
    rest = _beyond(changes, (Y, X), reach, kept, missed)
    order = sorted(terms, key=lambda power: (-1 in power or len(power) > 2, len(power), power))
    bounds = np.array([_range(power, reach) for power in order])
    return _Modes(
        poles=poles,
        E=np.array([terms[power][0] for power in order]),
        A=np.array([terms[power][1] for power in order]),
        low=bounds[:, 0],
        high=bounds[:, 1],
        exact=sum(-1 not in power and len(power) <= 2 for power in order),
        powers=np.array([[power.count(i) for i in range(k)] for power in order]),
        rest=(rest[0], rest[1]),
    )


def _beyond(
    changes: Mapping[tuple[int, ...], tuple[Factors, Factors]],
    turns: tuple[Array, Array],
    reach: Array,
    kept: int,
    missed: Array,
) -> Array:
    """Return bounds of the entries, for E and for A, of products of more parameters than are kept and of what is missed."""
    Y, X = (np.einsum("i,ijk->jk", reach, np.abs(T)) for T in turns)
    before, after = np.eye(len(Y)) + Y, np.eye(len(X)) + X
    rest = before @ np.array([missed, missed]) @ after
    for length in {len(power) for power in changes}:
        size = sum(
            _range(power, reach)[1] * np.array([np.abs(F @ G) for F, G in pair])
            for power, pair in changes.items()
            if len(power) == length
        )
        if length > kept:
            rest += before @ size @ after
        elif length == kept:
            rest += Y @ size @ after + size @ X
        elif length == kept - 1:
            rest += Y @ size @ X
    return rest


def _range(power: tuple[int, ...], reach: Array) -> tuple[float, float]:
    """Return between which values a product of parameters (and of one, for rounding) lies."""
    size = float(np.prod([reach[i] for i in power if i >= 0]))
    return (0.0 if len(power) == 2 and power[0] == power[1] >= 0 else -size), size


def _unexcluded_frequency(modes: _Modes) -> Array | None:
    """Return a frequency that could not be excluded, None if the whole imaginary axis is; one of conjugates suffices.

    Frequencies are points ``(a, b)`` that stand for the pencil ``j a E - b A``, infinity for ``(1, 0)``.
    """
    squares, batch = _squares(modes), max(2 * _PARTS, _BATCH // len(modes.poles) ** 2)
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
        share = np.linspace(0.0, 1.0, _PARTS + 1)[:, None]
        cut = (1.0 - share) * rest[:, :1] + share * rest[:, 1:]
        step = max(1, batch // _PARTS)
        lines = [cut[i : i + step] for i in range(0, len(cut), step)]
    return rest[0, 0]


def _breaks(modes: _Modes) -> Array:
    """Return frequencies, from zero, between which no resonance changes much."""
    own_E, own_A = modes.own
    drift = np.einsum("i,ik->k", modes.size[: modes.exact], np.abs(1j * modes.poles.imag * own_E - own_A))
    width = np.abs(modes.poles.real)
    offsets = np.sign(_WIDTHS) * drift[:, None] + width[:, None] * _WIDTHS
    ends = (modes.poles.imag[:, None] + offsets).ravel()
    top = TOP * float(np.abs(modes.poles).max())
    ends = np.sort(ends[(ends > 0.0) & (ends < top)])
    gap = _CLOSE * float(width.min())
    kept = ends[np.concatenate([[True], np.diff(ends) > gap])] if len(ends) else ends
    return np.concatenate([[0.0], kept, [top]])


def _squares(modes: _Modes) -> Array:
    """Return, for each term, what ``a^2, b^2, a b`` are multiplied by in the squared moduli of ``w (j a E - b A)``.

    Rounding, which cancellation could make felt, is added; diagonals that are accounted for exactly are left out.
    """
    E, A = (modes.size[:, None, None] * X for X in (modes.E, modes.A))
    result = np.stack([np.abs(E) ** 2, np.abs(A) ** 2, -2.0 * (1j * E * A.conj()).real], axis=1)
    result[:, :2] *= 1.0 + _ROUNDING
    np.einsum("tqkk->tqk", result)[: modes.exact] = 0.0
    E, A = modes.rest
    if E.any() or A.any():
        result = np.concatenate([result, [(1.0 + _ROUNDING) * np.array([E**2, A**2, 2.0 * E * A])]])
    return result.reshape(len(result), 3, -1)


def _failed(modes: _Modes, squares: Array, points: Array) -> tuple[NDArray[np.bool_], Array | None]:
    """Return which intervals between neighbors of ``points[line, place]`` are not excluded, and a hopeless point."""
    lines, places, n = *points.shape[:2], len(modes.poles)
    flat = points.reshape(-1, 2)
    coupling = _couplings(squares, flat).reshape(lines, places, n, n)
    along = _along(modes, flat).reshape(-1, lines, places, n)
    distance = np.minimum(along[:, :, :-1], along[:, :, 1:]).max(axis=0)
    failed = (distance <= 0.0).any(axis=2)
    H = np.maximum(coupling[:, :-1], coupling[:, 1:])[~failed] / distance[~failed][:, :, None]
    failed[~failed] = ~_below_one(H)
    if not failed.any():
        return failed, None
    touched = np.zeros((lines, places), dtype=bool)
    touched[:, :-1] |= failed
    touched[:, 1:] |= failed
    at = _fail(coupling[touched], along.max(axis=0)[touched])
    return failed, None if at is None else points[touched][at]


def _couplings(squares: Array, points: Array) -> Array:
    """Return upper bounds of the magnitudes of the couplings at each point, shape (points, n squared)."""
    weights = np.column_stack([points**2, points[:, 0] * points[:, 1]])
    total, term = np.zeros((len(points), squares.shape[2])), np.empty((len(points), squares.shape[2]))
    for square in squares:
        np.matmul(weights, square, out=term)
        np.maximum(term, 0.0, out=term)
        total += np.sqrt(term, out=term)
    return total


def _along(modes: _Modes, points: Array) -> Array:
    """Return how far the diagonal stays from zero along each direction, at each point and over the whole cell."""
    own_E, own_A = modes.own
    low, high = (bound[: modes.exact, None, None] for bound in (modes.low, modes.high))
    base = 1j * points[:, :1] - points[:, 1:] * modes.poles
    rounding = _ROUNDING * (points[:, :1] + points[:, 1:] * np.abs(modes.poles))
    result = np.empty((len(_DIRECTIONS), *base.shape))
    for i, direction in enumerate(_DIRECTIONS):
        seen = points @ np.stack([(1j * direction * own_E).real, -(direction * own_A).real], axis=1)
        result[i] = (base * direction).real - rounding + np.minimum(low * seen, high * seen).sum(axis=0)
    return result


def _fail(coupling: Array, distance: Array) -> int | None:
    """Return a place among a few frequencies whose couplings do not allow of a proof; None if none was found."""
    if (distance <= 0.0).any():
        return int(np.argmin(distance.min(axis=1)))
    H = coupling / distance[:, :, None]
    open_ = np.flatnonzero(~_below_one(H))
    if not len(open_):
        return None
    worst = open_[np.argsort(-np.linalg.norm(H[open_], axis=(1, 2)))[:_ASKED]]
    radius = np.abs(np.linalg.eigvals(H[worst])).max(axis=1)
    return int(worst[np.argmax(radius)]) if radius.max() >= 1.0 else None


def _below_one(H: Array) -> NDArray[np.bool_]:
    """Return which of the nonnegative matrices ``H[f]`` have been shown to have a spectral radius below one."""
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
    """Return positive vectors whose ratios to their products with nonnegative matrices, ``y = H x``, are more alike."""
    x = np.sqrt(x * np.maximum(y, TINY))
    return np.maximum(x / x.max(axis=1, keepdims=True), _LEAST)
