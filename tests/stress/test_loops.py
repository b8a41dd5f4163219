"""Control: regulators, estimators, H-infinity designs, margins, tuning and anti-windup, against closed forms and laws."""

from math import acos, degrees, inf, pi, sqrt

import numpy as np
from scipy import linalg

from boomctl.analysis.margins import margins
from boomctl.analysis.model_norm import hinf_norm
from boomctl.synthesis.hinf.h_infinity import h_infinity
from boomctl.synthesis.lq.h2 import h2
from boomctl.synthesis.lq.kalman import kalman
from boomctl.synthesis.lq.lqr import lqr
from tests.stress.cases import (
    RATES,
    each_relative,
    named,
    oscillator,
    over,
    over_each,
    repeated_pole,
    static,
)


def double_integrator(r):
    """Return a plant, its weights, what of the answer is compared, and that in closed form: gains."""
    true = [r**-0.5, sqrt(2.0) * r**-0.25]
    return named([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2)), np.diag([1.0, 0.0]), r, lambda X: X.gain[0], true


def light_oscillator(zeta):
    """Return the same of x'' + 2 z x' + x = u with weights 1: p12 = sqrt 2 - 1, p22 from a quadratic."""
    p12 = 1.0 / (1.0 + sqrt(2.0))
    rest = 2.0 * p12 + 1.0
    p22 = rest / (2.0 * zeta + sqrt(4.0 * zeta**2 + rest))
    return (
        oscillator(zeta),
        np.eye(2),
        1.0,
        lambda X: X.riccati_solution,
        [[2.0 * zeta * p12 + p22 + p12 * p22, p12], [p12, p22]],
    )


def weakly_controllable(gain):
    """Return the same of x' = x + g u: p = (1 + sqrt(1 + g^2)) / g^2."""
    system, true = named(np.diag([1.0, -1.0]), [[gain], [1.0]], np.eye(2)), [1.0 + sqrt(1.0 + gain**2)]
    return system, np.diag([1.0, 0.0]), 1.0, lambda X: X.riccati_solution[:1, 0] * gain**2, true


def spread_poles(spread):
    """Return the same of two modes, each with a weight and a control of its own: p = q / (a + sqrt(a^2 + q))."""
    system, true = named(np.diag([-1.0, -spread]), np.eye(2), np.eye(2)), [a + sqrt(a * a + 1.0) for a in (1.0, spread)]
    return system, np.eye(2), np.eye(2), lambda X: 1.0 / np.diag(X.riccati_solution), true


@over_each(
    (double_integrator, 1e-6, 1e-12, 1.0, 1e6, 1e12),
    (light_oscillator, 1e-8, 0.0, 1e-12, 1e-4, 1.0, 1e4),
    (weakly_controllable, 1e-4, 1e-1, 1e-8, 1e-12),
    (spread_poles, 1e6, 1e2, 1e10, 1e14),
)
def test_lqr_equals_closed_form(check_error, make, value):
    """Relative error of the gain or the cost matrix."""
    system, Q, R, read, true = make(value)
    easy = make is double_integrator or (make is light_oscillator and value <= 1.0) or value in (1e-4, 1e-1)
    limit = 1e-6 if make is weakly_controllable else 1e-8
    check_error(lambda: each_relative(read(lqr(system.statespace("plant"), Q, R)), true), limit, may_refuse=not easy)


@over("variance", 1e-8, 1.0, 1e-16)
def test_kalman_with_modes_without_noise_equals_closed_form(check_error, variance):
    """A random walk measured together with lightly damped modes at rest, sampled; relative error of its covariance."""
    modes = [0.999 * np.array([[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]]) for w in (0.3, 0.7, 1.1)]
    plant = named(linalg.block_diag(1.0, *modes), np.eye(7)[:, :1], [[1.0, 1e6, 0.0, 1.0, 0.0, 1e-6, 0.0]], dt=1e-5)
    true = 0.5 * (variance + sqrt(variance**2 + 4.0 * variance))

    def error():
        found = kalman(plant.statespace("plant"), {"u0": variance}, 1.0, disturbances=plant.input_labels).covariance
        return max(float(found[1:].any()), abs(found[0, 0] / true - 1.0))

    check_error(error, 1e-8)


def with_effort(plant):
    """Return ``z = (y, u)`` for a disturbance that acts as the control and the noise of the sensor."""
    B, C, n = plant.B, plant.C[:1], len(plant.A)
    D = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
    return named(plant.A, np.hstack([B, np.zeros((n, 1)), B]), np.vstack([C, np.zeros((1, n)), C]), D)


def unstable(pole):
    return named([[pole]], [[pole]], [[1.0]])


@over_each(
    (oscillator, 1e-4, 0.0, 1e-8, 1e-1),
    (lambda rate: repeated_pole(1, rate), *RATES),
    (unstable, 1.0, 1e3, 1e6),
)
def test_h_infinity_norm_is_the_loops_own(check_error, make, value):
    """Fraction by which the verified norm misses the loop's own or lies below its lower bound."""

    def error():
        found = h_infinity(with_effort(make(value)).statespace("P"), 1, 1)
        own = hinf_norm(found.closed_loop)
        return max(abs(found.gamma / own.lower_bound - 1.0), found.certificate.lower_bound / found.gamma - 1.0)

    check_error(error, 1e-5, may_refuse=True)


@over("zeta", 1e-8, 0.0, 1e-4, 1e-1)
def test_h2_norm_equals_riccati_equations(check_error, zeta):
    """Relative error of the square of the optimum against the regulator's and the filter's equations."""
    plant = oscillator(zeta)
    A, B, C = plant.A, plant.B, plant.C

    def error():
        X = linalg.solve_continuous_are(A, B, C.T @ C, np.eye(1))
        Y = linalg.solve_continuous_are(A.T, C.T, B @ B.T, np.eye(1))
        true = np.trace(B.T @ X @ B) + np.trace(B.T @ X @ Y @ X @ B)
        return abs(h2(with_effort(plant).statespace("P"), 1, 1).norm ** 2 / true - 1.0)

    check_error(error, 1e-6, may_refuse=True)


def loop_margins(plant, gain, dt=0.0):
    """Return the margins of the loop of a plant and a gain, sampled where ``dt`` is given."""
    return margins(plant.statespace("plant"), static(-gain, dt).statespace("controller")).loops[0]


def integrator(omega):
    """Return a loop, and its gain margin, phase margin, delay margin, phase crossover and gain crossover."""
    return named([[0.0]], [[1.0]], [[1.0]]), omega, (inf, 90.0, 0.5 * pi / omega, inf, omega)


def three_lags(omega):
    """Return the same of 2/(s/w + 1)^3."""
    x = sqrt(4.0 ** (1.0 / 3.0) - 1.0)  # 2/(1 + x^2)^(3/2) = 1; the phase is then 180 - 3 atan x degrees
    phase = 180.0 - 3.0 * degrees(acos(1.0 / sqrt(1.0 + x * x)))
    return repeated_pole(3, omega), 2.0, (4.0, phase, np.radians(phase) / (omega * x), omega * sqrt(3.0), omega * x)


@over_each((integrator, *RATES), (three_lags, *RATES))
def test_margins_equal_closed_form(check_error, make, value):
    """Relative error of gain, phase, delay and crossovers."""
    plant, gain, true = make(value)

    def error():
        m = loop_margins(plant, gain)
        found = m.gain_margin[1], m.phase_margin_deg, m.delay_margin, m.gain_margin_omega[1], m.phase_margin_omega
        return max(0.0 if a == b else abs(a / b - 1.0) for a, b in zip(found, true, strict=True))

    check_error(error, 1e-6)
