"""What is found about a fit apart from its solver: is it a minimum, do several starts agree, does it explain the data."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.identification.free import FreeParameters
from boomctl.identification.identifiability import Seen
from boomctl.printing import count, sentence

_SHARE = 0.1  # of a standard error: how far the sum of squares is asked to either side (a choice)
_LEAST = 1e-5  # of a coordinate, where that is less: the sum of squares then changes by more than its rounding
_AT_MINIMUM = 0.05  # standard errors from the parabola's minimum: intervals change by a few parts in a thousand
_EXACT = 1e-7  # of a coordinate: so near is near enough where the measurements have hardly any errors
_FALLS = 1e-6  # share by which the sum of squares may fall along what is not seen: rounding
_UNSEEN = 0.01  # of a coordinate, how far what is not seen is tried (a choice)
_UNLIKELY = 0.01  # chance below which residuals larger than the deviation given are said not to be chance (a choice)


@dataclass(frozen=True)
class FitCertificate:
    """What was found about a fit apart from its solver.

    Attributes
    ----------
    offset : float
        Largest distance to the minimum of a parabola through the sum of squares, computed anew to either side along each
        combination that is seen, in standard errors.
    minimum : bool
        Whether the sum of squares rises to either side, does not fall along what is not seen, and ``offset`` is small.
    starts, agreeing : int
        How many starts were tried, and how many of them came to this fit.
    rivals : tuple of dict
        Other parameters, from other starts, that fit within the confidence limit too.
    at_end : tuple of str
        Parameters at an end of their range: the best fit lies beyond.
    paired : bool
        Whether each measured eigenfrequency is still the nearest in order.
    chance : float
        Chance of residuals as large as these, if the model is right and the deviation given is true; ``nan`` where it
        was estimated.
    excess : float
        Size of the residuals over the deviation given; ``nan`` where it was estimated.
    """

    offset: float
    minimum: bool
    starts: int
    agreeing: int
    rivals: tuple[dict[str, float], ...]
    at_end: tuple[str, ...]
    paired: bool
    chance: float
    excess: float

    @property
    def certified(self) -> bool:
        """Whether this is a minimum within the ranges, its pairing stands, and no other start fits about as well."""
        return self.minimum and self.paired and not self.rivals and not self.at_end

    @property
    def explained(self) -> bool:
        """Whether the residuals may be chance; True where the size of the errors was estimated from them."""
        return not self.chance < _UNLIKELY

    @property
    def statement(self) -> str:
        """What was found, in words."""
        parts = ["a minimum" if self.minimum else "NOT shown to be a minimum"]
        parts[0] += f", to {self.offset:.2g} standard errors" if np.isfinite(self.offset) else ""
        parts.append(f"{self.agreeing} of {count(self.starts, 'start')} came to it")
        if self.rivals:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in self.rivals[0].items())
            parts.append(f"other parameters fit within the confidence limit too, such as {values}")
        if self.at_end:
            parts.append(f"{', '.join(self.at_end)} at an end of the range: the best fit lies beyond")
        if not self.paired:
            parts.append("another pairing of the modes is nearer")
        if not self.explained:
            parts.append(
                f"the residuals are {self.excess:.3g} times as large as the deviation given: the model does not explain what"
                " was measured, and its intervals are those of a wrong model"
            )
        return "; ".join(parts)

    def __repr__(self) -> str:
        return sentence("FitCertificate", f"{'certified' if self.certified else 'NOT certified'}; {self.statement}")


def minimum(
    residuals: Callable[[Array], Array], free: FreeParameters, x: Array, seen: Seen, size: float
) -> tuple[float, bool]:
    """Return how far from a minimum the fit is, in standard errors, and whether it is one, from sums of squares alone."""

    def cost(at: Array) -> float:
        found = residuals(np.clip(at, free.low, free.high))
        return float(np.square(found).sum()) if np.isfinite(found).all() else np.inf

    here, offset, rises = cost(x), 0.0, True
    for k, direction in enumerate(seen.directions):
        value = seen.values[k]
        step = max(_SHARE * size / value, _LEAST) if value > 0.0 else _UNSEEN
        before, after = cost(x - step * direction), cost(x + step * direction)
        if value == 0.0:
            rises &= min(before, after) >= here * (1.0 - _FALLS)
            continue
        curvature = before + after - 2.0 * here
        if not np.isfinite(curvature) or curvature <= 0.0:
            rises = False
            continue
        away = 0.5 * abs(after - before) / curvature * step  # of a coordinate
        if away > _EXACT:
            offset = max(offset, away * value / size)
    return offset, rises and offset < _AT_MINIMUM
