"""Confidence intervals by profile likelihood: how far a parameter goes while the others do their best to make up for it.

In a linear model these are the usual ones.  Where the model is not, they follow its curvature, and have no end where the
measurements do not bound a parameter.  Source: Bates & Watts (1988), Nonlinear Regression Analysis, chapter 6.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.identification.free import FreeParameters
from boomctl.identification.identifiability import Forward, Seen

_CLOSE = 0.01  # share of an interval's half width to which its end is found (a choice)
_ROUNDS = 20  # steps towards an end; two or three do
_FIRST = 0.7  # of a coordinate, the first step at most: a factor of two (a choice)
_FAR_OFF = 1.5  # times the limit: a rise that no step from within it should meet (a choice)
_GROWN = 4.0  # times as far at most in one step: the profile may be flat there (a choice)
_INNER = {"xtol": 1e-6, "ftol": 1e-8, "gtol": 1e-10, "max_nfev": 30}  # of the other parameters: the profile to 1e-4
_BETTER = 0.05  # of the squared size of errors: a profile that falls so far below its start has found a better fit


class BetterFit(Exception):
    """A profile has come to parameters that fit better than those it began from."""

    def __init__(self, x: Array) -> None:
        super().__init__("a better fit was found on the way")
        self.x = x


@dataclass(frozen=True)
class Profile:
    """What profiles are computed from.

    Attributes
    ----------
    residuals : callable
        From coordinates to residuals, not finite where the model is refused.
    free : FreeParameters
    x : (p,) ndarray
        The best coordinates.
    steps : (p,) ndarray
        For differences.
    seen : Seen
    size : float
        Size of the errors (one standard deviation), in units of the residuals.
    quantile : float
        How many of them are within confidence.
    """

    residuals: Callable[[Array], Array]
    free: FreeParameters
    x: Array
    steps: Array
    seen: Seen
    size: float
    quantile: float

    def end(self, i: int, sign: int) -> float:
        """Return the end of the interval of a coordinate, infinite where there is none.

        Raises
        ------
        BetterFit
            The profile falls below its start.
        """
        covariance = self.seen.covariance()
        least = float(np.square(self.residuals(self.x)).sum())
        reach, limit = self.free.reach(self.x, i, sign), self.quantile * self.size
        if self.seen.hidden[i]:  # not seen here, but perhaps further away, as a damping that went to zero
            path, step = sign * np.eye(self.free.size)[i], 1.0
        else:
            path, step = sign * covariance[:, i] / covariance[i, i], limit * np.sqrt(covariance[i, i])
        low, high, step = 0.0, np.inf, min(step, _FIRST, reach)
        good = self.x  # the last place within the limit
        for _ in range(_ROUNDS):
            x, cost = self._inner(i, good + (step - low) * path)
            if cost - least > (_FAR_OFF * limit) ** 2:  # perhaps the others went astray: once more from where they were
                other, second = self._inner(i, np.where(np.arange(len(good)) == i, self.x + sign * step, good))
                x, cost = (other, second) if second < cost else (x, cost)
            rise = cost - least
            if rise < -_BETTER * self.size**2:
                raise BetterFit(x)
            found = np.sqrt(max(rise, 0.0)) / limit
            if abs(found - 1.0) < _CLOSE:
                return self.x[i] + sign * step
            if found < 1.0:
                if step >= reach:
                    return sign * np.inf
                low, good, path = step, x, (x - self.x) / step
            else:
                high = step
            aimed = step / max(found, 1.0 / _GROWN) if np.isfinite(found) else 0.0
            step = aimed if low < aimed < high else (0.5 * (low + high) if np.isfinite(high) else _GROWN * step)
            step = min(step, reach)
            if high - low < _CLOSE * low:
                break
        return self.x[i] + sign * (high if np.isfinite(high) else np.inf)

    def _inner(self, i: int, x: Array) -> tuple[Array, float]:
        """Return the coordinates, one of them held, at which the others fit best, and the sum of squares there."""
        from scipy.optimize import least_squares  # long to import, and only a fit comes here

        others = np.flatnonzero(np.arange(self.free.size) != i)
        low, high = self.free.low, self.free.high
        x = np.clip(x, low, high)

        def whole(y: Array) -> Array:
            full = x.copy()
            full[others] = y
            return full

        first = self.residuals(x)
        if not len(others) or not np.isfinite(first).all():
            return x, float(np.square(first).sum()) if np.isfinite(first).all() else np.inf
        beside, bounds = Forward(self.residuals, self.steps, self.free, others), (low[others], high[others])
        found = least_squares(
            lambda y: beside.residuals(whole(y)),
            x[others],
            jac=lambda y: beside.slopes(whole(y)),  # type: ignore[arg-type]
            bounds=bounds,  # type: ignore[arg-type]
            **_INNER,
        )
        return whole(found.x), 2.0 * float(found.cost)
