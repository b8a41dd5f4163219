"""Minimum time: exact solutions, laws, and the certificate's own honesty."""

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import linalg

import boomctl as bc
from boomctl.lti.hold import linear_hold
from boomctl.slew.least_time import linear
from boomctl.slew.least_time.linear import least_time, misfit, rigid_and_slowest, switching_function, time_gap
from boomctl.slew.plant import plant_of
from boomctl.slew.problem import Limits, slew_problem
from boomctl.slew.replay import _linear_motion
from boomctl.slew.torque import TorqueProfile
from tests.profiles import examples
from tests.slew.systems import rigid, two_masses, two_masses_exact

pytestmark = pytest.mark.early

angles = st.floats(0.05, 3.0)
torques = st.floats(20.0, 400.0)


@examples(25)
@given(angles, torques, st.floats(0.1, 1e4))
def test_rigid_body_takes_the_textbook_time(angle, torque, inertia):
    slew = bc.optimal_slew(rigid(inertia), angle, torque)
    exact = 2.0 * np.sqrt(inertia * angle / torque)
    assert slew.duration == pytest.approx(exact, rel=1e-10)
    assert slew.certificate.n_switches == 1
    assert slew.torque_profile.switching_times == pytest.approx([exact / 2], rel=1e-10)


@pytest.mark.parametrize("rate", [1.0, *(pytest.param(rate, marks=pytest.mark.slow) for rate in (1e-2, 1e2))])
def test_two_masses_and_a_spring(rate):
    exact, switches = two_masses_exact()
    slew = bc.optimal_slew(two_masses(rate), 1.0, 1.0)
    assert exact == pytest.approx(4.218, abs=5e-4)  # Liu & Wie; Singh & Vadali
    assert switches == pytest.approx([1.003, 2.109, 3.215], abs=1e-3)
    assert rate * slew.duration == pytest.approx(exact, rel=1e-8)
    assert rate * slew.torque_profile.switching_times == pytest.approx(switches, rel=1e-8)
    assert slew.certificate.optimality_status == "proved"
    assert abs(slew.certificate.optimality_gap) < 1e-9
    assert slew.terminal_error < 1e-9
    assert slew.residual_energy is None
    assert slew.tip_displacement is None


@pytest.mark.parametrize(("linear", "tolerance"), [(True, 1e-7), (False, 1e-12)], ids=["linear", "nonlinear"])
@examples(8)
@given(st.floats(0.3, 2.5), st.floats(100.0, 400.0), st.integers(1, 3))
def test_rest_to_rest_is_antisymmetric_in_time(linear, tolerance, angle, torque, modes):
    beam = bc.hub_beam(modes=modes, tip_mass=0.1)
    slew = bc.optimal_slew(beam.linearize() if linear else beam, angle, torque)
    switches = slew.torque_profile.switching_times
    assert slew.certificate.optimality_status == ("proved" if linear else "extremal")
    assert abs(slew.certificate.optimality_gap) < 1e-6
    assert slew.terminal_error < 1e-6
    assert switches + switches[::-1] == pytest.approx(slew.duration, rel=tolerance)
    t = np.linspace(0.0, slew.duration, 101)[1:-1]
    t = t[np.abs(t[:, None] - switches).min(axis=1) > 1e-6]
    assert slew.torque_profile(t) == pytest.approx(-slew.torque_profile(slew.duration - t))


def test_lower_bound_catches_a_slew_that_is_not_the_fastest():
    problem = slew_problem(two_masses(), 1.0, Limits(1.0))
    found = least_time(problem)
    spoiled = replace(found, switches=found.switches * 1.05, duration=found.duration * 1.05)
    assert time_gap(problem, found) < 1e-9
    assert time_gap(problem, spoiled) > 1e-3
    assert misfit(problem, spoiled) > 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("limit", [22.98, 22.9890625, 22.98955, 23.0])
def test_where_an_arc_is_about_to_appear(limit):
    """About 22.99 N m a pair of arcs shrinks to nothing and another grows from it."""
    h = bc.hub_beam(modes=2).linearize()
    slew = bc.optimal_slew(h, 1.8763648523917893, limit)
    assert slew.certificate.optimality_status == "proved"
    assert slew.certificate.optimality_gap < 1e-6
    assert slew.duration == pytest.approx(8.9285456 - 0.21 * (limit - 22.9890625), abs=1e-4)


