"""Polishing by sequential quadratic programmes over all peaks near the highest, nearly multiple singular values too."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np

from boomctl.arrays import Array
from boomctl.synthesis.tuning.pieces import Piece, Point
from boomctl.synthesis.tuning.solver.quadratic import least

_WINDOW = 0.1  # share below the highest within which peaks are looked at (a choice)
_MOST = 80  # pieces at most, the highest (a choice)
_TRIALS = 12  # of a step: each either gains a piece or halves the room (a choice)
_FALL = 0.05  # share of the promised gain that makes a step worth taking (a choice)
_GOOD = 0.5  # share of the promised gain from which on the next step may be longer (a choice)
_ACTIVE = 1e-7  # multiplier from which on a piece is active (a choice)
_NEAR = 0.1  # share of its frequency by which a peak may move in a step and be the same (a choice)
_FIRST, _LEAST, _LARGEST = 0.3, 1e-10, 10.0  # room for a step: first, least and largest (choices)


@dataclass(frozen=True)
class Polished:
    """Where polishing ended.

    Attributes
    ----------
    x : ndarray
    value : float
    steps : int
    stationary : bool
        Whether it ended because no step promises any gain.
    """

    x: Array
    value: float
    steps: int
    stationary: bool


def polish(
    point_at: Callable[[Array], Point], x: Array, low: Array, high: Array, *, weight: float, steps: int, gain: float
) -> Polished:
    """Return a point from which no small step over all peaks near the highest goes lower.

    Parameters
    ----------
    point_at : function
        From free numbers to the loops there.
    x, low, high : ndarray
        Where to begin, and the ends of the numbers.
    weight : float
        What a unit of an exceeded bound costs.
    steps : int
        So many at most.
    gain : float
        Ends where a step promises less, or five together gain less.
    """
    point, n = point_at(x), len(x)
    value = point.merit(weight)[0]
    if not isfinite(value):
        return Polished(x, value, 0, False)
    B, room, asked = np.eye(n), _FIRST, set()
    history = [value]
    for k in range(steps):
        moved = None
        pieces = _chosen(point, asked)
        for _ in range(_TRIALS):
            d, promised, multipliers = _step(pieces, B, x, low, high, room, weight, value)
            if promised <= gain:
                return Polished(x, value, k, True)
            new = np.minimum(np.maximum(x + d, low), high)
            trial = point_at(new)
            found = trial.merit(weight)[0]
            if found <= value - _FALL * promised:
                moved = new, trial, found, promised, multipliers, float(np.abs(d).max())
                break
            more = _unseen(trial, pieces, asked) if isfinite(found) else set()
            room = (0.5 if more else 0.25) * min(room, float(np.abs(d).max()))
            if more:
                asked |= more
                pieces = _chosen(point, asked)
            if room < _LEAST:
                break
        if moved is None:
            return Polished(x, value, k, False)
        new, trial, found, promised, multipliers, length = moved
        active = [(m, p) for m, p in zip(multipliers, pieces, strict=True) if m > _ACTIVE and p.top]
        asked = {(p.model, p.channel, p.omega) for _, p in active if p.channel >= -1 and not np.isnan(p.omega)}
        B = _updated(B, new - x, active, trial.pieces(_WINDOW))
        if value - found >= _GOOD * promised:
            room = min(max(room, 2.0 * length), _LARGEST)
        x, point, value = new, trial, found
        asked = set()
        history.append(value)
        if len(history) > 5 and history[-6] - value < gain:
            return Polished(x, value, k + 1, False)
    return Polished(x, value, steps, False)


def _chosen(point: Point, asked: "set[tuple[int, int, float]]") -> list[Piece]:
    pieces = point.pieces(_WINDOW, asked)
    order = sorted(range(len(pieces)), key=lambda i: (not pieces[i].limit, pieces[i].value), reverse=True)
    aims = [pieces[i] for i in order if not pieces[i].limit][:_MOST]
    return aims + [pieces[i] for i in order if pieces[i].limit][:_MOST]


def _step(
    pieces: list[Piece], B: Array, x: Array, low: Array, high: Array, room: float, weight: float, value: float
) -> tuple[Array, float, Array]:
    """Return the step of a quadratic programme, the gain that it promises, and the multipliers of the pieces."""
    n = len(x)
    values, slopes = np.array([p.value for p in pieces]), np.array([p.gradient for p in pieces])
    limits = np.array([p.limit for p in pieces])
    top = values[~limits].max()
    H = np.zeros((n + 2, n + 2))
    H[:n, :n] = B
    c = np.zeros(n + 2)
    c[n], c[n + 1] = 1.0, weight
    rows = [np.column_stack([slopes, -(~limits).astype(float), -limits.astype(float)])]
    sides = [np.where(limits, -values, top - values)]
    slack = np.zeros((1, n + 2))
    slack[0, n + 1] = -1.0
    rows.append(slack)
    sides.append(np.zeros(1))
    up, down = np.minimum(high - x, room), np.minimum(x - low, room)
    free = np.hstack([np.eye(n), np.zeros((n, 2))])
    rows += [free, -free]
    sides += [np.maximum(up, 0.0), np.maximum(down, 0.0)]
    # numbers that rest at an end leave no interior: a hair of room, which is clipped away afterwards
    sides[-1], sides[-2] = sides[-1] + 1e-12 * room, sides[-2] + 1e-12 * room
    y, z = least(H, c, np.vstack(rows), np.concatenate(sides))
    d = y[:n]
    model = float((np.where(limits, -inf, values - top + slopes @ d)).max())
    over = max(float((np.where(limits, values + slopes @ d, 0.0)).max(initial=0.0)), 0.0)
    promised = value - (top + model + weight * over)
    return d, promised, z[: len(pieces)]


def _unseen(trial: Point, pieces: list[Piece], asked: "set[tuple[int, int, float]]") -> "set[tuple[int, int, float]]":
    """Return what stands out at a point tried and was no piece."""
    found = set()
    for model, channel, omega in trial.highest:
        there = [p.omega for p in pieces if p.model == model and p.channel == channel]
        if not any(abs(omega - each) <= 1e-3 * abs(omega) or omega == each for each in there):
            found.add((model, channel, omega))
    return found - asked


def _updated(B: Array, s: Array, active: list[tuple[float, Piece]], after: list[Piece]) -> Array:
    """Return the curvature of the Lagrangian, by Powell's damped update."""
    y, size = np.zeros_like(s), float(s @ B @ s)
    for multiplier, piece in active:
        alike = [p for p in after if p.model == piece.model and p.channel == piece.channel and p.top]
        if not alike:
            continue
        near = alike[0] if np.isnan(piece.omega) else min(alike, key=lambda p: _apart(p.omega, piece.omega))
        if np.isnan(piece.omega) or _apart(near.omega, piece.omega) <= _NEAR:
            y += multiplier * (near.gradient - piece.gradient)
    if size <= 0.0:
        return B
    product = float(s @ y)
    share = 1.0 if product >= 0.2 * size else 0.8 * size / (size - product)
    r = share * y + (1.0 - share) * (B @ s)
    Bs = B @ s
    return B - np.outer(Bs, Bs) / size + np.outer(r, r) / float(s @ r)


def _apart(a: float, b: float) -> float:
    if a == b:
        return 0.0
    if np.isinf(a) or np.isinf(b):
        return inf
    return abs(a - b) / max(abs(a), abs(b))


def stationarity(pieces: list[Piece], x: Array, low: Array, high: Array) -> float:
    """Return the length of the least element of the hull of gradients, what points out of the ends left away."""
    slopes = np.array([p.gradient for p in pieces])
    n, m = len(x), len(slopes)
    if not m or not n:
        return 0.0
    aims = np.array([not p.limit for p in pieces])
    H = np.zeros((n + 1, n + 1))
    H[:n, :n] = np.eye(n)
    c = np.zeros(n + 1)
    c[n] = 1.0
    rows = np.column_stack([slopes, np.where(aims, -1.0, 0.0)])
    up, down = (x >= high), (x <= low)
    bounds = np.vstack([np.eye(n + 1)[:n][up], -np.eye(n + 1)[:n][down]])
    G = np.vstack([rows, bounds])
    y, _ = least(H, c, G, np.full(len(G), 1e-13))
    return float(np.linalg.norm(y[:n]))
