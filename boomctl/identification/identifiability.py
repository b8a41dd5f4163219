"""What measurements see of the parameters: slopes by differences, and the combinations that change nothing measured."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.free import FreeParameters

_STEPS = (1e-3, 1e-4, 1e-5, 1e-6)  # of a coordinate, compared with each other: the truncation falls, the rounding rises
_SHORTEST = 1e-11  # step to which a slope is followed that goes on changing, as beside a sharp resonance (a choice)
_RESOLVED = 1e-4  # share of a slope to which two steps agree where smaller ones are not asked (a choice)
_WIDE = 0.1  # share of a step that has to be left at the end of a range, for a difference to be one of it (a choice)
_KNOWN = (
    1e-2  # share of a slope that its error is at most taken for: what steps disagree on changes something (a choice)
)
_TEN = 10.0  # times the error of the slopes: a combination that moves the values by less is not seen (a choice)
_TRIED = 3.0  # times the error of a combination: a slope along it that is larger is seen (a choice, above one)
_ROUNDING = 1e-10  # share of the largest singular value that is rounding, whatever the steps say (a choice)
_PART = 1e-3  # share in a combination from which a parameter belongs to it (a choice)
_SAID = 0.02  # share of the largest in a combination that is left out of the words (a choice)
_CHANGE = float(np.log(2.0))  # of a coordinate, in words: a parameter twice as large (a choice)
_CHANGES = (
    _CHANGE,
    float(np.log(1.1)),
    float(np.log(1.01)),
    float(np.log(1.001)),
)  # tried, the first that holds is said


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the residuals with respect to the coordinates.

    Attributes
    ----------
    matrix : (n, p) ndarray
    error : (p,) ndarray
        How far two different steps disagree, a column.
    steps : (p,) ndarray
        Steps taken.
    """

    matrix: Array
    error: Array
    steps: Array


def differences(
    f: Callable[[Array], Array], x: Array, steps: Array, free: FreeParameters, which: Iterable[int] | None = None
) -> Array:
    """Return central differences, one-sided at the end of a range and where the model is refused; of all, or some.

    They are zero where the model is refused on both sides.
    """
    axes = np.eye(free.size)
    columns = [along(f, x, axes[i], steps[i], free) for i in (range(free.size) if which is None else which)]
    return np.nan_to_num(np.array(columns).T)


def along(f: Callable[[Array], Array], x: Array, direction: Array, step: float, free: FreeParameters) -> Array:
    """Return the difference quotient along a direction, ``nan`` where there is no room for a step.

    A side that is refused or out of range is left: the difference is taken inwards, from where we are, of second order
    too.
    """
    ends = []
    for sign in (-1.0, 1.0):
        room = np.where(sign * direction > 0.0, free.high - x, x - free.low)[direction != 0.0]
        moved = min(step, float((room / np.abs(direction[direction != 0.0])).min()))
        value = f(np.clip(x + sign * moved * direction, free.low, free.high))
        if np.isfinite(value).all() and moved > _WIDE * step:
            ends.append((sign * moved, value))
    if len(ends) == 2:
        return (ends[1][1] - ends[0][1]) / (ends[1][0] - ends[0][0])
    here = f(x)
    if not ends:
        return np.full_like(here, np.nan)
    ((moved, value),) = ends
    whole = (value - here) / moved
    half = (f(np.clip(x + 0.5 * moved * direction, free.low, free.high)) - here) / (0.5 * moved)
    return 2.0 * half - whole if np.isfinite(half).all() else whole


