"""Linear systems: norms, modes and reductions over damping, clusters, spreads, scales and kinds of numbers."""

import warnings
from math import comb, inf, isfinite, sqrt

import mpmath as mp
import numpy as np
import pytest
from scipy import linalg, signal

from boomctl.analysis.h2 import h2_norm
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.modes import mode_table
from boomctl.analysis.sigma import sigma
from boomctl.lti.system import of
from boomctl.reduction.reduce import reduce
from boomctl.structure.model import SecondOrderModel
from tests.stress.cases import EPS, mass_on_spring, named, oscillator, over, over_each, repeated_pole
from tests.stress.references import DIGITS, state_space_gain

LIMITS = {"peak": 1.1e-5, "H2": 1.1e-6}  # what verified norms promise, with a tenth for their own rounding
DAMPINGS = (1e-4, 0.0, 1e-12, 1e-10, 1e-8, 0.5, 1.0, 1.0 + 1e-8, 1e2, 1e6)  # relative, from none to overcritical
norms = pytest.mark.parametrize("norm", LIMITS)


def norm_of(system, norm):
    """Return a norm and whether it is certified."""
    if isinstance(system, SecondOrderModel):
        found = sigma(system).certificate
    else:
        found = (hinf_norm if norm == "peak" else h2_norm)(system.statespace("stressed"))
    return found.lower_bound if norm == "peak" else found.value, found.certified


def norm_error(system, norm, true):
    """Return the relative error of a norm, and whether it is certified; two infinite ones are equal."""
    found, certified = norm_of(system, norm)
    error = abs(found / true - 1.0) if isfinite(true) and isfinite(found) else 0.0 if found == true else inf
    return error, certified


def of_damping(zeta):
    """Return an oscillator of 1 rad/s, its peak and H2 norm, and whether it may be refused."""
    peak = 1.0 if zeta >= sqrt(0.5) else 1.0 / (2.0 * zeta * sqrt(1.0 - zeta**2)) if zeta else inf
    return oscillator(zeta), peak, 0.5 / sqrt(zeta) if zeta else inf, 0.0 < zeta < 1e-8


def of_frequency(omega):
    return oscillator(0.01, omega), of_damping(0.01)[1], 0.5 * sqrt(omega / 0.01), False


def of_repeated_poles(count):
    """Return 1/(s + 1)^n."""
    return repeated_pole(count), 1.0, sqrt(comb(2 * count - 2, count - 1) / 2.0 ** (2 * count - 1)), False


def of_nearly_equal_poles(gap):
    """Return 1/((s + 1)(s + 1 + gap)) after an orthogonal change of states."""
    Q, b = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]]), 1.0 + gap
    return (
        named(Q @ [[-1.0, 1.0], [0.0, -b]] @ Q.T, Q[:, 1:], Q.T[:1]),
        1.0 / b,
        sqrt(1.0 / (2.0 * b * (1.0 + b))),
        True,
    )


def of_lag(gain):
    return named([[-1.0]], [[1.0]], [[gain]]), gain, gain * sqrt(0.5), not 1e-100 < gain < 1.0


@norms
@over_each(
    (of_damping, *DAMPINGS),
    (of_frequency, 1e3, 1e-6, 1e-3, 1e6),
    (of_repeated_poles, 4, 2, 6, 8, 12),
    (of_nearly_equal_poles, 1e-8, 1e-2, 1e-5, 1e-11, 1e-14),
    (of_lag, 1e-200, 1e-90, 1e-150, 1e-300, 1e-306, 1e90, 1e150, 1e300),
)
def test_norm_equals_closed_form(check_error, norm, make, value):
    """Relative error against the closed form."""
    system, peak, h2, may_refuse = make(value)
    true = peak if norm == "peak" else h2
    check_error(lambda: norm_error(system, norm, true), LIMITS[norm], may_refuse)
    if norm == "peak" and make is of_damping:
        check_error(lambda: norm_error(mass_on_spring(value), norm, true), LIMITS[norm], may_refuse)


@over("zeta", *DAMPINGS)
def test_oscillator_poles_equal_closed_form(check_error, zeta):
    """Relative error of the poles against the quadratic's roots in sixty digits."""

    def error():
        found = [row.pole for row in mode_table(mass_on_spring(zeta)).rows]
        with mp.workdps(DIGITS):
            z = mp.mpf(2.0 * zeta) / 2
            root = mp.sqrt(z * z - 1)
            true = [complex(-z + root), complex(-z - root)]
        worst = max(min(abs(p - t) / abs(t) for t in true) for p in found)
        # where two poles meet, half of the digits are those of the data
        return worst if abs(zeta - 1.0) > 1e-6 else max(0.0, worst - 2.0 * sqrt(EPS))

    # rounding of the fastest pole is so much of the slowest
    check_error(error, max(1e-7, 4.0 * EPS * zeta**2), may_refuse=zeta == 1.0)


