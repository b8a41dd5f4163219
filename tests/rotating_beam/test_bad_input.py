"""Bad input: one line that names the argument, its value and what was expected."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import interpolate

import boomctl as bc
from boomctl.maneuvers import prescribed_motion, sine_torque, spin_up
from boomctl.rotating_beam import hub_beam
from boomctl.structure import SecondOrderModel
from tests.profiles import examples
from tests.refusals import assert_refused, refusals

BEAM, EXACT = hub_beam(modes=2), hub_beam(model="geometrically-exact", modes=3)
SPIN_UP = spin_up(2.8, 30.0)
OTHER_SLOPE = prescribed_motion(np.sin, np.cos, np.sin)


def family(model="sfoam", **ranges):
    return hub_beam(model=model, modes=2).family(**ranges)


def schedule(family):
    gains = [ct.ss([], [], [], [[-gain]], inputs="hub_speed", outputs="torque") for gain in (1.0, 2.0)]
    return bc.robust_stability(family, bc.gain_schedule(gains, [0.0, 1.0]))


def cornered(values):
    """A structure whose stiffness has a corner within the range of its parameter."""
    return SecondOrderModel([[1.0]], [[0.1]], [[1.0 + abs(values["p"])]], {"f": [1.0]}, {"y": [1.0]})


def long(model, end, modes=2):
    return hub_beam(model=model, modes=modes).simulate(sine_torque(20.0, 10.0, end), np.linspace(0.0, end, 11))


REFUSED = r"""
bc.HubBeamParameters(tip_mass_position=8.1) -> tip_position = 8.1
bc.HubBeamParameters(damping_ratio=1.0) -> damping_ratio = 1.0
hub_beam(modes=201) -> modes = 201: expected
hub_beam(model="fadm") -> model = 'fadm': expected one of tlam, sfoam
BEAM.simulate(OTHER_SLOPE, [1.0]) -> acceleration: expected the derivative of the speed
BEAM.simulate(applied_torque(lambda t: np.nan), [1.0]) -> torque at t = .* expected a finite number
EXACT.simulate(applied_torque(lambda t: np.nan), [1.0]) -> torque
BEAM.simulate(free_hub(), []) -> timepts
BEAM.simulate(free_hub(), [-1.0, 1.0]) -> timepts
BEAM.simulate(free_hub(), [1.0, 1.0]) -> timepts
BEAM.simulate(free_hub(), [1.0], initial_state=[0.0, 1.0]) -> initial_state of shape \(2,\): expected \(6,\)
BEAM.simulate(hold_angle(0.1), [1.0], initial_state=[0.2, 0, 0, 0, 0, 0]) -> initial hub angle = 0.2: expected 0.1
EXACT.simulate(SPIN_UP, [1.0], initial_state=EXACT.steady_state(1.0)) -> initial hub speed
BEAM.to_nlsys().dynamics(0.0, 30.0 * np.eye(6)[1], [0.0]) -> mass matrix margin
BEAM.residual_energy([0.0, 1.0]) -> state: expected 6 numbers, got 2
BEAM.eigenfrequencies_hz(1.0, coupled=True) -> no axial modes
BEAM.campbell([1.0]) -> speeds: expected two hub speeds or more
hub_beam(model="tlam", modes=2).campbell([5.0, 6.0]) -> loses its stiffness
family("foam", hub_speed=(0.0, 2000.0)) -> loses its stiffness
family() -> hub_speed = 0.0: expected a range
family(hub_speed=(0.0, 1.0), tip_mass=(-0.1, 0.1)) -> lower end of tip_mass = -0.1
family(hub_speed=(0.0, 1.0), sensors=[bc.BeamSensor("a", "acceleration", 1.0)]) -> no acceleration
schedule(family(tip_mass=(0.0, 0.1))) -> unknown parameter that the controller follows 'hub_speed'
PolynomialFamily.from_function({"p": (-1.0, 1.0)}, cornered) -> K is no polynomial of p
# models chosen by their accuracy
hub_beam(accuracy=1e-3) -> maneuver = None: expected a maneuver
hub_beam(maneuver=SPIN_UP) -> accuracy = None: expected a number
hub_beam(accuracy=1e-3, maneuver=SPIN_UP, model="sfoam") -> model = 'sfoam': expected None with accuracy
hub_beam(accuracy=1e-8, maneuver=SPIN_UP) -> accuracy = 1e-08: expected 1e-07 to 1
hub_beam(accuracy=1e-3, maneuver=SPIN_UP, timepts=[]) -> timepts of shape \(0,\): expected a time
hub_beam(accuracy=1e-3, maneuver=SPIN_UP, timepts=1e10) -> timepts = .*: expected at most .* s, 1000 periods
hub_beam(accuracy=1e-3, maneuver=applied_torque(np.sin)) -> timepts = None: expected the last time
hub_beam(accuracy=1e-3, maneuver=hold_angle(), timepts=1.0) -> maneuver = Hold.* moves the beam
hub_beam(model="tlam", modes=2).simulate(spin_up(40.0, 1.0), np.linspace(0.0, 100.0, 101)) -> SimulationError: t = \d
long("foam", 1e9) -> SimulationError: radians of the slowest mode; expected at most 300000, which is about
"""


# motions that cannot be followed
SLOW = r"""
hub_beam(modes=3).simulate(sine_torque(2e5, 10.0, 10.0), [10.0]) -> SimulationError: positive definite at t = \d
EXACT.simulate(spin_up(2.0, 1.0), [0.0, 1.0], rtol=1e-17, atol=1e-99) -> SimulationError: rtol
long("cfoam", 1e4, modes=3) -> SimulationError: would take about
long("geometrically-exact", 1e4, modes=3) -> SimulationError: would take about
# displacements of 1e-13 m are rounding of a place eight meters out
hub_beam(accuracy=1e-7, maneuver=spin_up(1e-10, 5.0)) -> ^accuracy = 1e-07: expected (at least|a larger one)
"""


@refusals(REFUSED, slow=SLOW)
def test_combination_that_is_impossible_refused(call, words):
    assert_refused(call, words, globals())


_FEW_SINES = st.lists(
    st.tuples(st.floats(0.3, 40.0), st.floats(0.05, 1.0), st.floats(0.0, 6.3)), min_size=1, max_size=4
)


def swaying(sines, end):
    """A motion by sines (frequency [rad/s], amplitude of the speed [rad/s], phase) and a short turn within them."""
    turn = 0.02 * end * np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    begin, length = 0.4 * end, 0.07 * end

    def derivative(k):
        def value(t):
            t = np.asarray(t)
            moved = turn.deriv(k)(np.clip((t - begin) / length, 0.0, 1.0)) / length**k
            return moved + sum(a * w ** (k - 1) * np.sin(w * t + p + 0.5 * k * np.pi) for w, a, p in sines)

        return value

    return tuple(derivative(k) for k in range(3))


@given(
    _FEW_SINES,
    st.floats(0.7, 20.0),
    st.sampled_from(["acceleration", "speed", "sine of the acceleration", "sine of the speed"]),
    st.floats(-8.0, -2.0),
    st.one_of(st.floats(1.0, 50.0), st.integers(1, 5)),
)
@examples(200)
def test_functions_that_nearly_belong_together_are_refused(sines, end, what, share, swift):
    """By down to 1e-8 of the largest speed, in all of it or in one sine, also one that even intervals do not show."""
    angle, speed, acceleration = swaying(sines, end)
    largest = np.abs(speed(np.linspace(0.0, end, 2001))).max()
    off, w = 10.0**share, 128.0 * np.pi * swift / end if isinstance(swift, int) else swift
    wrong = {
        "acceleration": (angle, speed, lambda t: (1.0 + off) * acceleration(t)),
        "speed": (angle, lambda t: (1.0 + off) * speed(t), lambda t: (1.0 + off) * acceleration(t)),
        "sine of the acceleration": (angle, speed, lambda t: acceleration(t) + off * largest * w * np.sin(w * t)),
        "sine of the speed": (angle, lambda t: speed(t) + off * largest * np.sin(w * t), acceleration),
    }[what]
    prescribed_motion(angle, speed, acceleration).checked_until(end)
    with pytest.raises(ValueError, match=r"expected the derivative of the .*; from .* to .* s the .* differs by up to"):
        prescribed_motion(*wrong).checked_until(end)


def test_breakpoint_beside_instant_that_is_looked_at_is_one():
    """A pulse from one of 200 intervals into the next, and a breakpoint that is their common end but for rounding."""

    def since(t, k):
        return np.maximum(np.asarray(t) - 4.97, 0.0) ** k - np.maximum(np.asarray(t) - 5.02, 0.0) ** k

    functions = lambda t: since(t, 2), lambda t: 2.0 * since(t, 1), lambda t: 2.0 * ((t >= 4.97) & (t < 5.02))
    found = prescribed_motion(*functions, (np.nextafter(5.0, 6.0),)).checked_until(10.0)
    assert np.diff(found.breakpoints).min() > 1e-12


def test_tables_of_a_motion_belong_together_as_one_spline():
    times = np.linspace(0.0, 5.0, 101)
    table = interpolate.CubicSpline(times, 1.0 - np.cos(times), bc_type="clamped")
    functions = tuple(table if not k else table.derivative(k) for k in range(3))
    prescribed_motion(*functions).checked_until(5.0)
    with pytest.raises(ValueError, match=r"of tables take one spline and its derivatives$"):
        prescribed_motion(*(lambda t, f=f: np.interp(t, times, f(times)) for f in functions)).checked_until(5.0)
