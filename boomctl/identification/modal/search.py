"""Modes in a record: a common denominator gives poles to start from, residuals give candidates, blocks decide."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import stats

from boomctl.arrays import Array
from boomctl.identification.modal.common_poles import CommonPoles, fitted, fixed_poles, root_of_inverse
from boomctl.identification.modal.jackknife import BLOCKS, deviations, left_out_errors
from boomctl.identification.modal.spectra import Spectra, complex_of
from boomctl.identification.modal.start import Track, poles_by_order, tracks
from boomctl.lti.rounding import ALIKE, SUMMED

_ORDERS = 11  # Number of orders, from half to the highest.
_ROUNDS = 2  # Rounds of candidates.
_CANDIDATES = 12  # Candidates of a round.
_FACTOR = 2.0  # Largest factor of the 95 % interval of a damping ratio.
_FACTOR_NEAR = 1.6  # The same of a mode within a wider resonance, where errors of the model look like modes.
_HALF_WIDTHS = 1.0  # Largest 95 % interval of a frequency [half-power half widths].
_CLEAR = 0.1  # Half widths of intervals by the errors around, below which a pole is determined.
_QUANTILE = float(stats.t.ppf(0.975, BLOCKS - 1))
MOST_DAMPED = 0.6  # Largest damping ratio of a mode.
_NEIGHBOR = 3.0  # Half widths within which a candidate must pass a test of the joint fit.
_ROUGHLY = 4.0  # Factor of the limits of intervals for such a candidate: the fit of all poles determines more.
_LEFT_OUT = 0.7  # Least fall of the left-out error over the fall of the fit's error for such a candidate.
_SIGNIFICANT = 2.0  # Standard errors by which the left-out error must fall for an additional term.
_LEAST_FALL = 0.05  # Least fall of the logarithm of the left-out error for a pair of poles outside the band.
_LEAST_FALL_OF_RIGID_BODY = 0.1  # The same for integrators and real poles.
# Frequencies of pairs outside the band over its upper end, and of its lower end over theirs; with two of them 91 % of the
# intervals cover, where 95 % are stated.
_OUTSIDE = np.array([1.1, 1.25, 1.5, 2.0])
_OUTSIDE_POLE = -0.05 + 1.0j  # Such a pole over its frequency.
_REAL_POLES = 2  # Largest number of real poles.
_RATES_OF_REAL_POLES = 5  # Rates of candidates, from the slowest to the highest frequency.
_SLOWEST = 0.3  # Rate of a real pole over the slowest that the data show, below which it is an integrator.
# Fall of the cost that does not change whether there are two poles, which come together in many small steps.
_SLIGHT = 1.0
_ROUGH = 0.05  # Fall of the cost, over the evidence of a mode, below which steps do not change which modes have it.
_STEADY = 0.5  # Fraction of the orders at which a pole is stable if the fit starts from it.
_LESS_STEADY = 0.2  # The same where that fit finds no pole.
_REACH = 6.0  # Half widths to either side of a resonance in its window.
_FEWEST = 12  # Lines to either side at least.
_MOST = 64  # Lines to either side at most; of wider windows some lines are left out.
_RATES = 4  # Decay rates of candidates, each four times the previous one, from half the resolution.
_LEAST_EVIDENCE = 0.1  # Least evidence of a candidate over the largest one.
_CHANCE = 1e-3  # Probability that a record of noise has one mode in it.


@dataclass(frozen=True)
class Band:
    """Frequencies of the modes that are sought [rad/s], and the numbers of integrators that there may be, ascending."""

    low: float
    high: float
    integrators: tuple[int, ...]

    def modes(self, poles: Array) -> Array:
        """Return which poles are modes of the band."""
        return (poles.imag > 0.0) & (poles.imag >= self.low) & (poles.imag <= self.high)


def search_poles(
    data: Spectra, band: Band, highest: int
) -> tuple[CommonPoles, Array, tuple[Track, ...], dict[int, Array]]:
    """Search the poles of a record within a band, and outside it where the left-out error falls.

    Returns the fit, those of its poles that may be two, and the poles of common denominators that are alike at several
    orders, up to the highest, and at each order.
    """
    highest = min(highest, len(data.lines[0]) // (2 * data.U.shape[1] + 2))
    orders = tuple(sorted({round(order) for order in np.linspace(max(highest // 2, 2), highest, _ORDERS)}))
    by_order = poles_by_order(data, orders)
    chains, fit, unresolved = tracks(by_order, data.resolution), None, np.zeros(0, complex)
    for least in (_STEADY, _LESS_STEADY):
        if fit is None or not len(fit.poles):
            poles = [track.pole for track in chains if len(track.orders) >= least * len(orders)]
            poles = np.array(poles[: most_poles(data)], complex)
            start = CommonPoles(data, poles, np.zeros(0, complex), band.integrators[0])
            fit, unresolved = refine(with_background(_weighted(start), band), band)
    return settled(with_background(_weighted(fit), band), band), unresolved, chains, by_order


def refine(fit: CommonPoles, band: Band) -> tuple[CommonPoles, Array]:
    """Fit the poles, remove those that are not determined, and add candidates from the residuals.

    Returns the fit, and those of its poles that may be two.
    """
    fit, unresolved = pruned(_with_evidence(_roughly(fit)), band), np.zeros(0, complex)
    for _ in range(_ROUNDS):
        more, marked = candidates(fit)
        more, unresolved = more[: max(most_poles(fit.data) - len(fit.poles), 0)], fit.poles[marked]
        if not len(more):
            break
        joined = _roughly(_with(fit, np.append(fit.poles, more)))
        retained = np.arange(len(joined.poles)) < len(fit.poles)
        retained |= _is_determined(joined) & (joined.evidence > needed(joined))
        if retained.sum() == len(fit.poles):
            break
        joined = pruned(_with_evidence(_roughly(_with(joined, joined.poles[retained]))), band)
        if len(joined.poles) <= len(fit.poles):
            break
        fit = joined
    return fit, unresolved


def settled(fit: CommonPoles, band: Band) -> CommonPoles:
    """Return the fit at its minimum, without poles that are not determined; modes by frequency, then other poles."""
    order = np.argsort(np.where(band.modes(fit.poles), fit.poles.imag, np.inf), kind="stable")
    fit = fit if (np.diff(order) > 0).all() else _with(fit, fit.poles[order])
    return pruned(fitted(_weighted(_roughly(fit))), band)


def most_poles(data: Spectra) -> int:
    """Return the largest number of poles that the lines of a record can determine."""
    return max((len(data.s) - data.U.shape[1]) // (2 * (data.U.shape[1] + data.records)), 1)


def with_background(fit: CommonPoles, band: Band) -> CommonPoles:
    """Add what is no mode of the band while the left-out error falls: a rigid body, a real pole, pairs outside the band."""
    if fit.integrators > band.integrators[0]:
        fewer = _roughly(replace(fit, integrators=fit.integrators - 1))
        fit = fit if _falls(left_out_errors(fewer), left_out_errors(fit)) else fewer
    fit = _with_rigid_body(fit, band)
    errors, fixed = left_out_errors(fit), _shown(fit.data, fixed_poles(band.low, band.high))
    while len(fixed := np.setdiff1d(fixed, fit.fixed)):
        more = replace(fit, fixed=np.append(fit.fixed, _strongest(fit, fixed)))
        after = left_out_errors(more)
        if not _falls(errors, after, _LEAST_FALL):
            break
        fit, errors = more, after
    return fit


def unbiased(fit: CommonPoles, band: Band) -> CommonPoles:
    """Return the fit of a record with more pairs outside the band, if its left-out error falls and no mode leaves the band.

    Strong modes just outside the band then do not move the poles.  A system does not need so many states for them.
    """
    omega = np.append(_OUTSIDE * band.high, band.low / _OUTSIDE if band.low > 0.0 else [])
    fixed = _shown(fit.data, omega * _OUTSIDE_POLE)
    if not fit.data.lengths or most_poles(fit.data) < len(fit.poles) + len(fixed):
        return fit
    more = fitted(replace(fit, fixed=np.append(fit.fixed, fixed)))
    stay = (band.modes(more.poles) == band.modes(fit.poles)).all()
    return more if stay and _falls(left_out_errors(fit), left_out_errors(more), 0.0) else fit


def _shown(data: Spectra, poles: Array) -> Array:
    """Return the poles that sampled data show: with inputs held between samples, those below half the sampling rate."""
    return poles[np.abs(poles) * data.step <= np.pi] if data.held else poles


def _with_rigid_body(fit: CommonPoles, band: Band) -> CommonPoles:
    """Add integrators and real poles, the fewest that lower the left-out error as far."""
    present = int((fit.poles.imag == 0.0).sum())
    counts = [count for count in band.integrators if count >= fit.integrators]
    options = [(count, more) for count in counts for more in range(_REAL_POLES + 1 - present)]
    options = [(count, more) for count, more in options if not (count == 2 and present + more)]
    base = errors = left_out_errors(fit)
    best = fit
    for count, more in sorted({*options} - {(fit.integrators, 0)}, key=lambda option: (sum(option), option)):
        trial = replace(fit, integrators=count)
        for _ in range(more):
            trial = _with_real_pole(trial)
        if not _falls(base, left_out_errors(trial)):
            continue
        trial = _roughly(trial)
        slow = (trial.poles.imag == 0.0) & (-trial.poles.real < _SLOWEST * _slowest(fit.data))
        if slow.any():
            trial = _roughly(_without_real_pole(trial, slow, band))
        after = left_out_errors(trial)
        if _falls(errors, after):
            best, errors = trial, after
    return best


def _with_real_pole(fit: CommonPoles) -> CommonPoles:
    """Add the real pole, of several rates, whose responses explain most of the residuals."""
    poles = -np.geomspace(_slowest(fit.data), fit.data.top, _RATES_OF_REAL_POLES).astype(complex)
    return _with(fit, np.append(fit.poles, _strongest(fit, poles)))


def _strongest(fit: CommonPoles, poles: Array) -> complex:
    """Return the pole whose responses explain most of the residuals."""
    rows, basis = fit.data.rows(fit.data.simple(poles), fit.data.simple(poles.conj()), derived=False), fit.basis
    rows, gains = (rows - (rows @ basis) @ basis.T).reshape(len(poles), -1, len(basis)), []
    for own in rows:
        gains.append(np.square(root_of_inverse(own @ own.T).T @ (own @ fit.residuals)).sum())
    return complex(poles[int(np.argmax(gains))])


def _slowest(data: Spectra) -> float:
    """Return the slowest rate that the data show [rad/s]: one line, of unequally spaced ones the first."""
    return min(data.resolution, float(np.abs(data.s).min()))


def _without_real_pole(fit: CommonPoles, which: Array, band: Band) -> CommonPoles:
    """Return the fit without the slowest of some real poles, or with an integrator for it if the left-out error falls."""
    k = int(np.argmax(np.where(which, fit.poles.real, -np.inf)))
    bare = _with(fit, np.delete(fit.poles, k))
    slow = -fit.poles[k].real < np.sqrt(_slowest(fit.data) * fit.data.top)
    if slow and fit.integrators < max(band.integrators):
        more = replace(bare, integrators=fit.integrators + 1)
        return more if _falls(left_out_errors(bare), left_out_errors(more)) else bare
    return bare


def _falls(before: Array, after: Array, least: float = _LEAST_FALL_OF_RIGID_BODY) -> bool:
    """Return whether the left-out errors of blocks fall by a factor, and by more than chance."""
    fall = np.log(np.maximum(before, np.finfo(float).tiny)) - np.log(np.maximum(after, np.finfo(float).tiny))
    error = fall.std(ddof=1) / np.sqrt(len(fall))
    return bool(fall.mean() > max(_SIGNIFICANT * error, least))


def pruned(fit: CommonPoles, band: Band) -> CommonPoles:
    """Remove poles within the band whose damping ratio or frequency the record does not determine."""
    while len(fit.poles):
        steps = _half_widths(fit)
        real = fit.poles.imag == 0.0
        undetermined = real & ((steps[:, 0] > np.log(_FACTOR)) | (-fit.poles.real > fit.data.top))
        if undetermined.any():
            fit = _roughly(_without_real_pole(fit, undetermined, band))
            continue
        overdamped = ~real & (-fit.poles.real > MOST_DAMPED * np.abs(fit.poles))
        outside = overdamped | ~(real | band.modes(fit.poles))
        if outside.any():
            slow = -np.abs(fit.poles[overdamped])[: _REAL_POLES - real.sum()]
            fit = _roughly(_with(fit, np.append(fit.poles[~outside], slow)))
            continue
        distance = np.abs(fit.poles.imag[:, None] - fit.poles.imag)
        wider = fit.poles.real[:, None] > fit.poles.real
        factor = np.where((wider & (distance < _NEIGHBOR * -fit.poles.real)).any(axis=1), _FACTOR_NEAR, _FACTOR)
        vague = ~real & ((steps[:, 0] > np.log(factor)) | (steps[:, 1] > _HALF_WIDTHS))
        if not vague.any():
            break
        fit = _roughly(_with(fit, np.delete(fit.poles, np.flatnonzero(weakest(fit, vague, max(vague.sum() // 3, 1))))))
    return fit


def weakest(fit: CommonPoles, inside: Array, count: int) -> Array:
    """Return a mark at so many of the poles marked, those of least evidence."""
    return np.isin(np.arange(len(inside)), np.argsort(np.where(inside, fit.evidence, np.inf))[:count])


def without(fit: CommonPoles, which: Array) -> CommonPoles:
    """Return the fit without some of its poles."""
    return fitted(_with(fit, np.delete(fit.poles, np.flatnonzero(which))))


def _with(fit: CommonPoles, poles: Array) -> CommonPoles:
    return replace(fit, poles=poles)


def _roughly(fit: CommonPoles) -> CommonPoles:
    """Return the fit whose poles are as good as it takes to see which of them have evidence."""
    return fitted(fit, _ROUGH * needed(fit))


def _weighted(fit: CommonPoles) -> CommonPoles:
    """Return the fit with each output in units of its own errors."""
    # of an output: smaller residuals are rounding, and no errors to weigh by
    scale = np.maximum(fit.deviation, ALIKE * np.sqrt(np.square(np.abs(fit.data.Y)).mean(axis=0)))
    return fit.scaled(scale)


def _with_evidence(fit: CommonPoles) -> CommonPoles:
    """Remove the poles without evidence: the weaker half first, then all are evaluated again."""
    while len(fit.poles):
        evidence = fit.evidence
        lacking = np.flatnonzero(evidence < needed(fit))
        if not len(lacking):
            break
        half = lacking[np.argsort(evidence[lacking])][: -(-len(lacking) // 2)]
        fit = _roughly(_with(fit, np.delete(fit.poles, half)))
    return fit


def needed(fit: CommonPoles) -> float:
    """Return the evidence that a mode needs: more than noise gives anywhere in the record (Laurent & Massart 2000)."""
    m, p = fit.data.U.shape[1], fit.data.Y.shape[1]
    dof, rare = 2 * m * p + 2, np.log(len(fit.data.s) / _CHANCE)
    return float(dof + 2.0 * np.sqrt(dof * rare) + 2.0 * rare)


def _in_residuals(fit: CommonPoles) -> tuple[Spectra, list[tuple[float, complex]]]:
    """Return the residuals in units of their errors, and poles with evidence in them, by evidence."""
    data, least = replace(fit.data, Y=complex_of(fit.residuals) / np.sqrt(fit.errors)), needed(fit)
    result: list[tuple[float, complex]] = []
    for k in range(_RATES):
        gains, poles = _candidate_gains(data, 0.5 * 4.0**k)
        result += [(gain, pole) for gain, pole in zip(gains, poles, strict=True) if gain > least]
    return data, sorted(result, key=lambda entry: -entry[0])


def candidates(fit: CommonPoles) -> tuple[Array, Array]:
    """Find poles in the residuals [rad/s] that are determined in a window of their own.

    If one pole is not determined, two are tested: close modes of which neither is determined alone.

    Returns
    -------
    poles : ndarray
        New poles, separate from those of the fit or close to one of them.
    unresolved : (k,) ndarray of bool
        Poles of the fit with another one nearby, by the left-out error.
    """
    data, result = _in_residuals(fit)
    least = needed(fit)
    chosen: list[complex] = []
    tested: list[complex] = []
    starts: dict[int, complex] = {}
    for gain, pole in result:
        if gain <= _LEAST_EVIDENCE * result[0][0] or len(tested) >= _CANDIDATES:
            break
        near = np.flatnonzero(
            np.abs(fit.poles.imag - pole.imag) < _NEIGHBOR * np.maximum(-fit.poles.real, data.resolution)
        )
        if len(near):
            closest = int(near[np.argmin(np.abs(fit.poles[near] - pole))])
            starts.setdefault(closest, pole)
            continue
        if not _is_separate(pole, tested):
            continue
        tested.append(pole)
        half = _side(data, -pole.real / data.resolution) * data.resolution
        around = data.within(pole.imag - half, pole.imag + half)
        local = fitted(CommonPoles(around, np.array([pole]), np.zeros(0)), _ROUGH * least)
        if not _is_determined(local).all():
            local = _two_poles(local, 0, pole)
        if local is None or not _is_determined(local).all():
            continue
        best = [complex(min(one.real, pole.real), one.imag) for one in local.poles]
        chosen += best if all(_is_separate(one, chosen) for one in best) else []
    unresolved = np.zeros(len(fit.poles), bool)
    for k, pole in starts.items():
        two = _two_poles(fit, k, pole)
        if two is not None:
            unresolved[k] = True
            second = two.poles[np.argmax(np.abs(two.poles - fit.poles[k]))]
            chosen += [complex(second)] if _is_determined(two, _ROUGHLY).all() else []
    return np.array(chosen, complex), unresolved


def _is_determined(fit: CommonPoles, slack: float = 1.0) -> Array:
    """Return which poles have a damping ratio and a frequency that blocks determine."""
    decay, frequency = _half_widths(fit).T
    return (decay <= slack * np.log(_FACTOR)) & (frequency <= slack * _HALF_WIDTHS)


def _half_widths(fit: CommonPoles) -> Array:
    """Return half widths of the 95 % intervals of the poles, as `deviations`; by the errors around each if small."""
    curvature = fit.normal_equations[0]
    size = np.sqrt(np.maximum(np.diagonal(curvature), 0.0))
    free, size = size > 0.0, np.where(size > 0.0, size, 1.0)
    inverse = np.linalg.inv(curvature / size / size[:, None] + np.diag(~free) + SUMMED * np.eye(len(size)))
    variances = (free * np.abs(np.diagonal(inverse)) / np.square(size)).reshape(-1, 2)
    steps = _QUANTILE * np.sqrt(variances * fit.errors_around.max(axis=1)[:, None])
    return steps if (steps < _CLEAR).all() else _QUANTILE * deviations(fit)


def _two_poles(fit: CommonPoles, k: int, start: complex) -> CommonPoles | None:
    """Return the fit of two poles to what the others leave in a window, None if one pole describes it as well.

    The left-out error must fall by most of what the error of the fit falls.  Within one line of a frequency response two
    poles cannot be distinguished from a distorted peak.
    """
    pole, resolution = fit.poles[k], fit.data.resolution
    split = 1j * max(-pole.real, 0.5 * resolution)
    starts = [start, pole + split, pole - split]
    far = max(_NEIGHBOR * -pole.real, *(abs(second.imag - pole.imag) for second in starts))
    half = far + _side(fit.data, max(-pole.real / resolution, 1.0)) * resolution
    window = fit.alone(k, pole.imag - half, pole.imag + half)
    one = fitted(CommonPoles(window, np.array([pole]), np.zeros(0)), _SLIGHT)
    trials = (CommonPoles(window, np.array([pole, second]), np.zeros(0)) for second in starts)
    two = fitted(min(trials, key=lambda trial: trial.cost), _SLIGHT)
    fall = left_out_errors(one) - left_out_errors(two)
    error = fall.std(ddof=1) * np.sqrt(len(fall))
    distance = np.abs(np.diff(two.poles.imag)[0])
    if fall.sum() < max(_LEFT_OUT * (one.cost - two.cost), _SIGNIFICANT * error):
        return None
    if not fit.data.lengths and distance < resolution:
        return None
    return two


def _side(data: Spectra, rate: float) -> int:
    """Return how many lines to either side show a pole of a rate of decay, in lines: more than twice as many as columns."""
    return max(round(_REACH * rate), _FEWEST, 3 * data.U.shape[1] + 1)


def _is_separate(pole: complex, others: list[complex]) -> bool:
    """Return whether a pole's neighborhood has none of the others'."""
    return all(abs(pole.imag - other.imag) > -3.0 * (pole.real + other.real) for other in others)


def _candidate_gains(data: Spectra, rate: float) -> tuple[Array, Array]:
    """Return what poles of a rate of decay, in lines, explain at each frequency, and the poles."""
    gains: dict[float, float] = {}
    for k in range(len(data.lines)):
        rows = np.flatnonzero(data.record == k)
        omega, U, E = data.s[rows].imag, data.U[rows], data.Y[rows]
        half = _side(data, rate)
        thin = -(-half // _MOST)
        side = thin * np.arange(-(half // thin), half // thin + 1)
        spacing = max(round(rate), 1)
        centers = np.arange(half, len(omega) - half, spacing)
        if not len(centers):
            continue
        at = centers[:, None] + side
        s = 1j * (omega[at] - omega[centers][:, None]) / data.resolution
        near = U[at]
        ground = [near, s[..., None] * near / half, np.ones((*at.shape, 1))]
        columns = np.concatenate([*ground, near / (s + rate)[..., None]], axis=2)
        products = columns.conj().swapaxes(1, 2) @ columns
        size = np.sqrt(np.diagonal(products, axis1=1, axis2=2).real)[..., None]
        size[size == 0.0] = 1.0
        one = np.eye(products.shape[1])
        root = np.linalg.cholesky(products / size / size.swapaxes(1, 2) + SUMMED * one).conj().swapaxes(1, 2)
        rest = columns @ (np.linalg.solve(root, one[:, -U.shape[1] :]) / size)
        windows = sliding_window_view(E, side[-1] - side[0] + 1, axis=0)[at[0, 0] : at[-1, 0] + 1 : spacing, :, ::thin]
        within = np.square(np.abs(windows @ rest.conj())).sum(axis=(1, 2))
        for center, gain in zip(omega[centers], within, strict=True):
            gains[float(center)] = gains.get(float(center), 0.0) + float(gain)
    return np.array(list(gains.values())), -rate * data.resolution + 1j * np.array(list(gains))
