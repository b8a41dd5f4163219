"""Slews of beams with axial modes: planned as if the beam did not stretch, judged with these modes."""

from itertools import product

import numpy as np
import pytest

import boomctl as bc

_CASES = (  # Torque limit [N m], angle [rad], tip mass [kg], modes.
    (60.0, 1.0, 0.0, 1),
    (120.0, 1.5708, 0.0, 2),
    (200.0, 1.5708, 0.0, 2),
    (200.0, 1.5708, 0.5, 2),
    (350.0, 1.0, 1.0, 2),
    (500.0, 1.5708, 0.0, 2),
    (500.0, 3.0, 0.0, 1),
    (200.0, 3.0, 0.5, 2),
    (100.0, 0.5, 0.0, 3),
    (300.0, 2.0, 0.2, 3),
)


def end_of(beam, slew):
    """Return the hub angle, the transverse coordinates and their rates after a slew, played back, over their sizes."""
    states = beam.simulate(slew.torque_profile, np.linspace(0.0, slew.duration, 2001), rtol=1e-10, atol=1e-13).states
    kept = [k for k, name in enumerate(beam.state_labels) if "axial" not in name]
    return states[-1, kept], np.abs(states[:, kept]).max(axis=0)


def missed(beam, slew, angle):
    end, sizes = end_of(beam, slew)
    end[0] -= angle
    return np.abs(end / sizes).max()


@pytest.mark.parametrize("model", ["tlam", "foam", "cfoam"])
def test_locked_axial_coordinates_leave_the_other_equations(model):
    beam = bc.hub_beam(tip_mass=0.3, model=model, modes=2)
    rigid = beam._without_axial_modes()
    random, kept = np.random.default_rng(1), [0, 3, 4]
    y, rate, acceleration = np.zeros((3, 20, 5))
    for item in (y, rate, acceleration):
        item[:, kept] = random.standard_normal((20, 3))
    residual = beam.equations.residual(y, rate, acceleration)[:, kept]
    locked = rigid.equations.residual(y[:, kept], rate[:, kept], acceleration[:, kept])
    assert locked == pytest.approx(residual, rel=1e-12, abs=1e-9)
    function, constants = rigid._casadi_equations()
    state = np.concatenate([0.1 * y[0, kept], rate[0, kept]])
    derived = np.array(function(state, 30.0, constants)[0]).ravel()
    assert derived == pytest.approx(rigid.equations.state_derivative(state, 30.0), rel=1e-9)


@pytest.mark.parametrize("model", ["foam", pytest.param("cfoam", marks=pytest.mark.slow)])
def test_slew_ends_where_asked(model):
    beam = bc.hub_beam(model=model, modes=1)
    slew = bc.optimal_slew(beam, 1.0, 60.0)
    assert slew.stages[0] == "planned without axial modes"
    assert slew.certificate.summary.endswith("; without axial modes")
    assert missed(beam, slew, 1.0) < 1e-4
    assert slew.certificate.prescribed_terminal_error < 1e-4


@pytest.mark.parametrize(("model", "rtol"), [("foam", 1e-8), pytest.param("cfoam", 1e-8, marks=pytest.mark.slow)])
def test_small_tolerance_corrects_switching_times(model, rtol):
    beam = bc.hub_beam(tip_mass=0.3, model=model, modes=2)
    near, slew = bc.optimal_slew(beam, 1.0, 300.0), bc.optimal_slew(beam, 1.0, 300.0, rtol=rtol)
    assert missed(beam, near, 1.0) > 1e-6
    assert missed(beam, slew, 1.0) < 10.0 * rtol
    assert slew.certificate.prescribed_terminal_error <= rtol
    assert slew.stages[-1] == "switching times corrected with axial modes"
    assert slew.duration == pytest.approx(near.duration, rel=1e-5)


def test_limits_hold_with_axial_modes():
    beam = bc.hub_beam(tip_mass=0.3, model="foam", modes=1)
    free = bc.optimal_slew(beam, 1.0, 300.0, "effort", 4.0, intervals=50)
    most = 0.97 * np.abs(free.hub_speed).max()
    slew = bc.optimal_slew(beam, 1.0, 300.0, "effort", 4.0, intervals=50, speed_limit=most)
    assert slew.certificate.constraint_violation <= 1e-9
    assert np.abs(slew.hub_speed).max() == pytest.approx(most, rel=1e-3)
    assert slew.cost > free.cost


def test_steady_rotation_at_the_end():
    beam = bc.hub_beam(model="foam", modes=1)
    spin = bc.optimal_slew(beam, None, 150.0, final_speed=1.5)
    assert spin.hub_speed[-1] == pytest.approx(1.5, abs=1e-4)
    slew = bc.optimal_slew(beam, 1.0, 150.0)
    again = bc.slew.replan(slew, torque_limit=160.0)
    assert again.duration < slew.duration


@pytest.mark.slow
@pytest.mark.parametrize(("model", "case"), list(product(["foam", "cfoam"], _CASES)))
def test_no_slew_of_the_default_call_is_refused(model, case):
    torque, angle, tip_mass, modes = case
    beam = bc.hub_beam(tip_mass=tip_mass, model=model, modes=modes)
    slew = bc.optimal_slew(beam, angle, torque)
    assert missed(beam, slew, angle) < 2e-4
    assert slew.certificate.prescribed_terminal_error < 1e-4
    assert slew.certificate.method == "switching times"
