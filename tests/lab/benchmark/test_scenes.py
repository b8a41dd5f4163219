"""The scenes of the benchmark: references agree with others, peers solve the same problems, and every method answers."""

import re
from dataclasses import replace

import casadi as ca
import control
import numpy as np
import pytest
from scipy import linalg, signal

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.exact_steps import extended_maps, extrapolated_step
from boomctl.lab.benchmark.high_precision import exact_response, tip_transfer
from boomctl.lab.benchmark.measure import scene_at
from boomctl.lab.benchmark.plain_boom import PlainBoom, banded_sigma, control_boom, control_sigma
from boomctl.lab.benchmark.report import SCENES
from boomctl.lab.benchmark.scenes import boom, loops, synthesis
from boomctl.lab.benchmark.scenes.hub_beam import (
    SPIN_UP,
    TORQUE,
    equations,
    machine,
    scipy_motion,
    sundials,
    time_points,
)
from boomctl.lab.benchmark.scenes.identification import STEP, frequency_errors, subspace_frequencies
from boomctl.lab.benchmark.scenes.slews import end_error, least_effort, least_time, opti_torque, slew_of
from boomctl.lti.rounding import SUMMED
from boomctl.rotating_beam import AssumedModesBeam
from boomctl.slew import optimal_slew
from boomctl.slew.torque import ramped
from tests.fifty_digits import mesh_response

P = BoomParameters()


def apart(found, true):
    return np.abs(found - true).max() / np.abs(true).max()


@pytest.mark.slow
@pytest.mark.parametrize("key", SCENES)
def test_scene_first_settings_answer_with_a_useful_error(key):
    scene = scene_at(SCENES[key])
    problem = scene.problem()
    reference = scene.reference(problem)
    first = {s.method: s for s in reversed(scene.settings)}  # of each method the one with the largest error
    for setting in first.values():
        if not setting.missing and "pyMOR" not in setting.method and setting.method != "control.hinfsyn":
            error = scene.error(problem, reference, setting.solve(problem, 0.0))
            assert 0.0 < error < 20.0, setting.method


def test_plain_boom_is_the_mesh_in_fifty_digits():
    plain, omega = PlainBoom.of(P, 6), np.array([0.7, 3.0, 40.0])
    A, B, C, D = plain.statespace()
    values = banded_sigma(plain, omega)
    for k, true in enumerate(np.moveaxis(mesh_response(P, omega, 6), 2, 0)):
        s = 1j * omega[k]
        direct = np.linalg.solve(plain.K + s * plain.C + s * s * plain.M, plain.F + s * plain.G)[[0, -2]]
        states = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
        for found in (direct, states):
            assert found == pytest.approx(true, rel=1e-9)
        assert values[:, k] == pytest.approx(np.linalg.svd(true, compute_uv=False), rel=1e-9)
    assert control_sigma(control_boom(plain), omega) == pytest.approx(values, rel=1e-9)


def test_tip_transfer_is_the_exact_response_by_halves():
    import mpmath as mp

    response = exact_response(P, np.array([2.0]))[:2, :2, 0]
    with mp.workdps(50):
        alike, opposite = tip_transfer(P, mp.mpc(0, 2.0))
    assert complex(alike) == pytest.approx(response[0, 0] + response[0, 1], rel=1e-14)
    assert complex(opposite) == pytest.approx(response[0, 0] - response[0, 1], rel=1e-14)


@pytest.mark.slow
def test_motion_of_the_reference_is_ours_on_the_same_mesh():
    time, motion = boom.wheels()
    model = bc.spray_boom(P, "high-order", 8, order=8)
    ours = bc.forced_response(model, time, dict(zip(ACTUATORS, motion, strict=True)), TIPS, rtol=1e-9)
    assert apart(boom.exact_motion(P, time, motion), np.array([ours[name] for name in TIPS])) < 1e-8


