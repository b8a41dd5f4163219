"""Polishing by sequential quadratic programmes over all peaks near the highest, nearly multiple singular values too."""

from collections.abc import Callable
from math import inf, isfinite

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import nnls

from boomctl.arrays import Array
from boomctl.lti.rounding import TINY
from boomctl.tuning.hessian import peak_hessian
from boomctl.tuning.point import BESIDE, Height, Piece, Point
from boomctl.tuning.problem import GAIN_LIMIT
from boomctl.tuning.responses import WINDOW, same_place
from boomctl.tuning.solver.descent import Ended

_MOST = 80  # pieces at most, the highest (a choice)
_BETWEEN = 0.03  # share below the highest within which grid frequencies are pieces too (measured: 0.1 costs more)
_TRIALS = 14  # of a step: each either gains a piece or shortens the step (a choice)
_CORRECTIONS = 2  # of a step for what the pieces bend, at most (measured: a sixth fewer loops than with one)
_FALL = 0.1  # share of the promised gain that makes a step worth taking (a choice)
_GOOD = 0.6  # share of the promised gain from which on the next step may be longer (a choice)
_ACTIVE = 1e-6  # multiplier from which on a piece is active (a choice)
_NEAR = 0.1  # share of its frequency by which a peak may move in a step and be the same (a choice)
_DAMPING, _LEAST, _LARGEST = (
    1.0,
    1e-9,
    1e9,
)  # weight of a step's length in natural sizes: first, least, largest (choices)
# times the curvature along a step to loops that are not stable, which the next step's weight is at least: a quarter is left
_SHORTER = 3.0  # of it (a choice; where a step merely gains too little, one plant ended 0.1 % higher so)
_FAR = 1e4  # natural sizes from which on an end is too far to matter (a choice)
# share of its multiplier by which a row gives way: of pieces that are nearly alike each then carries its share, and what they
# bend is seen of all (measured: with hard rows a half more steps)
_GIVE = 1e-7
_FLAT = 1e-10  # share of the largest natural size below which a number's own is taken to be that
_LITTLE = 1e-6  # step of differences of an H2 norm's gradient
_ROUNDS = 60  # of a quadratic program at most: two or three are the rule
# curvature lent to variables without any in a quadratic program: of larger ones more rounds, of smaller ones fewer digits
_CURVED = 1e-2
_ENOUGH = 1e-11  # slope that is left, relative to the costs, at which a quadratic program ends
_NO_ROW = 1e-12  # share of the longest row below which a row bounds nothing, and is not made longer (a choice)


