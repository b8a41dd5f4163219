"""Identifiability of parameters: Jacobian by differences, and combinations without an effect on the data."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.free import FreeParameters
from boomctl.lti.rounding import DEPENDENT

STEP = 1e-5  # coordinate step of differences: truncation errors fall with it, rounding errors rise
# Step sizes; the derivative at the step that agrees best with the next one is used.
_STEPS = 10.0 ** -np.arange(3.0, 12.0)
_TESTED_STEPS = 6  # Number of steps for testing a combination that the Jacobian does not resolve.
_MIN_STEP_FRACTION = 0.1  # of a step that has to remain at the end of a range
_MAX_SLOPE_ERROR = 1e-2  # relative error of a slope, at most: columns that differ by more are not zero
_ERROR_FACTOR = 10.0  # Singular values below this multiple of the error of the Jacobian are tested by differences.
_TESTED_FACTOR = 3.0  # Derivative over its error above which a combination counts as identifiable.
_MIN_COMPONENT = 1e-3  # component of a unit vector from which a parameter belongs to a combination
_MIN_TEXT_COMPONENT = 0.02  # relative component from which a parameter is named in the text
_CHANGES = np.log([2.0, 1.1, 1.01, 1.001])  # coordinate changes for the text; the first that holds is used


def differences(f: Callable[[Array], Array], x: Array, step: float, free: FreeParameters) -> Array:
    """Compute central differences, one-sided at the end of a range; ``nan`` where the model raises on both sides."""
    return np.array([_along(f, x, axis, step, free) for axis in np.eye(free.size)]).T


def _along(f: Callable[[Array], Array], x: Array, direction: Array, step: float, free: FreeParameters) -> Array:
    """Compute the difference quotient along a direction, ``nan`` if no step is within the range.

    If the model raises on one side, or the range ends there, the difference is one-sided and of second order.
    """
    part, ends = direction != 0.0, []
    for sign in (-1.0, 1.0):
        distance = np.where(sign * direction > 0.0, free.high - x, x - free.low)[part] / np.abs(direction[part])
        moved = min(step, float(distance.min()))
        value = f(np.clip(x + sign * moved * direction, free.low, free.high))
        if np.isfinite(value).all() and moved > _MIN_STEP_FRACTION * step:
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


def jacobian(f: Callable[[Array], Array], x: Array, free: FreeParameters) -> tuple[Array, Array]:
    """Compute the derivatives of the residuals, each column with the step that agrees best with the next smaller one.

    Returns
    -------
    matrix : (n, p) ndarray
    error : (p,) ndarray
        How far the two steps disagree, a column.

    Raises
    ------
    ArithmeticError
        If the model raises on both sides of a parameter.
    """
    quotients = np.array([differences(f, x, step, free) for step in _STEPS])
    error, size = (np.linalg.norm(item, axis=1) for item in (np.diff(quotients, axis=0), quotients[1:]))
    ratio = error / np.where(size == 0.0, 1.0, size)
    ratio[np.isnan(ratio)] = np.inf
    best, columns = ratio.argmin(axis=0), np.arange(free.size)
    if np.isinf(ratio.min(axis=0)).any():
        k = int(ratio.min(axis=0).argmax())
        raise ArithmeticError(
            f"fit: the model raises at all values near {free.names[k]} = {free.values(x)[k]:.9g}."
            " Use a range that ends where the model does."
        )
    return quotients[best, :, columns].T, error[best, columns]


@dataclass(frozen=True)
class ParameterCombination:
    """Combination of parameters without an effect, or with a small effect, on the data.

    Attributes
    ----------
    direction : dict of str to float
        The change of the logarithm of each positive parameter (of others, in units of their range), the largest 1.
    weak : bool
        False: no effect. True: the effect of a factor of two is within the confidence limit.
    description : str
        The combination in words.
    """

    direction: dict[str, float]
    weak: bool
    description: str

    def __repr__(self) -> str:
        return f"ParameterCombination:\n  {self.description}"


@dataclass(frozen=True)
class IdentifiedSubspace:
    """Singular values of the Jacobian, largest first, and the identifiable combinations.

    Attributes
    ----------
    values : (p,) ndarray
        Change of the residuals for a unit of each combination; zero if it is unidentifiable.
    directions : (p, p) ndarray
        Combinations as orthonormal rows.
    """

    values: Array
    directions: Array

    @classmethod
    def of(
        cls, matrix: Array, error: Array, f: Callable[[Array], Array], x: Array, free: FreeParameters
    ) -> "IdentifiedSubspace":
        """Compute the singular values; combinations that the Jacobian does not resolve are tested by differences.

        Columns are scaled to unit length, so that weak parameters do not drown in the errors of strong ones.
        """
        size = np.linalg.norm(matrix, axis=0)
        size[size == 0.0] = 1.0
        error, p = np.minimum(error, _MAX_SLOPE_ERROR * size), len(size)
        values, rows = _svd(matrix / size)
        least = max(_ERROR_FACTOR * float(np.linalg.norm(error / size)), DEPENDENT * values[0])
        hidden, anywhere, resolved = [], replace(free, low=np.full(p, -np.inf), high=np.full(p, np.inf)), 0.0
        for row in rows[values <= least] / size:
            direction = row / np.linalg.norm(row)
            quotients = [_along(f, x, direction, step, anywhere) for step in _STEPS[:_TESTED_STEPS]]
            smallest = min((float(np.linalg.norm(item)) for item in quotients if np.isfinite(item).all()), default=0.0)
            if (
                smallest
                > _TESTED_FACTOR * float(np.linalg.norm(error * direction)) + DEPENDENT * values[0] * size.max()
            ):
                resolved = min(resolved or smallest, smallest)
            else:
                hidden.append(direction)
        null = linalg.orth(np.array(hidden).T) if hidden else np.zeros((p, 0))
        rank = p - null.shape[1]
        values, rows = _svd(matrix - matrix @ null @ null.T)
        values = np.append(np.maximum(values[:rank], resolved), np.zeros(p - rank))
        return cls(values, np.vstack([rows[:rank], null.T]))

    @property
    def rank(self) -> int:
        """Number of combinations that are identifiable."""
        return int((self.values > 0.0).sum())

    @property
    def hidden(self) -> Array:
        """Mask of the parameters in combinations that are not identifiable."""
        return np.linalg.norm(self.directions[self.rank :], axis=0) > _MIN_COMPONENT

    def covariance(self) -> Array:
        """Return the covariance of the identifiable coordinates for errors of size one."""
        r = self.rank
        scaled = self.directions[:r] / self.values[:r, None]
        return scaled.T @ scaled

    def combinations(
        self, f: Callable[[Array], Array], x: Array, free: FreeParameters, limit: float, rounding: float
    ) -> tuple[ParameterCombination, ...]:
        """Return the combinations that are not or weakly identifiable, each tested on the model.

        Changes of the residuals count as none up to ``limit``, of what is not identifiable up to ``rounding``.
        """
        result, rows = [], self.directions[self.rank :].copy()
        if len(rows):  # reduced row echelon form: one parameter in each row that no other row has
            R, order = linalg.qr(rows, mode="r", pivoting=True)
            rows[:, order] = linalg.solve_triangular(R[:, : len(rows)], R)
            result = [_combination(f, x, free, row, False, rounding) for row in rows]
        for value, row in zip(self.values[: self.rank], self.directions, strict=False):
            if value * _CHANGES[0] / np.abs(row).max() < limit:
                result.append(_combination(f, x, free, row, True, limit))
        return tuple(item for item in result if item is not None)


def _svd(matrix: Array) -> tuple[Array, Array]:
    """Compute as many singular values as columns, and the right singular vectors as rows, from the triangular factor."""
    R = np.linalg.qr(matrix, mode="r")
    return linalg.svd(np.pad(R, ((0, matrix.shape[1] - len(R)), (0, 0))))[1:]


def _combination(
    f: Callable[[Array], Array], x: Array, free: FreeParameters, row: Array, weak: bool, allowed: float
) -> ParameterCombination | None:
    """Return a combination with the largest factor that changes the residuals by no more than is allowed.

    None if ``weak`` and a factor of two changes more.
    """
    scaled = row / row[np.abs(row).argmax()]
    here = f(x)
    for change in _CHANGES[:1] if weak else _CHANGES:
        sizes = {move: float(np.linalg.norm(f(x + move * scaled) - here)) for move in (change, -change)}
        sizes = {move: size for move, size in sizes.items() if np.isfinite(size)}
        if sizes and max(sizes.values()) <= allowed:
            said = next(iter(sizes))
            end = "is within the confidence limit" if weak else "has no effect on the data"
            break
    else:
        if weak:
            return None
        said, end = _CHANGES[-1], "has no first-order effect on the data"
    listed = [int(i) for i in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[i]) > _MIN_TEXT_COMPONENT]
    text = " with ".join(free.described(i, scaled[i] * said) for i in listed)
    name = "weakly identifiable" if weak else "unidentifiable"
    return ParameterCombination({free.names[i]: float(scaled[i]) for i in listed}, weak, f"{name}: {text} {end}")
