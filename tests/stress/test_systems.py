"""Linear systems: norms, modes and reductions over damping, clusters, spreads, scales and kinds of numbers."""

import warnings
from dataclasses import replace
from math import comb, inf, isfinite, sqrt

import control
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
from tests.stress.cases import EPS, SCALES, mass_on_spring, named, oscillator, over, over_each, relative, repeated_pole
from tests.stress.references import DIGITS, state_space_gain

LIMITS = {"peak": 1.1e-5, "H2": 1.1e-6}  # what certified norms promise, with a tenth for their own rounding
DAMPINGS = (1e-4, 0.0, 1e-12, 1e-10, 1e-8, 0.5, 1.0, 1.0 + 1e-8, 1e2, 1e6)  # relative, from none to overcritical
norms = pytest.mark.parametrize("norm", LIMITS)


def norm_of(system, norm):
    """Return a norm and whether it is certified."""
    if isinstance(system, SecondOrderModel):
        found = sigma(system).certificate
    else:
        found = (hinf_norm if norm == "peak" else h2_norm)(system.statespace("stressed"))
    return found.lower if norm == "peak" else found.value, found.certified


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
    omega = np.concatenate([[0.0, found.omega], np.geomspace(0.1 * sizes[0], 2.0 * sizes[-1], 100), sizes])
    return abs(found.lower / state_space_gain(system, (1j * omega).tolist()) - 1.0), found.certified


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


def some_system():
    """Return damped oscillators over two decades, coordinates mixed by an orthogonal matrix, two inputs and outputs."""
    rng = np.random.default_rng(3)
    omega, zeta = np.geomspace(0.1, 10.0, 5), 10.0 ** rng.uniform(-3.0, -1.0, 5)
    blocks = [w * np.array([[-z, 1.0], [-1.0, -z]]) for w, z in zip(omega, zeta, strict=True)]
    A = linalg.block_diag(*blocks)
    Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
    B, C = rng.standard_normal((len(A), 2)), rng.standard_normal((2, len(A)))
    return named(Q @ A @ Q.T, Q @ B, C @ Q.T)


def with_state_sizes(system, sizes):
    """Return the same system with its states multiplied."""
    return replace(system, A=system.A * sizes[:, None] / sizes, B=system.B * sizes[:, None], C=system.C / sizes)


@norms
@pytest.mark.parametrize("unit", ["time", "inputs", "states"])
@over("scale", *SCALES)
def test_norm_in_other_units_scales(check_error, norm, unit, scale):
    """Relative error against the law of scaling."""
    system = some_system()
    other, factor = {
        "time": (replace(system, A=scale * system.A, B=scale * system.B), 1.0 if norm == "peak" else sqrt(scale)),
        "inputs": (replace(system, B=scale * system.B), scale),
        "states": (with_state_sizes(system, np.geomspace(1.0, scale, len(system.A))), 1.0),
    }[unit]
    check_error(lambda: norm_error(other, norm, factor * norm_of(system, norm)[0]), LIMITS[norm])


def read_only_view(x):
    view = np.repeat(x, 2, axis=1)[:, ::2]
    view.flags.writeable = False
    return view


KINDS = {
    "int8": lambda x: x.astype("int8"),
    "float32": lambda x: x.astype("float32"),
    "int64": lambda x: x.astype("int64"),
    "Fortran order": np.asfortranarray,
    "lists": lambda x: x.astype(int).tolist(),
    "a read-only view": read_only_view,
}


@over("kind", *KINDS)
def test_norm_of_another_kind_of_numbers_is_that_of_doubles(check_error, kind):
    """Small whole numbers, which every kind holds exactly; relative difference from double precision."""
    system = [np.array(x) for x in ([[0.0, 1, 0], [-2, -1, 1], [0, 0, -3]], [[0.0], [1], [2]], [[1.0, 0, 0]], [[0.0]])]
    model = [np.array(x) for x in ([[1.0, 0], [0, 1]], [[1.0, 0], [0, 1]], [[2.0, -1], [-1, 2]])]
    ports = {"f": [1.0, 0.0]}, {"y": [0.0, 1.0]}

    def found(convert):
        plant = control.ss(*map(convert, system))
        return hinf_norm(plant).lower, h2_norm(plant).value, sigma(SecondOrderModel(*map(convert, model), *ports)).peak

    check_error(lambda: relative(found(KINDS[kind]), found(np.array)), 1e-9)


@over("gain", 1e-8, 1e-2, 1e-5, 1e-12)
def test_norm_with_weak_undamped_mode_is_infinite(check_error, gain):
    """1 + k/(s^2 + 1) has no finite peak, 1/(s + 1) + k/s no finite H2 norm."""
    undamped = named([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [gain]], [[1.0, 0.0]], [[1.0]])
    integrator = named(np.diag([0.0, -1.0]), np.ones((2, 1)), [[gain, 1.0]])
    for norm, system in (("peak", undamped), ("H2", integrator)):
        check_error(lambda n=norm, s=system: norm_error(s, n, inf), LIMITS[norm], may_refuse=True)


