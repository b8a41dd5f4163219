"""Checks of a fit that do not use its solver: adequacy of the model, minimum, agreement of starts."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import special

from boomctl.arrays import Array
from boomctl.identification.free import FreeParameters
from boomctl.identification.identifiability import STEP, IdentifiedSubspace
from boomctl.lti.rounding import LEVEL, ROOT
from boomctl.printing import count, sentence

_STEP = 0.1  # standard errors between the values of the sum of squares that are compared
_MAX_STEP = 1.0  # Largest step of a coordinate (a factor of e), along weakly identifiable combinations.
_MAX_OFFSET = 0.05  # standard errors from the minimum of the parabola: intervals change by less than 1 %
_UNIDENTIFIABLE_STEP = 0.01  # coordinate step along combinations that are not identifiable
_SIGNIFICANCE = 0.01  # p-value below which residuals are larger than the errors
_MAX_CHI_SQUARE = 2.0  # reduced chi-square with deviations that are estimates: half of it is model error


@dataclass(frozen=True)
class FitCertificate:
    """Checks of a fit that do not use its solver.

    Attributes
    ----------
    distance_to_minimum : float
        Largest distance to the minimum of a parabola through the sum of squares along the identifiable combinations, in
        standard errors.
    is_minimum : bool
        Whether the sum of squares rises to both sides, does not fall along the other combinations, and
        ``distance_to_minimum`` is below 0.05.
    n_starts, n_agreeing_starts : int
        Number of starts, and of those that ended at this fit.
    alternatives : tuple of dict
        Other parameters, from other starts, that fit within the confidence limit too.
    at_bounds : tuple of str
        Parameters at an end of their range: the best fit lies beyond.
    residual_percent : float
        Norm of the residuals in percent of the norm of the measured values, both weighted; with relative errors the
        root mean square of the relative residuals.  100 less the fit percent of an uncentered fit.
    residual_ratio : float
        Residuals over the size of the errors: the root of the reduced chi-square.  The errors are known from
        ``error_std``, from the difference of data sets or from the deviations of a measured response; ``nan`` where
        none of them is.
    ndata : int
        Number of measured values, real and imaginary parts counted separately.  Chi-square treats their errors as
        independent, also at neighboring frequencies; if they are correlated, it scatters as that of fewer values.
    errors_grow : bool
        Whether residuals that are fitted as absolute grow with the response, as relative errors do.
    p_value : float
        p-value of the residuals if the model is right: of chi-square with ``error_std``, of the F test for lack of fit
        with data sets; ``nan`` otherwise.
    """

    distance_to_minimum: float
    is_minimum: bool
    n_starts: int
    n_agreeing_starts: int
    alternatives: tuple[dict[str, float], ...]
    at_bounds: tuple[str, ...]
    residual_percent: float
    residual_ratio: float
    p_value: float
    ndata: int
    errors_grow: bool

    @property
    def certified(self) -> bool:
        """True if this is a minimum within the ranges, and no other start fits about as well.

        A certified minimum may belong to a wrong model: see ``adequacy``.
        """
        return self.is_minimum and not self.alternatives and not self.at_bounds

    @property
    def fit_adequate(self) -> bool:
        """True if the residuals are consistent with the errors, or the errors are unknown."""
        return not (
            self.p_value < _SIGNIFICANCE or (np.isnan(self.p_value) and self.residual_ratio**2 > _MAX_CHI_SQUARE)
        )

    @property
    def adequacy(self) -> str:
        """Residual in percent of the data, and reduced chi-square where the errors are known."""
        text = f"weighted residual {self.residual_percent:.2g} %"
        if self.errors_grow:
            text += "; errors grow with the response: use error_model='relative'"
        if np.isnan(self.residual_ratio):
            return text
        verdict = "" if self.fit_adequate else " (model inadequate)"
        text += f", reduced chi-square {self.residual_ratio**2:.2g}{verdict}"
        return f"{text} ({self.ndata:,} {'value' if self.ndata == 1 else 'values'}, correlation neglected)"

    @property
    def summary(self) -> str:
        """Adequacy of the model, then the checks of the minimum."""
        return f"{self.adequacy}; {self.checks}"

    @property
    def checks(self) -> str:
        """Checks of the minimum."""
        parts = ["minimum not certified: not a minimum of the sum of squares"]
        if self.is_minimum:
            offset = f"{self.distance_to_minimum:.2g} standard errors"
            parts = [
                f"minimum certified, at most {offset} away"
                if self.certified
                else f"minimum not certified, {offset} away"
            ]
        parts.append(f"reached from {self.n_agreeing_starts} of {count(self.n_starts, 'start')}")
        if self.alternatives:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in self.alternatives[0].items())
            parts.append(f"other parameters fit within the confidence limit too, such as {values}")
        if self.at_bounds:
            bounds = "its bound" if len(self.at_bounds) == 1 else "their bounds"
            parts.append(f"{', '.join(self.at_bounds)} at {bounds}: a wider range fits better")
        if not self.fit_adequate:
            parts.append("intervals invalid: model inadequate")
        return "; ".join(parts)

    def __repr__(self) -> str:
        return sentence("FitCertificate", self.summary)


def lack_of_fit(cost: float, dof: int, variance: float, known: float) -> tuple[float, float]:
    """Compute the root of the reduced chi-square and its p-value, for errors of a variance with ``known`` dof.

    With finite dof (replicates), the F test for lack of fit.  Source: Draper & Smith (1998), section 2.1.
    """
    if not dof > 0 or np.isnan(variance):
        return float("nan"), float("nan")
    excess = float(np.sqrt(cost / dof / variance))
    if np.isinf(known):
        return excess, float(special.chdtrc(dof, cost / variance))
    left = dof - known
    ratio = max(cost - known * variance, 0.0) / left / variance if left > 0.0 else 0.0
    return excess, float(special.fdtrc(left, known, ratio)) if left > 0.0 else float("nan")


def minimum(
    residuals: Callable[[Array], Array], free: FreeParameters, x: Array, identified: IdentifiedSubspace, size: float
) -> tuple[float, bool]:
    """Return how far from a minimum the fit is, in standard errors, and whether it is one, from sums of squares alone."""

    def cost(at: Array) -> float:
        result = residuals(np.clip(at, free.low, free.high))
        return float(np.square(result).sum()) if np.isfinite(result).all() else np.inf

    here, offset, rises = cost(x), 0.0, True
    for k, direction in enumerate(identified.directions):
        value = identified.values[k]
        step = min(max(_STEP * size / value, STEP), _MAX_STEP) if value > 0.0 else _UNIDENTIFIABLE_STEP
        before, after = cost(x - step * direction), cost(x + step * direction)
        if value == 0.0:
            rises &= min(before, after) >= here * (1.0 - LEVEL)
            continue
        curvature = before + after - 2.0 * here
        if not np.isfinite(curvature) or curvature <= 0.0:
            rises = False
            continue
        away = 0.5 * abs(after - before) / curvature * step  # of a coordinate
        if away > ROOT:
            offset = max(offset, away * value / size)
    return offset, rises and offset < _MAX_OFFSET