def test_extended_maps_are_matrix_exponentials():
    rng = np.random.default_rng(1)
    A, B = 30.0 * rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    Phi, held, ramp = extended_maps(A, B, 0.1)
    np.testing.assert_allclose(Phi.astype(float), linalg.expm(0.1 * A), rtol=1e-9)
    np.testing.assert_allclose((A @ held).astype(float), (Phi - np.eye(4)) @ B, rtol=1e-9)
    np.testing.assert_allclose((A @ ramp).astype(float), (held - 0.1 * B).astype(float) / 0.1, rtol=1e-8)


@pytest.mark.slow
def test_boom_loop_meets_its_limit_and_all_solve_it():
    loop = loops.BoomLoop.of()
    exact = loop.exact()
    assert apart(loop.simulated(), exact) <= SUMMED
    assert apart(loop.simulated(limit=1e9), exact) > 1e-3
    assert SUMMED < apart(loop.loop.restarted("RK45", 1e-6), exact) < 1e-6
    assert 1e-6 < apart(loop.responded("RK45", 1e-6), exact) < 1e-3  # its controller is continuous


@pytest.mark.slow
def test_beam_loop_reference_agrees_with_an_implicit_integrator():
    beam, time = loops.beam(modes=3), np.linspace(0.0, 0.05, 51)
    reference = loops.beam_reference(beam, time)
    assert apart(loops.loop_of(beam, time).restarted("Radau", 1e-12), reference) < 1e-8
    assert apart(loops.simulated(beam, time, 1e-8), reference) < 1e-10


def extrapolated(system, tip, timepts, substeps, columns=8):
    """Return the tip's displacement in equal steps of order ``2 columns``, from rest."""
    h = float(timepts[1]) / substeps
    rate = ca.Function("rate", [system["x"], system["t"]], [system["ode"]], {"cse": True})
    x, t = ca.SX.sym("x", len(tip)), ca.SX.sym("t")
    step = ca.Function("step", [x, t], [extrapolated_step(rate, x, t, h, columns)])
    state, found = np.zeros(len(tip)), np.zeros(timepts.size)
    for k in range(1, timepts.size):
        for i in range(substeps):
            state = step(state, ((k - 1) * substeps + i) * h)
        found[k] = tip @ np.array(state).ravel()
    return found


