"""Generalized plants as polynomials of physical parameters, so that their derivatives are exact.

Springs and dampers enter the matrices of a state space in straight lines, masses as smooth as a polynomial of some degree.
The polynomials are found through plants at Chebyshev points and are compared with others apart from these: where a plant's
states are not the same ones everywhere, as modes that change their sign, there is no polynomial.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from math import prod

import numpy as np
from numpy.polynomial import chebyshev

from boomctl.arrays import Array, balance, blocks
from boomctl.chebyshev import series
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tuning.problem import ScaledPlant, band_of

_COUNTS = (
    5,
    9,
    17,
    33,
)  # points along a parameter that are tried in turn: straight lines and squares, masses, positions
_MOST = 400  # plants made for one polynomial at most: some hundred steps by differences (a choice)
_SMALL = 1e-11  # share of a row's size up to which the last coefficients must have fallen, or are rounding: 1e5 eps
_ROUNDING = 1e-14  # and this, up to which a coefficient is left out: 1e2 eps, as small errors may cancel large motions
_SAME = 1e-8  # share of a response's peak to which a polynomial meets plants beside its own: far below what is tuned to
_NOTHING = 1e-10  # share of a signal's other responses below which one is rounding (a choice)
_BESIDE = 3  # points drawn at which they are, and two corners (a choice)

Make = Callable[[Array], GeneralizedPlant]


@dataclass(frozen=True)
class PlantSeries:
    """All matrices of a generalized plant, ``[[A, B], [C, D]]``, as Chebyshev series of numbers between -1 and 1.

    Attributes
    ----------
    coefficients : ndarray
        One axis a number, then rows and columns.
    plant : GeneralizedPlant
        One of the plants: its signals are those of all.
    """

    coefficients: Array
    plant: GeneralizedPlant

    @property
    def degrees(self) -> tuple[int, ...]:
        """Of each number."""
        return tuple(count - 1 for count in self.coefficients.shape[:-2])

    def at(self, numbers: Array) -> tuple[Array, Array, Array]:
        """Return the matrix, its first derivatives (k, r, c) and its second ones (k, k, r, c)."""
        k, shape = len(numbers), self.coefficients.shape[-2:]
        axes = [_powers(count, float(x)) for count, x in zip(self.coefficients.shape, numbers, strict=False)]
        wanted = [(), *((i,) for i in range(k)), *((i, j) for i in range(k) for j in range(i, k))]
        weights = np.array([_outer([axes[a][orders.count(a)] for a in range(k)]) for orders in wanted])
        result = (weights @ self.coefficients.reshape(weights.shape[1], -1)).reshape(len(wanted), *shape)
        bends = np.empty((k, k, *shape))
        for (i, j), bend in zip(wanted[1 + k :], result[1 + k :], strict=True):
            bends[i, j] = bends[j, i] = bend
        return result[0], result[1 : 1 + k], bends

    def scaled(self, numbers: Array) -> ScaledPlant:
        """Return the plant with balanced states, and its derivatives."""
        result, slopes, bends = self.at(numbers)
        s, n = self.plant.system, len(self.plant.A)
        here = replace(s, A=result[:n, :n], B=result[:n, n:], C=result[n:, :n], D=result[n:, n:])
        states = balance(here.A)[1]
        return ScaledPlant.of(replace(self.plant, system=here), states).moving(slopes, bends, states)


def plant_series(make: Make, given: Make, size: int, over: Callable[[], bool]) -> PlantSeries | None:
    """Return the polynomial of what a function makes; None where there is none, or no time for it.

    Parameters
    ----------
    make : function
        From numbers between -1 and 1 to a plant, with the same states everywhere as far as it can.
    given : function
        What the polynomial is compared with: the plants as they are meant.
    size : int
        Number of numbers.
    over : function
        Whether the time is up.
    """
    base = np.random.default_rng(0).uniform(-0.7, 0.7, size)  # where nothing cancels
    try:
        first = make(base)
        scale = balance(first.A)[1]
        counts = []
        for unit in np.eye(size):
            found = _count(lambda x, unit=unit: make(np.where(unit > 0.0, x, base)), scale, over)
            if found is None:
                return None
            counts.append(found)
        if prod(counts) > _MOST:
            return None
        made = []
        for point in product(*(chebyshev.chebpts1(count) for count in counts)):
            if over():
                return None
            made.append(_matrix(make(np.array(point))))
        coefficients = np.array(made).reshape(*counts, *made[0].shape)
    except (ValueError, np.linalg.LinAlgError):  # other sizes, or a plant that does not exist
        return None
    for axis in range(size):
        coefficients = np.moveaxis(series(np.moveaxis(coefficients, axis, 0)), 0, axis)
    result = PlantSeries(coefficients, first)
    inside = np.random.default_rng(1).uniform(-1.0, 1.0, (_BESIDE, size))
    beside = [*inside, -np.ones(size), np.ones(size)]
    return result if all(_meets(result, given(point), point) for point in beside) else None


def _count(line: Callable[[float], GeneralizedPlant], scale: Array, over: Callable[[], bool]) -> int | None:
    """Return how many coefficients a line of plants needs."""
    for count in _COUNTS:
        if over():
            return None
        stack = np.array([_matrix(line(float(x)), scale) for x in chebyshev.chebpts1(count)])
        size = np.abs(stack).max(axis=(0, 2))[:, None]
        result = np.abs(series(stack))
        if (result[-2:] <= _SMALL * size).all():
            used = np.flatnonzero((result > _ROUNDING * size).any(axis=(1, 2)))
            return int(used[-1]) + 1 if len(used) else 1
    return None


def _matrix(plant: GeneralizedPlant, scale: Array | None = None) -> Array:
    s = plant.system
    rows = np.ones(len(s.A)) if scale is None else scale
    return blocks([[s.A * rows / rows[:, None], s.B / rows[:, None]], [s.C * rows, s.D]])


def _meets(series: PlantSeries, plant: GeneralizedPlant, point: Array) -> bool:
    """Return whether responses are those of a plant made at a point."""
    result, s = series.at(point)[0], plant.system
    n = len(s.A)
    if result.shape != (n + len(s.C), n + s.B.shape[1]):
        return False
    omega = band_of([s])[1]
    mine = replace(s, A=result[:n, :n], B=result[:n, n:], C=result[n:, :n], D=result[n:, n:])
    exact = s.response(omega, quiet=True)
    apart, size = np.abs(mine.response(omega, quiet=True) - exact).max(axis=2), np.abs(exact).max(axis=2)
    rounding = _NOTHING * np.minimum(size.max(axis=1, initial=0.0)[:, None], size.max(axis=0, initial=0.0))
    return bool((apart <= _SAME * np.maximum(size, rounding)).all())


def _powers(count: int, x: float) -> Array:
    """Return the Chebyshev polynomials at a place, their first and their second derivatives."""
    result = np.zeros((3, count))
    result[0, 0] = 1.0
    if count > 1:
        result[:, 1] = x, 1.0, 0.0
    for n in range(2, count):
        for order in range(3):
            result[order, n] = (
                2.0 * (x * result[order, n - 1] + order * result[order - 1, n - 1]) - result[order, n - 2]
            )
    return result


def _outer(factors: list[Array]) -> Array:
    """Return all products of one entry of each factor, the last running first."""
    result = np.ones(1)
    for factor in factors:
        result = np.outer(result, factor).ravel()
    return result
