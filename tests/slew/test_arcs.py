"""Bang-bang slews of nonlinear plants: against other methods, against Pontryagin's conditions integrated anew, and halves."""

from functools import partial

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import boomctl as bc
from boomctl.slew.dynamics import kind_of, rates_of
from boomctl.slew.end_map import end_map
from boomctl.slew.least_time.arc_count import counted
from boomctl.slew.least_time.arcs import first_half, halved, least_time_arcs
from boomctl.slew.least_time.linear import least_time
from boomctl.slew.plant import plant_of
from boomctl.slew.problem import Limits, slew_problem
from boomctl.slew.torque import bang_bang

pytestmark = pytest.mark.early

LOADED = bc.HubBeamParameters(tip_mass=0.1)


@pytest.mark.parametrize("modes", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
def test_linear_plants_take_the_time_that_is_proved(modes):
    """From the rigid body's torque, by steps, to the switching times that matrix exponentials give."""
    problem = slew_problem(bc.hub_beam(LOADED, modes=modes).linearize(), 1.0, Limits(150.0))
    exact = least_time(problem)
    rigid = bang_bang(np.array([0.5 * problem.rigid_time]), problem.rigid_time, problem.limits.torque, 1.0)
    found, _ = least_time_arcs(problem, rigid)
    assert found is not None
    assert found.profile.duration == pytest.approx(exact.duration, rel=1e-8)
    assert found.profile.switching_times == pytest.approx(exact.switches, abs=1e-4)  # the time is flat there


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "modes", "payloads"), [("sfoam", 2, ()), ("sfoam", 3, ()), ("sfoam-consistent", 1, (0.3,))]
)
def test_pontryagin_integrated_anew(model, modes, payloads):
    """The costate by an independent integrator: its switching function vanishes at the switches and has the torque's sign."""
    problem = slew_problem(bc.hub_beam(LOADED, model=model, modes=modes), 1.2, Limits(180.0), tip_masses=payloads)
    found, _ = least_time_arcs(problem, least_time(problem).profile)
    assert found is not None
    profile = found.profile
    t = np.linspace(0.0, profile.duration, 1501)
    near = np.abs(t[:, None] - profile.switching_times).min(axis=1)
    adjoint = _adjoint(problem, profile, np.concatenate([profile.switching_times, t]))
    switches, rest = np.split(adjoint.T, [profile.switching_times.size])
    # the costate is a combination of adjoints that the prescribed end allows; the last column is the Hamiltonian's
    weights = np.linalg.svd(switches / np.abs(rest).max(axis=0))[2][-1] / np.abs(rest).max(axis=0)
    p = rest @ weights
    p *= np.sign(p[0]) * np.sign(profile.start_values[0])
    assert np.abs(switches @ weights).max() < 2e-5 * np.abs(p).max()
    assert np.all((p * profile(t) > 0.0)[(near > 2e-3) & (np.abs(p) > 1e-4 * np.abs(p).max())])


def _adjoint(problem, profile, t):
    """For every row of the prescribed end, what a torque at instants t does to it."""
    parts = problem.parts
    return sum(_adjoint_of(plant, problem.start[own], problem.ends[:, own], profile, t) for plant, own in parts)


def _adjoint_of(plant, start, rows, profile, t):
    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    kind, constants = kind_of(plant)
    f = ca.Function("f", [z, u], [rates_of(kind)(z, u, constants)])
    A = ca.Function("A", [z, u], [ca.densify(ca.jacobian(f(z, u), z))])
    b = ca.Function("b", [z, u], [ca.densify(ca.jacobian(f(z, u), u))])
    spans = [*zip(profile.edges[:-1], profile.edges[1:], profile.start_values, strict=True)]
    pieces, answer = [], np.empty((rows.shape[0], t.size))
    for t0, t1, torque in spans:
        right = partial(lambda s, x, torque: np.array(f(x, torque)).ravel(), torque=torque)
        motion = solve_ivp(right, (t0, t1), start, "DOP853", rtol=1e-10, atol=1e-12, dense_output=True)
        pieces.append(motion.sol)
        start = motion.y[:, -1]
    for (t0, t1, torque), along in zip(spans[::-1], pieces[::-1], strict=True):

        def back(s, L, along=along, torque=torque):
            return -(L.reshape(-1, plant.n) @ np.array(A(along(s), torque))).ravel()

        carried = solve_ivp(back, (t1, t0), rows.ravel(), "DOP853", rtol=1e-9, atol=1e-11, dense_output=True)
        for i in np.flatnonzero((t >= t0) & (t <= t1)):
            answer[:, i] = (carried.sol(t[i]).reshape(rows.shape) @ np.array(b(along(t[i]), torque))).ravel()
        rows = carried.y[:, -1].reshape(rows.shape)
    return answer


