"""Motion in time: forced responses, sampled loops, slews."""

from math import factorial, pi, sqrt

import mpmath as mp
import numpy as np
import pytest

from boomctl.simulation.forced_response import forced_response
from boomctl.simulation.loop import simulate_loop
from boomctl.slew.optimal import optimal_slew
from tests.stress.cases import (
    EPS,
    RATES,
    SCALES,
    each_relative,
    mass_on_spring,
    named,
    oscillator,
    over,
    relative,
    repeated_pole,
    static,
)
from tests.stress.references import DIGITS, ramp_response


def hundred_periods(omega):
    return np.linspace(0.0, 200.0 * pi / omega, 501)


@over("omega", *RATES)
def test_ramp_response_at_any_frequency_equals_sixty_digits(check_error, omega):
    """An oscillator over a hundred periods, and in a loop without a controller; error of the largest."""
    times, plant = hundred_periods(omega), oscillator(0.01, omega).statespace("plant")
    true, push = ramp_response(omega, 0.01, times), {"u0": omega * times}
    check_error(lambda: relative(forced_response(plant, times, push)["y0"], true), 1e-9)
    run = lambda: simulate_loop(plant, None, times, push, sample_time=float(times[1]))  # noqa: E731
    check_error(lambda: relative(run()["y0"], true), 1e-9)


@over("zeta", 1e-6, 0.0, 1e-12, 1.0, 1e2, 1e6)
def test_ramp_response_at_any_damping_equals_sixty_digits(check_error, zeta):
    """A state space and a mass on a spring, 1 rad/s, over a hundred periods; error of the largest."""
    times = hundred_periods(1.0)
    true = ramp_response(1.0, zeta, times)
    limit = max(1e-9, 4.0 * EPS * zeta**2)  # rounding of the fastest pole is as large as so much of the slowest
    for plant in (oscillator(zeta).statespace("plant"), mass_on_spring(zeta)):
        error = lambda plant=plant: relative(forced_response(plant, times, {"u0": times})["y0"], true)  # noqa: E731
        check_error(error, limit, may_refuse=zeta > 1.0)


@over("count", 4, 2, 8)
def test_step_response_of_repeated_pole_equals_sixty_digits(check_error, count):
    """1/(s + 1)^n; error against 1 - e^-t sum_k t^k / k!, of the largest."""
    times = np.linspace(0.0, 30.0, 301)
    with mp.workdps(DIGITS):
        t = [mp.mpf(float(x)) for x in times]
        true = [float(1 - mp.exp(-x) * sum(x**k / factorial(k) for k in range(count))) for x in t]
    plant = repeated_pole(count).statespace("plant")
    check_error(lambda: relative(forced_response(plant, times, {"u0": np.ones_like(times)})["y0"], true), 1e-9)


@over("spread", 1e6, 1e3, 1e10, 1e14)
def test_step_response_of_spread_poles_equals_closed_form(check_error, spread):
    """Poles -1 and -a; error of the largest."""
    times = np.linspace(0.0, 10.0, 101)
    plant = named(np.diag([-1.0, -spread]), [[1.0], [spread]], np.eye(2)).statespace("plant")

    def error():
        run = forced_response(plant, times, {"u0": np.ones_like(times)})
        return relative([run["y0"], run["y1"]], [-np.expm1(-times), -np.expm1(-spread * times)])

    check_error(error, 1e-9)


@pytest.mark.parametrize(
    ("delay", "count"),
    [
        (0.3, 200),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0.0, 100_000), (1e-9, 200), (1.0, 9), (1.7, 200))),
    ],
)
def test_sampled_integrator_follows_its_recursion(check_error, delay, count):
    """``x' = u + 1``, ``u = -k x`` held for a sample of ``h`` and so many samples late; error of the largest."""
    h, k, x, whole = 0.1, 0.5, [0.0], int(delay)
    for n in range(count):
        older = [-k * x[n - late] if n >= late else 0.0 for late in (whole + 1, whole)]
        x.append(x[-1] + h * (1.0 + (delay - whole) * older[0] + (1.0 - delay + whole) * older[1]))
    times, K = h * np.arange(count + 1), static(-k).statespace("controller")
    plant, push = named([[0.0]], [[1.0, 1.0]], [[1.0]]).statespace("plant"), {"u1": np.ones_like(times)}
    run = lambda: simulate_loop(plant, K, times, push, sample_time=h, delay=delay * h)  # noqa: E731
    check_error(lambda: relative(run()["y0"], x), 1e-8 if delay else 1e-9)


@pytest.mark.parametrize("unit", ["time", "torque", "angle"])
@over("scale", *SCALES)
def test_least_time_of_double_integrator_equals_closed_form(check_error, unit, scale):
    """In other units; relative error against 2 sqrt(angle/torque)."""
    gain, limit, angle = (
        scale**power if unit == name else 1.0 for name, power in (("time", 2), ("torque", 1), ("angle", 1))
    )
    plant = named([[0.0, 1.0], [0.0, 0.0]], [[0.0], [gain]], [[1.0, 0.0]]).statespace("plant")
    true = 2.0 * sqrt(angle / (gain * limit))
    check_error(
        lambda: each_relative([optimal_slew(plant, angle, limit).duration], [true]), 1e-6, not 1e-7 < scale < 1e7
    )
