"""What measurements see of the parameters: slopes by differences, and the combinations that change nothing measured."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.free import FreeParameters

_STEPS = (1e-3, 1e-4, 1e-5, 1e-6)  # of a coordinate, compared with each other: the truncation falls, the rounding rises
_TEN = 10.0  # times the error of the slopes: a combination that moves the values by less is not seen (a choice)
_ROUNDING = 1e-10  # share of the largest singular value that is rounding, whatever the steps say (a choice)
_PART = 1e-3  # share in a combination from which a parameter belongs to it (a choice)
_SAID = 0.02  # share of the largest in a combination that is left out of the words (a choice)
_CHANGE = float(np.log(2.0))  # of a coordinate, in words: a parameter twice as large (a choice)


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
    """Return central differences, one-sided at the end of a range and where the model is refused; of all, or some."""
    columns = []
    for i in range(free.size) if which is None else which:
        ends = []
        for sign in (-1.0, 1.0):
            at = x.copy()
            at[i] = np.clip(x[i] + sign * steps[i], free.low[i], free.high[i])
            ends.append((at, f(at)))
        ends = [(x, f(x)) if not np.isfinite(value).all() else (at, value) for at, value in ends]
        width = ends[1][0][i] - ends[0][0][i]
        columns.append((ends[1][1] - ends[0][1]) / width if width > 0.0 else np.zeros_like(ends[0][1]))
    return np.array(columns).T


def slopes(f: Callable[[Array], Array], x: Array, free: FreeParameters) -> Slopes:
    """Return the slopes with the steps that agree best with ten times smaller ones, each column for itself."""
    found = np.array([differences(f, x, np.full(free.size, step), free) for step in _STEPS])
    apart = np.sqrt(np.square(np.diff(found, axis=0)).sum(axis=1))
    best = apart.argmin(axis=0)
    columns = np.arange(free.size)
    return Slopes(found[best, :, columns].T, apart[best, columns], np.array(_STEPS)[best])


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
        Change of the residuals for a unit of each combination; below the error of the slopes zero.
    directions : (p, p) ndarray
        Combinations as rows.
    """

    values: Array
    directions: Array

    @classmethod
    def of(cls, slopes: Slopes) -> "Seen":
        """Return what the slopes see."""
        p = slopes.matrix.shape[1]
        _, values, directions = linalg.svd(slopes.matrix, full_matrices=True)
        values = np.pad(values, (0, p - len(values)))
        error = max(_TEN * float(np.linalg.norm(slopes.error)), _ROUNDING * values[0])
        return cls(np.where(values > error, values, 0.0), directions)

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

    def combinations(self, free: FreeParameters, limit: float) -> tuple[Combination, ...]:
        """Return what is not seen, and what is hardly seen: with ``limit`` the size of residuals that count as none."""
        found = [_combination(free, row, False) for row in _plain(self.directions[self.rank :])]
        for value, row in zip(self.values[: self.rank], self.directions[: self.rank], strict=True):
            if value * _CHANGE / np.abs(row).max() < limit:
                found.append(_combination(free, row, True))
        return tuple(found)


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


def _combination(free: FreeParameters, row: Array, hardly: bool) -> Combination:
    largest = int(np.abs(row).argmax())
    scaled = row / row[largest]
    there = [int(i) for i in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[i]) > _SAID]
    words = " with ".join(free.told(i, scaled[i] * _CHANGE) for i in there)
    end = "changes less than the confidence limit: hardly seen" if hardly else "changes nothing that was measured"
    return Combination({free.names[i]: float(scaled[i]) for i in there}, hardly, f"{words} {end}")