def slopes(f: Callable[[Array], Array], x: Array, free: FreeParameters) -> Slopes:
    """Return the slopes with the steps that agree best with ten times smaller ones, each column for itself.

    Raises
    ------
    ArithmeticError
        The model refuses all values beside that of a parameter.
    """
    columns, errors, steps = [], [], []
    for name, axis in zip(free.names, np.eye(free.size), strict=True):
        tried = list(_STEPS)
        found = [along(f, x, axis, step, free) for step in tried]
        while True:
            apart, size = np.linalg.norm(np.diff(found, axis=0), axis=1), np.linalg.norm(found[1:], axis=1)
            share = np.nan_to_num(
                apart / np.where(size > 0.0, size, 1.0), nan=np.inf
            )  # where a response bends, all differ
            best = int(share.argmin())
            if (share[best] < np.inf and (best < len(apart) - 1 or share[best] <= _RESOLVED)) or tried[-1] <= _SHORTEST:
                break
            tried.append(0.1 * tried[-1])
            found.append(along(f, x, axis, tried[-1], free))
        if not np.isfinite(apart[best]):
            value = float(free.values(x)[free.names.index(name)])
            raise ArithmeticError(
                f"fit: the model refuses all values of {name} beside {value:.9g}; expected a wider range"
            )
        columns.append(found[best])
        errors.append(apart[best])
        steps.append(tried[best])
    return Slopes(np.array(columns).T, np.array(errors), np.array(steps))


class Forward:
    """Forward differences beside the last value asked for: half the work, near enough on the way to a minimum.

    A solver asks for the residuals at a place first, and for their slopes there next; others are computed anew.
    """

    def __init__(
        self, f: Callable[[Array], Array], steps: Array, free: FreeParameters, which: Array | None = None
    ) -> None:
        self._f, self._steps, self._free = f, steps, free
        self._which = np.arange(free.size) if which is None else which
        self._last: tuple[Array, Array] | None = None

    def residuals(self, x: Array) -> Array:
        """Return the residuals, and remember them."""
        self._last = x.copy(), self._f(x)
        return self._last[1]

    def slopes(self, x: Array) -> Array:
        """Return one-sided differences; central ones where the model refuses the place beside."""
        last = self._last
        here = last[1] if last is not None and np.array_equal(last[0], x) else self._f(x)
        columns = []
        for i in self._which:
            at = x.copy()
            at[i] += self._steps[i] if x[i] + self._steps[i] <= self._free.high[i] else -self._steps[i]
            beside = self._f(at)
            if not np.isfinite(beside).all():
                return differences(self._f, x, self._steps, self._free, self._which)
            columns.append((beside - here) / (at[i] - x[i]))
        return np.array(columns).T


@dataclass(frozen=True)
class Combination:
    """Parameters that change together while what was measured stays, or hardly changes.

    Attributes
    ----------
    direction : dict of str to float
        The change of the logarithm of each positive parameter (of others, in units of their range), the largest 1.
    hardly : bool
        False: not seen at all.  True: a factor of two along it stays within the confidence limit.
    text : str
        The combination in words.
    """

    direction: dict[str, float]
    hardly: bool
    text: str

    def __repr__(self) -> str:
        return f"Combination: {self.text}"