@pytest.mark.slow
def test_grids_see_the_fastest_vibration():
    """A grid on which the fifth mode turns whole times an interval cannot move it."""
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.3), modes=5).linearize()
    start = [0.0, 0.02, 0.0006, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    slew = bc.optimal_slew(h, 1.2, 36.5, initial_state=start)
    assert slew.certificate.optimality_status == "proved"
    assert slew.certificate.optimality_gap < 1e-6


@pytest.mark.parametrize(("model", "modes"), [("sfoam", 1), ("sfoam-consistent", 2)])
def test_nonlinear_bang_bang_satisfies_pontryagin(model, modes):
    h = bc.hub_beam(model=model, modes=modes)
    slew = bc.optimal_slew(h, np.pi / 2, 200.0)
    c = slew.certificate
    assert c.method == "switching times"
    assert c.optimality_status == "extremal"
    assert c.optimality_gap < 1e-6
    assert c.free_terminal_errors == {}
    assert slew.terminal_error == c.prescribed_terminal_error < 1e-6
    assert slew.residual_energy < 1e-9
    assert np.abs(slew.torque).max() <= 200.0 * (1.0 + 1e-12)
    assert slew.hub_angle[-1] == pytest.approx(np.pi / 2, abs=1e-7)


def test_small_nonlinear_slew_is_the_linear_one():
    h = bc.hub_beam(modes=2)
    gaps = []
    for angle in (0.02, 0.04):
        linear = bc.optimal_slew(h.linearize(), angle, 20.0).duration
        gaps.append(abs(bc.optimal_slew(h, angle, 20.0).duration / linear - 1.0))
    assert gaps[0] < 1e-5
    assert gaps[0] < gaps[1]


def test_spin_up_ends_in_steady_rotation():
    h = bc.hub_beam(modes=1)
    slew = bc.optimal_slew(h, None, 200.0, final_speed=1.0)
    inertia = bc.HubBeamParameters().rigid_body_inertia
    assert slew.hub_speed[-1] == pytest.approx(1.0, abs=1e-6)
    assert slew.residual_energy < 1e-9
    assert slew.duration > 0.99 * inertia / 200.0
    assert slew.certificate.optimality_gap < 1e-6


@pytest.mark.parametrize(("angle", "amplitude"), [(None, 0.001), (None, 0.1), (0.0, 0.1), (1e-4, 1.0)])
def test_vibration_alone_is_brought_to_rest(angle, amplitude):
    slew = bc.optimal_slew(two_masses(), angle, 1.0, initial_state=[amplitude, -amplitude, 0.0, 0.0])
    assert slew.certificate.optimality_status == "proved"
    assert slew.certificate.optimality_gap < 1e-9
    assert slew.states[-1] @ [-1.0, 1.0, 0.0, 0.0] == pytest.approx(0.0, abs=1e-9)
    assert slew.states[-1][2:] == pytest.approx([0.0, 0.0], abs=1e-9)


@examples(6)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.3, 3.0), st.sampled_from([-1.0, 1.0]))
def test_a_rigid_body_between_speeds(first, last, distance, side):
    """It neither starts nor ends at rest: more time is not always of use, the least is sought from below."""
    exact = _rigid_time(first, last, side * distance)
    slew = bc.optimal_slew(rigid(1.0), None, 1.0, initial_state=[0.0, first], final_state=[side * distance, last])
    assert slew.duration == pytest.approx(exact, rel=1e-6)


def _rigid_time(first, last, way):
    times = []
    for sign in (1.0, -1.0):
        square = sign * way + 0.5 * (first**2 + last**2)
        for peak in (np.sqrt(max(square, 0.0)), -np.sqrt(max(square, 0.0))):
            parts = sign * (peak - first), sign * (peak - last)
            if square >= 0.0 and min(parts) >= 0.0:
                times.append(sum(parts))
    return min(times)


@pytest.mark.slow
def test_a_proof_of_nothing_is_not_called_one():
    """The first torque stops the vibration after exactly half a period: the costate has no scale."""
    slew = bc.optimal_slew(two_masses(), None, 1.0, initial_state=[1.0, -1.0, 0.0, 0.0])
    assert slew.duration == pytest.approx(np.pi * np.sqrt(2.0), rel=1e-6)
    c = slew.certificate
    assert 0.0 <= c.optimality_gap <= 1.0
    assert c.optimality_gap < 1.0 or c.optimality_status != "proved"


def test_the_torque_may_be_integrated_three_times():
    triple = control.ss([[0, 1, 0], [0, 0, 1], [0, 0, 0]], [[0], [0], [1]], [[1, 0, 0]], 0)
    for angle in (1.0, 1e6):
        slew = bc.optimal_slew(triple, angle, 1.0)
        assert slew.duration == pytest.approx(np.cbrt(32.0 * angle), rel=1e-10)
        assert slew.torque_profile.switching_times == pytest.approx(slew.duration * np.array([0.25, 0.75]), rel=1e-8)