def shortfall(system, method, order=None, error=None):
    """Return the fraction by which the verified error, or the bound known before, falls below the true one.

    With an error asked for, or by which the verified one exceeds it.  The true one is the largest difference found in sixty
    digits at and near all resonances.
    """
    found = reduce(system.statespace("full"), order=order, error=error, method=method)
    reduced = of(found.system, sampled=True)
    rates = np.concatenate([system.rates, reduced.rates])
    rates = rates[np.isfinite(rates)]
    omega = np.append((np.abs(rates.imag) + np.abs(rates.real) * np.array([[-0.5], [0.0], [0.5]])).ravel(), 0.0)
    A, B = linalg.block_diag(system.A, reduced.A), np.vstack([system.B, reduced.B])
    difference = named(A, B, np.hstack([system.C, -reduced.C]), system.D - reduced.D)
    true = state_space_gain(difference, system.boundary(omega).tolist())
    told = found.measured_error if error is not None else min(found.measured_error, found.error_bound)
    return max(0.0, 0.0 if error is None else told / error - 1.0, 1.0 - told / true if true > 0.0 else 0.0)


def in_other_coordinates(A, seed, dt=0.0):
    rng, n = np.random.default_rng(seed), len(A)
    T = rng.standard_normal((n, n))
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((2, n))
    return named(T @ A @ np.linalg.inv(T), T @ B, C, dt=dt)


def pairs(poles):
    return linalg.block_diag(*([[p.real, p.imag], [-p.imag, p.real]] for p in poles))


def chain(order):
    """Return six masses and springs, force at one end, motion of the other; and the order."""
    K = 2.0 * np.eye(6) - np.diag(np.ones(5), 1) - np.diag(np.ones(5), -1)
    A = np.block([[np.zeros((6, 6)), np.eye(6)], [-K, -0.02 * K - 0.01 * np.eye(6)]])
    return named(A, np.eye(12)[:, [6]], np.eye(12)[[5]]), order


def on_circle(radius):
    return in_other_coordinates(pairs(radius * np.exp(1j * np.linspace(0.2, 2.8, 5))), 7, 0.1), 4


@pytest.mark.parametrize("method", ["balanced", "singular-perturbation", "hankel", "modal"])
@over_each((chain, 4, 2, 6, 8), (on_circle, 0.9, 0.5, 0.99, 0.9999))
def test_reduction_error_is_not_below_the_true_one(check_error, method, make, value):
    """Fraction by which the error is too low."""
    system, order = make(value)
    check_error(lambda: shortfall(system, method, order), 1e-9, may_refuse=True)


@over("pole", 1e-1, 1e-3, 10.0)
def test_reduced_unstable_system_error_is_not_below_the_true_one(check_error, pole):
    """An unstable pole and oscillators, modal to five states; fraction by which the error is too low."""
    A = linalg.block_diag([[pole]], pairs(np.linspace(1.0, 9.0, 4) * (-0.01 + 1j)))
    check_error(lambda: shortfall(in_other_coordinates(A, 9), "modal", 5), 1e-9)


@over("error", 1e-4, 1e-1, 1e-8, 1e-12)
def test_reduction_to_an_error_meets_it(check_error, error):
    """An unstable pole, coordinates of unlike sizes; fraction by which the error is missed, or stated too low."""
    A = linalg.block_diag([[0.5]], pairs(np.linspace(1.0, 6.0, 4) * (-0.02 + 1j)))
    system = with_state_sizes(in_other_coordinates(A, 8), np.geomspace(1.0, 1e8, len(A)))
    check_error(lambda: shortfall(system, "balanced", error=error), 1e-9)


@over("friction", 1.0, 1e-4, 1e-2, 1e2, 1e4)
def test_reduced_cart_keeps_its_integrator(check_error, friction):
    """Relative error of the integrator's residue, one over the friction."""
    C = np.array([[friction + 0.1, -0.1], [-0.1, 0.1]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [np.array([[-1.0, 1.0], [1.0, -1.0]]), -C]])
    system, slow = named(A, np.eye(4)[:, [2]], np.eye(4)[[1]]), 1e-7 * min(friction, 1.0)

    def error():
        reduced = of(reduce(system.statespace("cart"), order=3).system)
        return abs(1j * slow * complex(reduced.response(np.array([slow]))[0, 0, 0]) * friction - 1.0)

    check_error(error, 1e-6, may_refuse=True)


@over("scale", *SCALES)
def test_reduction_error_in_other_units_of_time_is_the_same(check_error, scale):
    """Relative difference of verified errors."""
    system = some_system()
    other = replace(system, A=scale * system.A, B=scale * system.B)
    errors = lambda: [reduce(s.statespace("s"), order=6).measured_error for s in (other, system)]  # noqa: E731
    check_error(lambda: relative(*np.array(errors())[:, None]), 1e-4, may_refuse=True)