class Polish:
    """A search for a point from which no small step over all peaks near the highest goes lower.

    Parameters
    ----------
    point_at : function
        From free numbers to the loops there.
    x : ndarray
        Where to begin.
    weight : float
        What a unit of an exceeded bound costs.
    gain : float
        Ends where a step promises less, or five together gain less.
    hard : float
        The rows of a program give way a little, unless no more than this gain is promised then.
    """

    def __init__(
        self, point_at: Callable[[Array], Point], x: Array, *, weight: float, gain: float, hard: float
    ) -> None:
        self._point_at, self._weight, self._gain, self._hard = point_at, weight, gain, hard
        self._point, self._damping = point_at(x), _DAMPING
        self._H = np.zeros((len(x), len(x)))

    def run(self, steps: int) -> Ended:
        """Return where so many steps, or fewer, end."""
        value = self._point.merit(self._weight)[0]
        if not isfinite(value):
            return Ended(self._point.x, value, 0)
        history = [value]
        for k in range(steps):
            asked: set[tuple[int, int, float]] = set()
            pieces = _chosen(self._point, asked)
            self._sizes = _sizes(pieces, self._H)
            self._H = _curvature(self._point, pieces, self._step(pieces, value, -inf)[2], self._sizes)
            self._sizes = _sizes(pieces, self._H)
            for trial in range(_TRIALS):
                d, promised, _ = self._step(pieces, value, self._hard)
                if promised <= self._gain:
                    return Ended(self._point.x, value, k, self._damping < 1e3 * _DAMPING)
                there, result = self._corrected(d, pieces, value, promised)
                if result <= value - _FALL * promised:
                    if trial == 0:
                        good = value - result >= _GOOD * promised
                        self._damping = max((0.1 if good else 0.4) * self._damping, _LEAST)
                    break
                more = _unseen(there, pieces) - asked if isfinite(result) else set()
                if more:
                    asked |= more
                    pieces = _chosen(self._point, asked)
                bends = 0.0 if isfinite(result) else _SHORTER * float(d @ self._H @ d) / float(d @ (self._sizes * d))
                self._damping = min(max((2.0 if more else 6.0) * self._damping, bends), _LARGEST)
            else:
                return Ended(self._point.x, value, k)
            self._point, value = there, result
            history.append(value)
            if len(history) > 6 and history[-7] - value < 10.0 * self._gain:
                return Ended(self._point.x, value, k + 1)
        return Ended(self._point.x, value, steps)

    def _tried(self, d: Array) -> tuple[Point, float]:
        """Return the loops after a step, and their merit."""
        there = self._point_at(self._point.problem.clipped(self._point.x + d))
        return there, there.merit(self._weight)[0]

    def _corrected(self, d: Array, pieces: list[Piece], value: float, promised: float) -> tuple[Point, float]:
        """Return the loops after a step, or lower ones: the program is solved anew for what the pieces have bent to there."""
        there, result = self._tried(d)
        for _ in range(_CORRECTIONS):
            if not isfinite(result) or result <= value - _GOOD * promised:
                break
            bent = _bent_pieces(pieces, there, there.x - self._point.x)
            further, lower = self._tried(self._step(bent, value, self._hard)[0])
            if lower >= result:
                break
            there, result = further, lower
        return there, result

    def _step(self, pieces: list[Piece], value: float, wanted: float) -> tuple[Array, float, Array]:
        """Return the step of a quadratic program, the gain that it promises, and the multipliers of the pieces.

        Rows give way a little, unless no more than the gain ``wanted`` is promised then.
        """
        x, problem, root = self._point.x, self._point.problem, np.sqrt(self._sizes)  # steps count in natural sizes
        values, slopes = np.array([p.value for p in pieces]), np.array([p.gradient for p in pieces]) / root
        limits, n, count = np.array([p.limit for p in pieces]), len(x), len(pieces)
        top, some = values[~limits].max(), int(limits.any())
        curved = self._H / root / root[:, None]
        # the step, the highest objective, and where there are limits by how much the worst is exceeded
        m = n + 1 + some
        Q, c, unit = np.zeros((m, m)), np.zeros(m), np.eye(m)
        Q[:n, :n] = curved + self._damping * np.eye(n)
        c[n], c[n + 1 :] = 1.0, self._weight
        rows = np.hstack([slopes, (limits - 1.0)[:, None], limits[:, None] * -np.ones(some)])
        up, down = np.maximum((problem.high - x) * root, 0.0), np.maximum((x - problem.low) * root, 0.0)
        above, below = up < _FAR, down < _FAR
        rows = np.vstack([rows, -unit[n + 1 :], unit[:n][above], -unit[:n][below]])
        sides = np.concatenate([np.where(limits, 0.0, top) - values, np.zeros(some), up[above], down[below]])
        for give in (_GIVE, 0.0):
            y, z = least(Q, c, rows, sides, give)
            there = values + slopes @ y[:n]
            over = max(float(there[limits].max(initial=0.0)), 0.0)
            promised = value - (float(there[~limits].max()) + self._weight * over) - 0.5 * float(y[:n] @ curved @ y[:n])
            if promised > wanted:
                break
        return y[:n] / root, promised, z[:count]


def _sizes(pieces: list[Piece], H: Array) -> Array:
    """Return squares of the inverse natural sizes of the free numbers: slopes and curvatures."""
    squares = np.max([p.gradient**2 for p in pieces], axis=0) + np.abs(np.diag(H))
    return np.maximum(squares, _FLAT * max(float(squares.max(initial=0.0)), TINY))


def _curvature(point: Point, pieces: list[Piece], multipliers: Array, sizes: Array) -> Array:
    """Return the curvature of the Lagrangian, what is negative turned round: so that steps lead away from saddles."""
    n = len(point.x)
    H, moved = np.zeros((n, n)), [point.beside(point.x + step) for step in _LITTLE * np.eye(n)]
    for multiplier, piece in zip(multipliers, pieces, strict=True):
        if multiplier <= _ACTIVE or piece.channel < GAIN_LIMIT or not piece.top:
            continue
        if np.isnan(piece.omega):  # of an H2 norm, by differences of its gradient
            there = [item.h2(piece.model, piece.channel)[1] if item.stable else piece.gradient for item in moved]
            H += multiplier * (np.array(there) - piece.gradient) / _LITTLE
        else:
            H += multiplier * peak_hessian(point, piece)
    if not np.isfinite(H).all():
        return np.zeros((n, n))
    root = np.sqrt(sizes)
    values, vectors = np.linalg.eigh(0.5 * (H + H.T) / root / root[:, None])
    return (root[:, None] * vectors * np.abs(values)) @ (vectors.T * root)


def _chosen(point: Point, asked: "set[tuple[int, int, float]]") -> list[Piece]:
    pieces = sorted(point.pieces(WINDOW, asked, between=_BETWEEN), key=lambda p: p.value, reverse=True)
    return [p for p in pieces if not p.limit][:_MOST] + [p for p in pieces if p.limit][:_MOST]


def _bent_pieces(pieces: list[Piece], trial: Point, d: Array) -> list[Piece]:
    """Return pieces with the values that, with their slopes, are right at a point tried: what they bend is then seen."""
    return [
        piece if near is None or not piece.top else piece._replace(value=near.value - float(piece.gradient @ d))
        for piece, near in zip(pieces, _nearest(pieces, trial.tops(WINDOW)), strict=True)
    ]