def test_an_angle_may_be_counted_against_the_torque():
    system = two_masses()
    turned = control.ss(system.A, system.B, -system.C, 0)
    slews = [bc.optimal_slew(each, 1.0, 1.0) for each in (system, turned)]
    assert slews[0].duration == pytest.approx(slews[1].duration, rel=1e-12)
    assert slews[0].torque_profile.start_values == pytest.approx(-slews[1].torque_profile.start_values)


def test_a_payload_twice_is_a_payload_once():
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), modes=1)
    once, twice = (bc.optimal_slew(h, 1.0, 100.0, tip_masses=masses) for masses in ((0.2,), (0.2, 0.1, 0.2)))
    assert twice.duration == pytest.approx(once.duration, rel=1e-9)
    assert twice.certificate.method == "switching times"


@examples(6)
@given(st.lists(st.floats(-8.0, 8.0), min_size=4, max_size=4))
def test_units_of_the_states_do_not_matter(decades):
    """Each state in a unit of its own, sixteen decades apart."""
    system, unit = two_masses(), 10.0 ** np.array(decades)
    scaled = control.ss(system.A * unit[:, None] / unit, system.B * unit[:, None], system.C / unit, 0)
    slew = bc.optimal_slew(scaled, 1.0, 1.0)
    assert slew.duration == pytest.approx(two_masses_exact()[0], rel=1e-9)
    assert slew.states[-1] / unit == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=1e-9)
    bent = bc.optimal_slew(scaled, None, 1.0, initial_state=unit * [0.1, -0.1, 0.0, 0.0])
    assert bent.states[-1][2:] / unit[2:] == pytest.approx([0.0, 0.0], abs=1e-9)


@examples(25)
@given(st.floats(-3.0, 3.0).filter(lambda angle: abs(angle) > 0.05), torques, st.floats(0.0, 0.5))
def test_rigid_body_with_one_mode_minimum_time(angle, torque, tip_mass):
    """With one mode and no damping the closed form is the linear part's optimum; with more, the time is nearly theirs."""
    problem = slew_problem(bc.hub_beam(tip_mass=tip_mass, modes=1), angle, Limits(torque))
    first = rigid_and_slowest(problem)
    assert first is not None
    exact = least_time(problem)
    assert first.duration == pytest.approx(exact.duration, rel=1e-9)
    assert first.switching_times == pytest.approx(exact.switches, abs=1e-6 * exact.duration)
    more = least_time(slew_problem(bc.hub_beam(tip_mass=tip_mass, modes=3), angle, Limits(torque)))
    assert first.duration == pytest.approx(more.duration, rel=3e-2)


@pytest.mark.parametrize("modes", [1, 3])
def test_the_switching_function_is_the_costate_carried_back(modes):
    problem = slew_problem(bc.hub_beam(modes=modes).linearize(), 1.0, Limits(200.0))
    found = least_time(problem)
    t = np.linspace(0.1, found.duration, 57)
    direct = [found.costate @ linalg.expm((found.duration - at) * problem.A) @ problem.B for at in t]
    assert switching_function(problem, found, t) == pytest.approx(direct, abs=1e-12 * np.abs(direct).max())


def test_linear_replay_exact_for_linear_torque():
    """Against the exponential of the whole: Taylor's maps, shared by the steps of an interval, leave rounding alone."""
    plant = plant_of(bc.hub_beam(modes=2).linearize())
    profile = TorqueProfile(np.array([0.0, 0.3, 1.0, 1.7]), np.array([5.0, -2.0, 1.0]), np.array([5.0, 3.0, 0.0]))
    times = np.unique(np.concatenate([np.linspace(0.0, 1.7, 20), profile.edges]))
    states = _linear_motion(plant, profile, np.zeros(plant.n), times) @ plant.from_state.T
    state, expected = np.zeros(plant.n), [np.zeros(plant.n)]
    for a, b in pairwise(times):
        first, last = (
            profile(a),
            profile.end_values[np.searchsorted(profile.edges, b) - 1] if b in profile.edges else profile(b),
        )
        Phi, G, H = linear_hold(plant.A, plant.B[:, None], b - a)
        state = Phi @ state + G[:, 0] * first + H[:, 0] * (last - first)
        expected.append(state)
    assert states == pytest.approx(np.array(expected), abs=1e-12 * np.abs(expected).max())


