"""Which modes a record has: begun by a common denominator, completed from residuals, and none without evidence."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from boomctl.arrays import Array
from boomctl.identification.common_poles import CommonPoles, fitted, fixed_poles
from boomctl.identification.spectra import Spectra, complex_of
from boomctl.identification.start import Track, poles_by_order, tracks
from boomctl.lti.rounding import ALIKE

_ROUNDS = 30  # of looking for what was missed; two to six do
_ROUGH = 0.05  # of the evidence that a mode needs: steps that gain less do not change which modes have it (a choice)
_STEADY = 0.5  # of the orders at which a pole stands that the fit begins with (a choice)
_LEAST_SHARE = (
    3e-5  # of the response, half a percent of its size: less is taken for what the model does not explain (a choice)
)
_ABOVE = 1.25 * (-0.05 + 1.0j)  # times the highest frequency: where a mode above the band is begun (a choice)
_REACH = 6.0  # decay rates to either side of a resonance within which it is looked at (a choice)
_FEWEST = 12  # lines to either side at least: residues, background and errors are then told apart (a choice)
_MOST = 64  # lines to either side at most: of wider windows every second line and so on is left out (a choice)
_RATES = 4  # of decay, each four times the one before, from half the resolution on: the best one misses a ninth at most
_BESIDE = 0.1  # of the largest evidence: less may be what is left of it, and is looked at once more (a choice)
_STRAY = 8.0  # times the rate of decay tried: what is broader by its residuals is no mode (a choice)
_CHANCE = 1e-3  # chance that a record of noise alone has one mode in it (a choice)


def searched(data: Spectra, low: float, high: float, orders: tuple[int, ...]) -> tuple[CommonPoles, tuple[Track, ...]]:
    """Return the fit of all poles that have evidence, within the band and beside it, and how they stand over the orders."""
    found = tracks(poles_by_order(data, orders), data.resolution)
    begun = [track.pole for track in found if len(track.orders) >= _STEADY * len(orders)]
    most = max((len(data.s) - data.U.shape[1]) // (2 * (data.U.shape[1] + data.records)), 1)
    if not data.held or _ABOVE.imag * high * data.step < np.pi:  # held inputs tell of none above half their rate
        begun.append(_ABOVE * high)
    fit = CommonPoles(data, np.array(begun[:most], complex), fixed_poles(low, high))
    fit = _with_evidence(_weighted(_roughly(fit)))
    for _ in range(_ROUNDS):
        more = missed(fit)[: most - len(fit.poles)]
        if not len(more):
            break
        before, fit = len(fit.poles), _with_evidence(_weighted(_roughly(_with(fit, np.append(fit.poles, more)))))
        if len(fit.poles) <= before:
            break
    return _with_evidence(fitted(_weighted(_roughly(_needed_outside(fit)))), fitted), found


def weakest(fit: CommonPoles, inside: Array, count: int) -> Array:
    """Return a mark at so many of the poles marked, those of least evidence."""
    return np.isin(np.arange(len(inside)), np.argsort(np.where(inside, fit.evidence, np.inf))[:count])


def without(fit: CommonPoles, which: Array) -> CommonPoles:
    """Return the fit without some of its poles."""
    return fitted(_with(fit, np.delete(fit.poles, np.flatnonzero(which))))


def _with(fit: CommonPoles, poles: Array) -> CommonPoles:
    return CommonPoles(fit.data, poles, fit.fixed)


def _roughly(fit: CommonPoles) -> CommonPoles:
    """Return the fit whose poles are as good as it takes to see which of them have evidence."""
    return fitted(fit, _ROUGH * needed(fit))


def _weighted(fit: CommonPoles) -> CommonPoles:
    """Return the fit with each output in units of its own errors."""
    # of an output: smaller residuals are rounding, and no errors to weigh by
    scale = np.maximum(fit.deviation, ALIKE * np.sqrt(np.square(np.abs(fit.data.Y)).mean(axis=0)))
    return fit.scaled(scale)


def _with_evidence(fit: CommonPoles, refit: Callable[[CommonPoles], CommonPoles] = _roughly) -> CommonPoles:
    """Return the fit without the poles that lack evidence: the weaker half of them goes, then all are judged anew."""
    while len(fit.poles):
        evidence = np.where(fit.shares < _LEAST_SHARE, 0.0, fit.evidence)
        lacking = np.flatnonzero(evidence < needed(fit))
        if not len(lacking):
            break
        half = lacking[np.argsort(evidence[lacking])][: -(-len(lacking) // 2)]
        fit = refit(_with(fit, np.delete(fit.poles, half)))
    return fit


def _needed_outside(fit: CommonPoles) -> CommonPoles:
    """Return the fit without the pairs outside the band that it does as well without."""
    for pole in fit.fixed:
        bare = CommonPoles(fit.data, fit.poles, fit.fixed[fit.fixed != pole])
        if (bare.cost / max(fit.cost, np.finfo(float).tiny) - 1.0) * fit.freedom * fit.data.Y.shape[1] < needed(fit):
            fit = bare
    return fit


def needed(fit: CommonPoles) -> float:
    """Return the evidence that a mode needs: more than noise gives anywhere in the record (Laurent & Massart 2000)."""
    m, p = fit.data.U.shape[1], fit.data.Y.shape[1]
    freedom, rare = 2 * m * p + 2, np.log(len(fit.data.s) / _CHANCE)
    return float(freedom + 2.0 * np.sqrt(freedom * rare) + 2.0 * rare)


def missed(fit: CommonPoles) -> Array:
    """Return poles that residuals show [rad/s], each the best one of its neighbourhood, and as it fits best there alone."""
    data = replace(fit.data, Y=complex_of(fit.residuals) / np.sqrt(fit.errors))
    least = needed(fit)
    found: list[tuple[float, complex]] = []
    for k in range(_RATES):
        gains, poles = _tried(data, 0.5 * 4.0**k)
        found += [(gain, pole) for gain, pole in zip(gains, poles, strict=True) if gain > least]
    kept: list[complex] = []
    found.sort(key=lambda each: -each[0])
    for gain, pole in found:
        if gain > _BESIDE * found[0][0] and _apart(pole, kept):
            half = _side(data, -pole.real / data.resolution) * data.resolution
            around = data.within(pole.imag - half, pole.imag + half)
            best = fitted(CommonPoles(around, np.array([pole]), np.zeros(0)), _ROUGH * least).poles[0]
            best = complex(min(best.real, pole.real), best.imag)  # narrower ones hardly move when all are fitted
            if not _apart(best, [pole]) and best.real > _STRAY * pole.real and _apart(best, kept):
                kept.append(best)
    return np.array(kept, complex)


def _side(data: Spectra, rate: float) -> int:
    """Return how many lines to either side show a pole of a rate of decay, in lines: more than twice as many as columns."""
    return max(round(_REACH * rate), _FEWEST, 3 * data.U.shape[1] + 1)


def _apart(pole: complex, others: list[complex]) -> bool:
    """Return whether a pole's neighbourhood has none of the others'."""
    return all(abs(pole.imag - other.imag) > -3.0 * (pole.real + other.real) for other in others)


def _tried(data: Spectra, rate: float) -> tuple[Array, Array]:
    """Return what poles of a rate of decay, in lines, explain at each frequency, and the poles."""
    gains: dict[float, float] = {}
    for k in range(len(data.lines)):
        rows = np.flatnonzero(data.record == k)
        omega, U, E = data.s[rows].imag, data.U[rows], data.Y[rows]
        half = _side(data, rate)
        thin = -(-half // _MOST)
        side = thin * np.arange(-(half // thin), half // thin + 1)
        apart = max(round(rate), 1)
        centres = np.arange(half, len(omega) - half, apart)
        if not len(centres):
            continue
        at = centres[:, None] + side
        s = 1j * (omega[at] - omega[centres][:, None]) / data.resolution
        ground = np.concatenate([U[at], s[..., None] * U[at] / half, np.ones((*at.shape, 1))], axis=2)
        mode = U[at] / (s + rate)[..., None]
        rest = np.linalg.qr(np.concatenate([ground, mode], axis=2))[0][..., -U.shape[1] :]
        windows = sliding_window_view(E, side[-1] - side[0] + 1, axis=0)[at[0, 0] : at[-1, 0] + 1 : apart, :, ::thin]
        within = np.square(np.abs(windows @ rest.conj())).sum(axis=(1, 2))
        for centre, gain in zip(omega[centres], within, strict=True):
            gains[float(centre)] = gains.get(float(centre), 0.0) + float(gain)
    return np.array(list(gains.values())), -rate * data.resolution + 1j * np.array(list(gains))