def _nearest(pieces: list[Piece], others: list[Height]) -> list[Height | None]:
    """Return what each piece has become among others; None where nothing near it is the same."""
    if not others or not pieces:
        return [None] * len(pieces)
    mine, theirs = np.array([item[:3] for item in pieces])[:, None], np.array([item[:3] for item in others])
    a, b = mine[..., 2], theirs[:, 2]
    with np.errstate(invalid="ignore"):  # infinity from infinity, and what is no number
        apart = np.abs(a - b) / np.maximum(np.maximum(np.abs(a), np.abs(b)), TINY)
    apart[(a == b) | np.isnan(a)] = 0.0
    apart[(mine[..., :2] != theirs[:, :2]).any(axis=2) | np.isnan(apart)] = inf
    return [others[k] if row[k] <= _NEAR else None for row, k in zip(apart, apart.argmin(axis=1), strict=True)]


def _unseen(trial: Point, pieces: list[Piece]) -> "set[tuple[int, int, float]]":
    """Return what stands out at a point tried and was no piece."""
    result = set()
    for model, channel, omega, *_ in (trial.top, *([trial.over] if trial.over else [])):
        there = [p.omega for p in pieces if (p.model, p.channel) == (model, channel)]
        at_peak = channel >= GAIN_LIMIT and not np.isnan(omega)
        if at_peak and not any(same_place(omega, item, BESIDE) for item in there):
            result.add((model, channel, omega))
    return result


def stationarity(pieces: list[Piece], point: Point, low: Array, high: Array) -> float:
    """Return the length of the least element of the hull of gradients over that of the longest one.

    Free numbers count in natural sizes, what points out of the ends is left away: zero where no small step goes lower, one
    where all pieces fall.  Of a piece alone, whose gradient is both the least and the longest, it is the length itself, and
    what it bends counts in the natural sizes: in a smooth minimum that is zero.
    """
    x = point.x
    if not pieces or not len(x):
        return 0.0
    H = np.zeros((len(x), len(x)))
    if len(pieces) == 1:
        H = _curvature(point, pieces, np.ones(1), _sizes(pieces, H))
    slopes = np.array([p.gradient for p in pieces]) / np.sqrt(_sizes(pieces, H))
    longest = 1.0 if H.any() else float(np.linalg.norm(slopes, axis=1).max())
    if longest == 0.0:
        return 0.0
    n = len(x)
    H = np.diag([*np.ones(n), 0.0])
    c = np.append(np.zeros(n), 1.0)
    aims = np.array([not p.limit for p in pieces])
    rows = np.column_stack([slopes / longest, np.where(aims, -1.0, 0.0)])
    unit = np.eye(n + 1)[:n]
    G = np.vstack([rows, unit[x >= high], -unit[x <= low]])
    y, _ = least(H, c, G, np.zeros(len(G)))
    return float(np.linalg.norm(y[:n]))


def least(H: Array, c: Array, G: Array, h: Array, give: float = 0.0) -> tuple[Array, Array]:
    """Return ``y`` that makes ``1/2 y^T H y + c^T y`` least under ``G y <= h``, and the multipliers of the rows of ``G``.

    In coordinates in which all directions curve alike it is the point of a polyhedron that is nearest to the one without
    rows: its multipliers solve a problem of least squares.  What does not curve is lent some curvature around where it was
    last, in turn until that costs nothing.

    ``H`` is positive definite but for variables that do not curve at all, which rows bound.  The problem must have a point at
    which all rows are met.  Rows, made of length one, may be exceeded by ``give`` times their multipliers.
    """
    n, m = len(c), len(h)
    size = np.sqrt((G * G).sum(axis=1))
    size = np.maximum(size, max(_NO_ROW * float(size.max(initial=0.0)), TINY))
    G, h, y, z = G / size[:, None], h / size, np.zeros(n), np.zeros(m)
    lent = np.where(H.diagonal() == 0.0, _CURVED, 0.0)
    root, wrong = lapack.dpotrf(H + np.diag(lent), lower=1)
    if wrong:
        return y, z
    rows, end = np.zeros((n + 1 + m, m)), np.zeros(n + 1 + m)
    rows[:n], end[n] = -lapack.dtrtrs(root, G.T, lower=1)[0], 1.0
    rows[n + 1 :] = give**0.5 * np.eye(m)
    for _ in range(_ROUNDS):
        free = lapack.dtrtrs(root, -(H @ y + c), lower=1)[0]  # the step without rows
        rows[n] = G @ y - h - free @ rows[:n]
        if not np.isfinite(rows).all():
            break
        try:
            result = nnls(rows, end)[0]
        except RuntimeError:  # it went on too long
            break
        z = result / (end[n] - rows[n] @ result)
        step = lapack.dtrtrs(root, free + rows[:n] @ z, lower=1, trans=1)[0]
        y = y + step
        if float(np.abs(lent * step).max(initial=0.0)) <= _ENOUGH * float(np.abs(c).max(initial=0.0)):
            break
    return y, z / size
