"""Which modes a record has: begun by a common denominator, completed from residuals, and none without evidence."""

import numpy as np

from boomctl.arrays import Array
from boomctl.identification.common_poles import CommonPoles, fitted, fixed_poles
from boomctl.identification.missed import missed, needed
from boomctl.identification.spectra import Spectra
from boomctl.identification.start import Track, poles_by_order, tracks
from boomctl.lti.rounding import ALIKE

_ROUNDS = 30  # of looking for what was missed; two to six do
_ROUGH = 15  # steps of a fit whose modes are not yet the last ones (a choice)
_STEADY = 0.5  # of the orders at which a pole stands that the fit begins with (a choice)
_LEAST_SHARE = (
    3e-5  # of the response, half a percent of its size: less is taken for what the model does not explain (a choice)
)


def searched(data: Spectra, low: float, high: float, orders: tuple[int, ...]) -> tuple[CommonPoles, tuple[Track, ...]]:
    """Return the fit of all poles that have evidence, within the band and beside it, and how they stand over the orders."""
    found = tracks(poles_by_order(data, orders), data.resolution)
    begun = [track.pole for track in found if len(track.orders) >= _STEADY * len(orders)]
    most = max((len(data.s) - data.U.shape[1]) // (2 * (data.U.shape[1] + data.records)), 1)
    fit = CommonPoles(data, np.array(begun[:most], complex), fixed_poles(low, high))
    for _ in range(_ROUNDS):
        fit = _weighted(fitted(fit, _ROUGH))
        kept = _with_evidence(fit)
        more = missed(kept)[: most - len(kept.poles)]
        if not len(more):
            break
        tried = _with_evidence(_weighted(fitted(_with(kept, np.append(kept.poles, more)), _ROUGH)))
        fit = tried
        if len(tried.poles) <= len(kept.poles):
            break
    return _with_evidence(fitted(_weighted(fitted(fit)))), found


def strongest(fit: CommonPoles, inside: Array, count: int) -> CommonPoles:
    """Return the fit with so many of the poles marked, those of most evidence."""
    chosen = np.flatnonzero(inside)
    weakest = chosen[np.argsort(fit.evidence[chosen])][: len(chosen) - count]
    return fitted(_with(fit, np.delete(fit.poles, weakest)))


def _with(fit: CommonPoles, poles: Array) -> CommonPoles:
    return CommonPoles(fit.data, poles, fit.fixed)


def _weighted(fit: CommonPoles) -> CommonPoles:
    """Return the fit with each output in units of its own errors."""
    # of an output: smaller residuals are rounding, and no errors to weigh by
    scale = np.maximum(fit.deviation, ALIKE * np.sqrt(np.square(np.abs(fit.data.Y)).mean(axis=0)))
    return CommonPoles(fit.data.scaled(scale), fit.poles, fit.fixed)


def _with_evidence(fit: CommonPoles) -> CommonPoles:
    """Return the fit without the poles that lack evidence: the weaker half of them goes, then all are judged anew."""
    while len(fit.poles):
        evidence = np.where(fit.shares < _LEAST_SHARE, 0.0, fit.evidence)
        lacking = np.flatnonzero(evidence < needed(fit))
        if not len(lacking):
            break
        weakest = lacking[np.argsort(evidence[lacking])][: -(-len(lacking) // 2)]
        fit = fitted(_with(fit, np.delete(fit.poles, weakest)), _ROUGH)
    return fit