def error_beside_poles(system):
    """Return how far the largest gain found, at the peak, at the poles' sizes and between, lies from the norm."""
    found = hinf_norm(system.statespace("stressed"))
    sizes = np.unique(np.abs(linalg.eigvals(system.A)))
    omega = np.concatenate([[0.0, found.peak_omega], np.geomspace(0.1 * sizes[0], 2.0 * sizes[-1], 100), sizes])
    return abs(found.lower_bound / state_space_gain(system, (1j * omega).tolist()) - 1.0), found.certified


@over("order", 4, 8, 12, 16)
def test_companion_form_peak_equals_gain_in_sixty_digits(check_error, order):
    """An elliptic low-pass; relative error against the largest gain found in sixty digits."""
    with warnings.catch_warnings():  # scipy says that such coefficients are badly conditioned: so they are
        warnings.simplefilter("ignore")
        matrices = signal.tf2ss(*signal.ellip(order, 0.5, 60.0, 1.0, analog=True))
    check_error(lambda: error_beside_poles(named(*matrices)), LIMITS["peak"])


@norms
@over("spread", 1e6, 1e2, 1e10, 1e14)
def test_spread_poles_norm_equals_closed_form(check_error, norm, spread):
    """1/(s + 1) + g/(s + a), stable, and with +1 in place of -1; relative error against the closed form."""
    gain = spread if norm == "peak" else sqrt(spread)
    true = 2.0 if norm == "peak" else sqrt(1.0 + 2.0 * gain / (1.0 + spread))
    for slow, norm_of_it in ((-1.0, true), (1.0, inf)):
        system = named(np.diag([slow, -spread]), np.ones((2, 1)), [[1.0, gain]])
        check_error(lambda s=system, t=norm_of_it: norm_error(s, norm, t), LIMITS[norm], may_refuse=True)


def chain(order):
    """Return six masses and springs, force at one end, motion of the other; and the order."""
    K = 2.0 * np.eye(6) - np.diag(np.ones(5), 1) - np.diag(np.ones(5), -1)
    A = np.block([[np.zeros((6, 6)), np.eye(6)], [-K, -0.02 * K - 0.01 * np.eye(6)]])
    return named(A, np.eye(12)[:, [6]], np.eye(12)[[5]]), order


def on_circle(radius):
    """Return a sampled system whose poles lie on a circle, in random coordinates; and an order."""
    rng, poles = np.random.default_rng(7), radius * np.exp(1j * np.linspace(0.2, 2.8, 5))
    A = linalg.block_diag(*([[p.real, p.imag], [-p.imag, p.real]] for p in poles))
    T, B, C = (rng.standard_normal(shape) for shape in ((10, 10), (10, 2), (2, 10)))
    return named(T @ A @ np.linalg.inv(T), T @ B, C, dt=0.1), 4


@pytest.mark.parametrize("method", ["balanced", "singular-perturbation", "hankel", "modal"])
@over_each((chain, 4, 2, 6, 8), (on_circle, 0.9, 0.5, 0.99, 0.9999))
def test_reduction_error_is_not_below_the_true_one(check_error, method, make, value):
    """Fraction by which the error is below the largest difference in sixty digits, at and near all resonances."""
    system, order = make(value)

    def error():
        found = reduce(system.statespace("full"), order=order, method=method)
        reduced = of(found.system, sampled=True)
        rates = np.concatenate([system.rates, reduced.rates])
        rates = rates[np.isfinite(rates)]
        omega = np.append((np.abs(rates.imag) + np.abs(rates.real) * np.array([[-0.5], [0.0], [0.5]])).ravel(), 0.0)
        A, B = linalg.block_diag(system.A, reduced.A), np.vstack([system.B, reduced.B])
        difference = named(A, B, np.hstack([system.C, -reduced.C]), system.D - reduced.D)
        true = state_space_gain(difference, system.boundary(omega).tolist())
        return max(0.0, 1.0 - min(found.error_norm, found.error_bound) / true if true > 0.0 else 0.0)

    check_error(error, 1e-9, may_refuse=True)