def test_halves_are_refused_where_the_mirror_image_is_no_slew():
    h, damped = (bc.hub_beam(tip_mass=0.1, modes=1, damping_ratio=zeta) for zeta in (0.0, 0.01))
    assert halved(slew_problem(h, 1.0, Limits(100.0))) is not None
    assert halved(slew_problem(h, None, Limits(100.0), final_speed=1.0)) is None
    assert halved(slew_problem(damped, 1.0, Limits(100.0))) is None
    assert halved(slew_problem(h.linearize(), 1.0, Limits(100.0))) is None


@pytest.mark.parametrize("model", ["tlam", "sfoam", "sfoam-consistent", "foam"])
def test_beams_without_damping_lead_back_in_time_as_they_lead_on(model):
    """Positions turned about a middle, with time and torque reversed, leave the equations of motion alone."""
    plant, random = plant_of(bc.hub_beam(tip_mass=0.1, model=model, modes=2)), np.random.default_rng(0)
    (kind, constants), half = kind_of(plant), plant.n // 2
    turn, middle = np.repeat([-1.0, 1.0], half), plant.rest(1.0, 0.0)
    for _ in range(3):
        z, u = 0.1 * random.standard_normal(plant.n), 100.0 * random.standard_normal()
        here, there = (np.array(rates_of(kind)(*at, constants)).ravel() for at in ((z, u), (turn * z + middle, -u)))
        assert there == pytest.approx(-turn * here, abs=1e-9 * np.abs(here).max())


def test_linear_programs_find_number_of_arcs():
    """Three modes and a payload: the linear part switches 7 times, the beam 11 times."""
    problem = slew_problem(bc.hub_beam(LOADED, modes=3), np.pi / 2, Limits(200.0))
    first = least_time(problem).profile
    half = halved(problem)
    assert half is not None
    ends = end_map(half, first)
    assert first.switching_times.size == 7
    assert 2 * counted(ends, first_half(first), 200).switching_times.size + 1 == 11


@pytest.mark.slow
@pytest.mark.parametrize(("model", "modes"), [("sfoam", 5), ("sfoam", 4), ("foam", 1)])
def test_many_modes(model, modes):
    slew = bc.optimal_slew(bc.hub_beam(LOADED, model=model, modes=modes), np.pi / 2, 200.0, rtol=1e-6)
    assert slew.certificate.method == "switching times"
    assert slew.certificate.optimality_status == "extremal"
    assert slew.certificate.optimality_gap < 1e-6
    assert slew.certificate.prescribed_terminal_error < 1e-6  # axial motion is left free
    assert slew.certificate.constraint_violation < 1e-12


def test_given_states_are_reached():
    h = bc.hub_beam(LOADED, modes=2).linearize()
    start = np.array([0.1, 0.03, -0.002, 0.2, -0.1, 0.02])
    slew = bc.optimal_slew(h, 1.0, 150.0, initial_state=start)
    assert slew.certificate.method == "switching times"
    assert slew.states[0] == pytest.approx(start)
    assert slew.hub_angle[-1] - start[0] == pytest.approx(1.0, abs=1e-6)
    assert slew.certificate.optimality_gap < 1e-6


def test_plant_keeps_identity_of_beam():
    """Equal beams may be simulated to other tolerances, and in another model with more modes."""
    given, by_default = bc.hub_beam(modes=5), bc.hub_beam()
    assert given == by_default
    assert plant_of(given).machine is given
    assert plant_of(by_default).machine is by_default