def test_an_angle_in_degrees_and_a_slew_played_on_another_beam():
    beam = bc.hub_beam(modes=1)
    with pytest.warns(UserWarning, match=r"angle = 7 rad: 1\.11 turns; .*angle_deg = 7 .* 0\.122 rad"):
        bc.optimal_slew(beam, 7.0, 200.0)
    slew = bc.optimal_slew(beam, angle_deg=60.0, torque_limit=200.0)
    assert slew.torque_profile.edges == pytest.approx(
        bc.optimal_slew(beam, np.deg2rad(60.0), 200.0).torque_profile.edges, rel=1e-12
    )
    again = beam.simulate(slew)
    assert_allclose(again.tip_displacement, slew.tip_displacement, atol=1e-7)
    listed = TorqueProfile(
        *(getattr(slew.torque_profile, name).tolist() for name in ("edges", "start_values", "end_values"))
    )
    assert_allclose(beam.simulate(listed, slew.time).tip_displacement, again.tip_displacement, atol=1e-12)
    with pytest.raises(ValueError, match="edges: expected finite numbers"):
        replace(listed, edges=listed.edges * np.nan)
    loaded = bc.hub_beam(modes=1, tip_mass=0.1)
    replayed = loaded.simulate(
        bc.maneuvers.applied_torque(slew.torque_profile, breakpoints=slew.torque_profile.breakpoints), slew.time
    )
    assert_allclose(loaded.simulate(slew).tip_displacement, replayed.tip_displacement, atol=1e-12)
    assert_allclose(loaded.simulate(slew.torque_profile, slew.time).hub_angle, replayed.hub_angle, atol=1e-12)
    with pytest.raises(TypeError, match="timepts: expected times"):
        loaded.simulate(slew.torque_profile)
    moving = bc.optimal_slew(beam.linearize(), 0.5, 200.0, initial_state=[0.0, 0.0, 0.1, 0.0])
    with pytest.raises(ValueError, match="initial_state: expected the state that the slew begins with"):
        loaded.simulate(moving)


def linear_problem(modes, tip_mass=0.1, angle=np.pi / 2, limit=200.0):
    beam = bc.hub_beam(bc.HubBeamParameters(tip_mass=tip_mass), model="sfoam", modes=modes).linearize()
    return slew_problem(beam, angle, Limits(limit), "time", None)


@pytest.mark.parametrize("modes", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("tip_mass", "angle", "limit"), [(0.1, np.pi / 2, 200.0), (2.0, 0.3, 50.0), (0.0, -2.0, 400.0)]
)
def test_least_squares_and_linear_program_agree(modes, tip_mass, angle, limit, monkeypatch):
    asked = linear_problem(modes, tip_mass, angle, limit)
    found = linear.least_time(asked)
    monkeypatch.setattr(linear, "_reweighted", lambda *_: None)
    expected = linear.least_time(asked)
    assert found.duration == pytest.approx(expected.duration, rel=1e-13)
    assert found.switches == pytest.approx(expected.switches, abs=1e-10 * expected.duration)


def test_too_few_switches_are_not_taken_for_converged():
    """Solved in least squares, Newton's steps end there too, but the end state is missed."""
    asked = linear_problem(3, 0.0, -2.0, 400.0)
    right = linear.least_time(asked)
    fewer = linear.replace(right, switches=np.delete(right.switches, [3, 4]))
    assert linear._newton(asked, linear._fitted(asked, fewer)) is None


@pytest.mark.parametrize(
    "turn",
    [-0.5, -1e-3, 3e-4, 3.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (-0.2, -0.05, -0.01, 1e-3, 0.1))],
)
def test_minimum_time_between_moving_states_matches_closed_form(turn):
    """A unit inertia at speed 1 swings back through -turn and ends at speed 1, or speeds up and slows down again.

    Braking to -v and returning takes 2 (1 + v) and turns by 1 - v^2; the other way takes 2 (v - 1) and turns by v^2 - 1.
    """
    body = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    slew = bc.optimal_slew(body, None, 1.0, initial_state=[0.0, 1.0], final_state=[turn, 1.0])
    expected = 2.0 + 2.0 * np.sqrt(1.0 - turn) if turn < 0.0 else 2.0 * (np.sqrt(1.0 + turn) - 1.0)
    assert slew.duration == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("factor", [1e-3, 0.3, 3.0])
def test_search_on_a_grid_from_a_guess_far_below_the_time(factor):
    problem = slew_problem(two_masses(), 1.0, Limits(1.0))
    exact = two_masses_exact()[0]
    result = linear._on_grid(problem, factor * exact, linear._GRIDS[0], linear._programmed)
    assert result is not None
    assert result.duration == pytest.approx(exact, rel=2e-3)