@dataclass(frozen=True)
class Seen:
    """Singular values of the slopes, largest first, and what follows from them.

    Attributes
    ----------
    values : (p,) ndarray
        Change of the residuals for a unit of each combination; zero where it is not seen.
    directions : (p, p) ndarray
        Combinations as orthonormal rows.
    """

    values: Array
    directions: Array

    @classmethod
    def of(cls, slopes: Slopes, f: Callable[[Array], Array], x: Array, free: FreeParameters) -> "Seen":
        """Return what the slopes see; what they do not see was tried, and changed nothing.

        Each column counts by its own size: a parameter that does little is not hidden by the error of one that does much.
        """
        size = np.linalg.norm(slopes.matrix, axis=0)
        size[size == 0.0] = 1.0
        error = np.minimum(slopes.error, _KNOWN * size)
        p = len(size)
        _, values, rows = linalg.svd(slopes.matrix / size)
        values = np.pad(values, (0, p - len(values)))
        least = max(_TEN * float(np.linalg.norm(error / size)), _ROUNDING * values[0])
        hidden, anywhere, felt = [], replace(free, low=np.full(p, -np.inf), high=np.full(p, np.inf)), np.inf
        for row in rows[values <= least] / size:
            direction = row / np.linalg.norm(row)
            tried = [along(f, x, direction, step, anywhere) for step in {*_STEPS, *slopes.steps.tolist()}]
            found = min((float(np.linalg.norm(each)) for each in tried if np.isfinite(each).all()), default=0.0)
            if found > _TRIED * float(np.linalg.norm(error * direction)) + _ROUNDING * values[0] * float(size.max()):
                felt = min(felt, found)
            else:
                hidden.append(direction)
        null = linalg.orth(np.array(hidden).T) if hidden else np.zeros((p, 0))
        rank = p - null.shape[1]
        _, values, rows = linalg.svd(slopes.matrix - slopes.matrix @ null @ null.T)
        values = np.pad(values, (0, p - len(values)))
        if np.isfinite(felt):  # the columns missed what was felt along a combination
            values[:rank] = np.maximum(values[:rank], felt)
        values[rank:] = 0.0
        return cls(values, np.vstack([rows[:rank], null.T]))

    @property
    def rank(self) -> int:
        """How many combinations are seen."""
        return int((self.values > 0.0).sum())

    @property
    def hidden(self) -> Array:
        """Which parameters belong to a combination that is not seen."""
        return np.linalg.norm(self.directions[self.rank :], axis=0) > _PART

    @property
    def alone(self) -> Array:
        """Which parameters are not seen by themselves, whatever the others do."""
        return np.linalg.norm(self.directions[self.rank :], axis=0) > 1.0 - _PART

    def covariance(self) -> Array:
        """Return the covariance of the coordinates for errors of size one, over what is seen."""
        r = self.rank
        scaled = self.directions[:r] / self.values[:r, None]
        return scaled.T @ scaled

    def combinations(
        self, f: Callable[[Array], Array], x: Array, free: FreeParameters, limit: float, rounding: float
    ) -> tuple[Combination, ...]:
        """Return what is not seen, and what is hardly seen; what is said of them was tried.

        Sizes of residuals that count as none are ``limit`` and, where nothing changes, ``rounding``.
        """
        found = [_combination(f, x, free, row, False, rounding) for row in _plain(self.directions[self.rank :])]
        for value, row in zip(self.values[: self.rank], self.directions[: self.rank], strict=True):
            if value * _CHANGE / np.abs(row).max() < limit:
                found.append(_combination(f, x, free, row, True, limit))
        return tuple(each for each in found if each is not None)


def _plain(rows: Array) -> Array:
    """Return combinations that span the same, each with a parameter that no other has (Gauss-Jordan)."""
    rows = rows.copy()
    taken: list[int] = []
    for k in range(len(rows)):
        sizes = np.abs(rows[k])
        sizes[taken] = 0.0
        pivot = int(sizes.argmax())
        taken.append(pivot)
        rows[k] /= rows[k, pivot]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, pivot] * rows[k]
    return rows


def _combination(
    f: Callable[[Array], Array], x: Array, free: FreeParameters, row: Array, hardly: bool, allowed: float
) -> Combination | None:
    """Return a combination in words that hold: by the largest factor, of some, that changes no more than is allowed.

    Of what is seen but hardly there is none (None) where no factor does; of what is not seen at all, the slope is zero.
    """
    largest = int(np.abs(row).argmax())
    scaled = row / row[largest]
    here, said, holding = f(x), _CHANGES[-1], False
    for change in _CHANGES:
        moved = {change * sign: f(x + sign * change * scaled) - here for sign in (1.0, -1.0)}
        sizes = {move: float(np.linalg.norm(each)) for move, each in moved.items() if np.isfinite(each).all()}
        if sizes and max(sizes.values()) <= allowed:
            said, holding = next(iter(sizes)), True
            break
        if hardly:
            return None
    there = [int(i) for i in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[i]) > _SAID]
    words = " with ".join(free.told(i, scaled[i] * said) for i in there)
    end = "changes less than the confidence limit: hardly seen" if hardly else "changes nothing that was measured"
    if not holding:
        end = "changes what was measured by less, the smaller it is: its slope is zero"
    return Combination({free.names[i]: float(scaled[i]) for i in there}, hardly, f"{words} {end}")
