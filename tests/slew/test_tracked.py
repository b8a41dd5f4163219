"""Feedback along a slew: brute force, optimality, no steady error, many runs at once, refusals."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import boomctl as bc
from boomctl.plotting.canvas import figure_of
from tests.simulation.beam_reference import brute_force

NOISE = {"hub_angle": 2e-5, "hub_speed": 2e-4, "root_moment": 0.2}


@pytest.fixture(scope="module")
def slew():
    return bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 140.0)


@pytest.fixture(scope="module")
def known(slew):
    return slew.track(torque_limit=200.0, sample_time=0.02, dwell_time=2.0)


@pytest.fixture(scope="module")
def seen(slew):
    return slew.track(torque_limit=200.0, sample_time=0.02, dwell_time=2.0, measurements=list(NOISE), noise=NOISE)


def _laws(controller):
    """What the controller is at each sample, as the reference takes it."""
    k = [*range(len(controller.A)), *[len(controller.A) - 1] * 10_000]
    each = iter(
        (controller.A[i], controller.B[i], controller.C[i, 0], controller.D[i, 0], controller.anti_windup_gain[i, :, 0])
        for i in k
    )
    return lambda measured: next(each)


def _reads(beam, names):
    size = len(beam.state_labels) // 2
    rows = {name: np.eye(2 * size)[i] for i, name in enumerate(beam.state_labels)} | {
        "root_moment": beam._root_moment_row
    }
    return lambda x, a: [rows[name] @ x for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("which", ["seen", "known"])
def test_tracked_run_matches_restarted_integrator(which, request):
    tracked = request.getfixturevalue(which)
    beam = tracked.plant.with_tip_mass(0.1).with_stiffness_factor(0.8)
    time, names = tracked.time[:120], tracked.controller.input_labels
    step = tracked.controller.dt
    push = 15.0 * np.sin(5.0 * tracked.time)
    level = [tracked.noise.get(name, 0.0) for name in names]
    noise = np.array(level) * np.random.default_rng(3).standard_normal((len(tracked.time), len(names)))
    run = tracked.simulate(beam, disturbance={"disturbance_torque": push}, seed=3, rtol=1e-11, atol=1e-13)
    states, given = brute_force(
        beam, _laws(tracked.controller), {"disturbance_torque": push[:120]}, time, sample_time=step,
        read=_reads(beam, names), force=200.0, noise=noise, reference=[tracked.reference[name][:120] for name in names],
        forward=tracked.feedforward["torque"][:120],
    )  # fmt: skip
    assert np.abs(run["hub_angle"][:120] - states[:, 0]).max() < 1e-9
    tip = states[:, 1:2] @ beam.equations.tip.transverse
    assert np.abs(run["tip_displacement"][:120] - tip).max() < 1e-9 * np.abs(tip).max()
    assert np.abs(run.controls["torque"][:119] - given[:119]).max() < 1e-7 * 200.0
    assert run.saturation_fraction["torque"] > 0.0  # the limit is met, and the observer is told


def test_the_plan_is_held_on_the_machine_planned_for(known):
    run = known.simulate()
    assert known.residual_vibration(run) < 1e-3
    assert np.abs(run["hub_angle"] - known.reference["hub_angle"]).max() < 1e-3
    assert known.time[-1] >= known.duration + 2.0
    assert known.reference["hub_angle"][-1] == pytest.approx(1.0, abs=1e-5)


def test_gains_at_the_end_are_those_of_the_stationary_regulator(known):
    """At rest the last gain is that of the Riccati equation of the linear model, held from sample to sample."""
    from boomctl.lti.hold import zero_order_hold

    beam, step = known.plant, known.controller.dt
    linear = beam._linear(0.0)
    A, B = zero_order_hold(linear.A, linear.B[:, :1], step)
    size = len(A) // 2
    Q = np.zeros_like(A)
    plan = np.column_stack([known.reference[name] for name in beam.state_labels])
    for row in (np.eye(len(A))[0], np.append([0.0, *beam.equations.tip.transverse], np.zeros(size))):
        for each in (row, np.append(np.zeros(size), row[:size])):
            Q += np.outer(each, each) / np.ptp(plan @ each) ** 2
    R = step / 200.0**2 * np.eye(1)
    P = solve_discrete_are(A, B, 1000.0 * step * Q, R)
    wanted = -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)[0]
    assert known.gains[-1] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("which", ["known", "seen"])
def test_a_constant_torque_or_friction_leaves_no_steady_error(which, slew, request):
    tracked = slew.track(torque_limit=200.0, sample_time=0.02, dwell_time=8.0, **_seeing(which))
    without = slew.track(torque_limit=200.0, sample_time=0.02, dwell_time=8.0, integral_time=None, **_seeing(which))
    push = {"disturbance_torque": 10.0}
    held, rubbed = (
        abs(tracked.simulate(noise=0.0, **given)["hub_angle"][-1] - 1.0)
        for given in ({"disturbance": push}, {"friction": 5.0})
    )
    assert held < 2e-5
    assert rubbed < 1e-4
    assert abs(without.simulate(disturbance=push, noise=0.0)["hub_angle"][-1] - 1.0) > 100.0 * held


@pytest.mark.parametrize("which", ["known", "seen"])
def test_the_slowest_pole_is_how_fast_an_error_fades(which, slew):
    tracked = slew.track(torque_limit=200.0, sample_time=0.02, dwell_time=12.0, **_seeing(which))
    run = tracked.simulate(noise=0.0, initial_state=[0.02, 0.0, 0.0, 0.0])
    late = tracked.time > tracked.duration + 8.0
    off = np.abs(run["hub_angle"] - tracked.simulate(noise=0.0)["hub_angle"])[late]
    slope = np.polyfit(tracked.time[late], np.log(off), 1)[0]
    assert -1.0 / slope == pytest.approx(tracked.time_constant, rel=1e-2)


def _seeing(which):
    return {} if which == "known" else {"measurements": list(NOISE), "noise": NOISE}


def test_feedback_holds_a_softer_beam(seen):
    softer = seen.plant.with_stiffness_factor(0.9)
    alone, held = (seen.residual_vibration(seen.simulate(softer, feedback=on, noise=0.0)) for on in (False, True))
    assert alone > 5.0 * held


def test_runs_of_a_study_are_those_of_simulate(seen):
    options = {"delay": 0.01, "rate_limit": 2000.0, "rtol": 1e-6, "atol": 1e-8}
    study = seen.monte_carlo(
        3, 5, stiffness=0.2, tip_mass=(0.0, 0.3), friction=(0.0, 4.0), disturbance_torque=(-3.0, 3.0), **options
    )
    for i in range(3):
        drawn = {name: float(row[i]) for name, row in study.samples.items()}
        true = seen.plant.with_tip_mass(drawn["tip_mass"]).with_stiffness_factor(drawn["stiffness"])
        push, seed = {"disturbance_torque": drawn["disturbance_torque"]}, int(study.seeds[i])
        run = seen.simulate(true, disturbance=push, friction=drawn["friction"], seed=seed, **options)
        for name in ("hub_angle", "hub_speed", "tip_displacement", "root_moment"):
            np.testing.assert_array_equal(study[name][i], run[name])
        np.testing.assert_array_equal(study["torque"][i], run.controls["torque"])
        assert study.residual_vibration[i] == seen.residual_vibration(run)
        assert study.error_estimate >= run.error_estimate


@pytest.mark.slow
def test_what_is_drawn_is_drawn_once_for_all_controllers(known, seen):
    asked = {"runs": 8, "seed": 4, "stiffness": 0.1, "tip_mass": (0.0, 0.1)}
    one, other = known.monte_carlo(**asked), seen.monte_carlo(feedback=False, **asked)
    for name, row in one.samples.items():
        assert (row == other.samples[name]).all()
    assert (np.abs(one.samples["stiffness"] - 1.0) <= 0.1).all()
    fewer = known.monte_carlo(8, 4, tip_mass=(0.0, 0.1))
    assert (fewer.samples["tip_mass"] == one.samples["tip_mass"]).all()
    assert known.monte_carlo(2, tip_mass=(0.0, 0.1)).samples["tip_mass"].tolist() == [0.0, 0.1]  # one for each run
    assert (one.residual_vibration < 0.5 * other.residual_vibration).all()
    assert one["torque"].shape == (8, len(known.time))
    assert np.abs(one["torque"]).max() <= 200.0
    assert len(figure_of(one.plot).axes) == 4
    waited = known.monte_carlo(8, 4, tip_mass=(0.0, 0.1), settling_time=1.0)
    assert waited.residual_vibration.max() < fewer.residual_vibration.max()


def test_a_spin_up_is_held():
    """In steady rotation the plan goes on turning, and so does the machine."""
    plan = bc.optimal_slew(bc.hub_beam(modes=1), None, 140.0, final_speed=1.0)
    tracked = plan.track(torque_limit=200.0, sample_time=0.02, dwell_time=8.0)
    run = tracked.simulate(tracked.plant.with_tip_mass(0.1))
    assert run["hub_speed"][-1] == pytest.approx(1.0, abs=1e-3)
    assert tracked.reference["hub_speed"][-1] == pytest.approx(1.0, abs=1e-6)