def test_extrapolation_is_exact_for_a_forced_oscillator():
    x, t = ca.SX.sym("x", 2), ca.SX.sym("t")
    system = {"x": x, "t": t, "ode": ca.vertcat(x[1], ca.sin(2.0 * t) - 9.0 * x[0])}
    time = np.linspace(0.0, 10.0, 101)
    exact = (np.sin(2.0 * time) - 2.0 / 3.0 * np.sin(3.0 * time)) / 5.0
    assert extrapolated(system, np.array([1.0, 0.0]), time, 1) == pytest.approx(exact, abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("maneuver", [SPIN_UP, TORQUE], ids=["spin-up", "torque"])
def test_hub_beam_keeps_its_tolerance_on_equations_of_others(maneuver):
    beam, time = AssumedModesBeam(machine(), "sfoam", 5), time_points(12.0)
    exact = extrapolated(*equations(beam, maneuver), time, 10)
    for rtol, error in ((1e-4, 1e-5), (1e-6, 1e-6), (1e-8, 1e-8), (1e-12, 5e-12)):
        assert apart(beam.simulate(maneuver, time, rtol=rtol, atol=1e-15).tip_displacement, exact) < error
    for found in (sundials(beam, maneuver, time, "IDAS", 1e-8), scipy_motion(beam, maneuver, time, "LSODA", 1e-8)):
        assert apart(found, exact) < 1e-5


def test_end_error_is_that_of_a_replay():
    slew = slew_of(modes=1, duration=3.2)
    found = optimal_slew(slew.beam, slew.angle, slew.torque_limit, "effort", slew.duration, intervals=40).torque_profile
    assert end_error(slew, found) < 1e-6
    assert (
        end_error(slew, replace(found, start_values=1.01 * found.start_values, end_values=1.01 * found.end_values))
        > 1e-2
    )
    with pytest.raises(ValueError, match="held"):
        end_error(slew, ramped(np.linspace(0.0, 1.0, 3), np.array([0.0, 1.0, 0.0])))


@pytest.mark.slow
@pytest.mark.parametrize(("modes", "duration", "rel"), [(1, 3.2, 1e-6), (3, 3.0, 5e-7)])
def test_references_of_slews_are_ours(modes, duration, rel):
    slew = slew_of(modes=modes, duration=duration)
    ours = [
        optimal_slew(slew.beam, slew.angle, 200.0, "effort", duration, intervals=n).cost
        for n in ((100, 200) if modes == 1 else (200, 400))
    ]
    assert least_effort(slew, 100 if modes == 1 else 400) == pytest.approx(ours[1] - (ours[0] - ours[1]) / 3.0, rel=rel)
    assert optimal_slew(slew.beam, slew.angle, 200.0).duration == pytest.approx(least_time(slew, 100), rel=1e-9)


@pytest.mark.slow
def test_opti_has_the_optimum_of_ours():
    slew = replace(slew_of(modes=1, duration=2.8), angle=0.8, torque_limit=140.0).on(40)
    ours = optimal_slew(slew.beam, 0.8, 140.0, "effort", 2.8, intervals=40).torque_profile.start_values
    theirs = opti_torque(slew, 8).start_values
    assert theirs == pytest.approx(ours, abs=1e-3 * slew.torque_limit)
    assert np.abs(theirs).max() == pytest.approx(slew.torque_limit, rel=1e-6)  # the limit binds
    least, held = optimal_slew(slew.beam, 0.8, 140.0).duration, opti_torque(slew, 8, fastest=True)
    assert least < held.duration < 1.001 * least
    with pytest.raises(RuntimeError):
        opti_torque(replace(slew, duration=1.0))


def test_unstable_loop_has_infinite_excess():
    plant = control.ss(1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    design = bc.h_infinity(plant, 1, 1, rtol=1e-3)
    lower = design.certificate.lower_bound
    assert 0.0 < synthesis.excess(plant, lower, design.controller) < 1.1e-3
    assert synthesis.excess(plant, lower, control.ss([], [], [], [[0.0]])) == np.inf


@pytest.mark.slow
def test_level_that_slycot_is_told_is_the_least():
    scene = synthesis.h_infinity_scene()
    plant = scene.problem()
    lower = scene.reference(plant)
    assert pytest.approx(lower, rel=1e-6) == synthesis._BEST
    for setting in scene.settings:
        if setting.ours and not setting.size:
            number, percent = re.search(r"([\d.e-]+)(%?)", setting.label.removeprefix("rtol ")).groups()
            asked = float(number) * (0.01 if percent else 1.0)
            assert scene.error(plant, lower, setting.solve(plant, 0.0)) <= asked * (1.0 + 1e-6), setting.label
    found = control.hinfsyn(plant, 2, 2)[0]
    assert lower * (1.0 - 1e-9) <= synthesis.excess(plant, lower, found) * lower + lower


@pytest.mark.parametrize("method", ["MOESP", "N4SID"])
def test_subspace_peer_is_exact_without_errors(method):
    pytest.importorskip("ctrlsys")
    rng, hz = np.random.default_rng(0), np.array([40.0, 170.0])
    poles = np.exp((-3.0 + 2j * np.pi * hz) * STEP)
    A = np.kron(np.diag(poles.real), np.eye(2)) + np.kron(np.diag(poles.imag), [[0.0, 1.0], [-1.0, 0.0]])
    B, C, D = (rng.standard_normal(shape) for shape in ((4, 2), (3, 4), (3, 2)))
    u = rng.standard_normal((2000, 2))
    y = signal.dlsim((A, B, C, D, 1.0), u)[1]
    assert frequency_errors(subspace_frequencies(method, 4, u, y, STEP), hz).max() < 1e-9
