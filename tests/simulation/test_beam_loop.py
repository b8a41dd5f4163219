"""The hub-beam in a sampled loop: brute force, the linear limit, conservation, kinematics, refusals."""

import math

import casadi as ca
import control as ct
import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.simulation.machine.exponential_step import stumpff
from boomctl.simulation.machine.run import BLOCK, at_columns
from tests.profiles import examples
from tests.simulation.beam_reference import ATOL, accelerations, brute_force
from tests.simulation.cases import conditioning_gain

_TS = 0.02
_MODELS = ("sfoam", "sfoam-consistent", "tlam", "foam")
_FEW = ["tlam", *(pytest.param(model, marks=pytest.mark.slow) for model in ("sfoam", "sfoam-consistent", "foam"))]
_SLOW_MODELS = [pytest.param("cfoam", marks=pytest.mark.slow)]


def _beam(model="sfoam", modes=3, tip_mass=0.0, damping=0.0):
    return bc.hub_beam(bc.HubBeamParameters(tip_mass=tip_mass, damping_ratio=damping), model=model, modes=modes)


def _law(names=("hub_angle", "hub_speed"), dt=_TS):
    """A filter of the first measurement and gains: all matrices that a controller has."""
    A, B = np.array([[0.6]]), np.array([[0.4, 0.02]])
    C, D = np.array([[-60.0]]), np.array([[-80.0, -240.0]])
    return ct.ss(A, B, C, D, dt, inputs=list(names), outputs=["torque"])


def _matrices(law):
    A, B, C, D = (np.asarray(each) for each in (law.A, law.B, law.C, law.D))
    return A, B, C[0], D[0], conditioning_gain(A, B, C, D)[:, 0]


def _apart(found, true):
    """How far outputs are from the true ones, beyond what those are solved to, of the largest of each, by name."""
    apart = {name: max(np.abs(found[name] - row).max() - ATOL, 0.0) for name, row in true.items()}
    return {name: apart[name] / (np.abs(row).max() or 1.0) for name, row in true.items()}


def _outputs(beam, states):
    size = beam.equations.size
    tip = states[:, 1:size] @ beam.equations.tip.transverse
    root = states @ beam._root_moment_row
    return {"hub_angle": states[:, 0], "hub_speed": states[:, size], "tip_displacement": tip, "root_moment": root}


SCENES = {
    "later": {"delay": 0.0531},
    "a sample": {"delay": _TS},
    "nearly a sample": {"delay": _TS - 1e-9, "rate": 60.0},
    "over a sample": {"delay": _TS + 1e-9, "force": 25.0},
    "limits": {"delay": 0.013, "force": 25.0, "rate": 60.0},
    "rounded": {"delay": 0.007, "force": 20.0, "quantum": 1e-3},
    "everything": {"delay": 0.027, "force": 40.0, "rate": 100.0, "noise": True, "forward": True, "quantum": 1e-3},
}


def run_both(beam, scene, time, law, matrices=None, **more):
    """Return a run, and the states of the same by brute force."""
    disturbance = {"tip_force": 0.4 * np.sin(3.0 * time), "disturbance_torque": 5.0 * np.cos(2.0 * time)}
    reference = {"hub_angle": 0.4 * (1.0 - np.cos(time)), "hub_speed": 0.4 * np.sin(time)}
    forward = 10.0 * np.cos(time) if scene.get("forward") else None
    samples = round((time[-1] - time[0]) / _TS) + 1
    sigma = np.array([2e-3, 5e-3])
    noise = sigma * np.random.default_rng(7).standard_normal((samples, 2)) if scene.get("noise") else None
    found = bc.simulate_loop(
        beam,
        law,
        time,
        disturbance,
        sample_time=_TS,
        delay=scene.get("delay", 0.0),
        control_limit=scene.get("force"),
        rate_limit=scene.get("rate"),
        quantization=scene.get("quantum"),
        noise=dict(zip(("hub_angle", "hub_speed"), sigma, strict=True)) if noise is not None else None,
        seed=7,
        reference=reference,
        feedforward=None if forward is None else {"torque": forward},
        rtol=1e-10,
        atol=1e-14,
        **more,
    )
    options = {**scene, "noise": noise, "forward": forward, "reference": list(reference.values())}
    states, given = brute_force(
        beam,
        matrices or _matrices(law),
        disturbance,
        time,
        sample_time=_TS,
        read=lambda x, a: (x[0], x[len(x) // 2]),
        start=more.get("initial_state"),
        **options,
    )
    return found, states, given


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "scene"),
    [*(("sfoam", scene) for scene in SCENES), *((model, "limits") for model in (*_MODELS[1:], "cfoam"))],
)
def test_the_loop_is_what_brute_force_finds(model, scene):
    beam, time = _beam(model, 2, 0.2, damping=0.02), np.linspace(0.0, 0.5, 51)
    found, states, given = run_both(beam, SCENES[scene], time, _law())
    apart = _apart(found, _outputs(beam, states))
    assert max(apart.values()) < 1e-8, apart
    np.testing.assert_allclose(found.states, states, rtol=0.0, atol=1e-8 * np.abs(states).max())
    late = int(np.ceil(SCENES[scene].get("delay", 0.0) / 0.01 - 1e-9))
    acting = np.array([given[(k - late) // 2] if k >= late else 0.0 for k in range(len(time))])
    np.testing.assert_allclose(found.controls["torque"], acting, atol=1e-7 * np.abs(given).max())
    if "force" in SCENES[scene]:
        assert found.saturation_fraction["torque"] > 0.0
    if "rate" in SCENES[scene]:
        assert found.rate_limit_fraction["torque"] > 0.0


@pytest.mark.parametrize(("model", "step", "count"), [("sfoam", 0.005, 81), ("sfoam-consistent", 0.04, 11)])
def test_times_finer_and_coarser_than_the_samples(model, step, count):
    beam, time = _beam(model, 2, 0.1), 3.0 + step * np.arange(count)
    half = len(beam.state_labels) // 2
    start = np.zeros(2 * half)
    start[[0, half - 2, half - 1, half, -2]] = 0.1, 0.02, -0.001, 0.2, 0.05
    found, states, _ = run_both(beam, {"delay": 0.031, "rate": 300.0}, time, _law(), initial_state=start)
    apart = _apart(found, _outputs(beam, states))
    assert max(apart.values()) < 1e-8, apart


def test_a_long_delay_waits_in_the_log_as_in_a_queue(monkeypatch):
    from boomctl.simulation.machine import run

    beam, time, law = _beam(modes=2), np.linspace(0.0, 0.4, 41), _law()
    law = ct.ss(law.A, law.B, 0.05 * law.C, 0.05 * law.D, _TS, inputs=law.input_labels, outputs=law.output_labels)
    queue, _, _ = first = run_both(beam, {"delay": 0.093}, time, law)
    monkeypatch.setattr(run, "_LONGEST_QUEUE", 1)
    log, _, _ = run_both(beam, {"delay": 0.093}, time, law)
    for name in queue.outputs:
        np.testing.assert_allclose(log[name], queue[name], rtol=0.0, atol=1e-13 * np.abs(queue[name]).max())
    apart = _apart(queue, _outputs(beam, first[1]))
    assert max(apart.values()) < 1e-8, apart


@pytest.mark.parametrize(
    "model", ["sfoam", *(pytest.param(name, marks=pytest.mark.slow) for name in (*_MODELS[1:], "cfoam"))]
)
def test_the_stated_error_is_not_below_the_true_one(model):
    beam, time = _beam(model, 2, 0.1), np.linspace(0.0, 1.0, 51)
    drive = {"torque": 150.0 * np.sin(5.0 * time), "tip_force": np.cos(7.0 * time)}
    true = bc.simulate_loop(beam, None, time, drive, sample_time=0.02, rtol=1e-12, atol=1e-15)
    for rtol in (1e-3, 1e-6, 1e-9):
        run = bc.simulate_loop(beam, None, time, drive, sample_time=0.02, rtol=rtol, atol=1e-15)
        apart = np.abs(run["tip_displacement"] - true["tip_displacement"]).max()
        assert apart <= run.error_estimate + 2.0 * true.error_estimate + 1e-14
        assert run.error_estimate <= 1e-15 + rtol * 9.0 * np.abs(run["hub_angle"]).max()


@pytest.mark.parametrize("model", [*_MODELS, *_SLOW_MODELS])
def test_sensors_read_the_shape_and_its_accelerations(model):
    beam = _beam(model, 3, 0.1)
    half = beam.equations.size
    rng = np.random.default_rng(3)
    start = 0.02 * rng.standard_normal(2 * half)
    if beam.has_axial_modes:
        start[1:4], start[half + 1 : half + 4] = 1e-4 * start[1:4], 1e-2 * start[half + 1 : half + 4]
    start[half] = 1.3
    # the shape is drawn at 41 places on 8 m
    sensors = [
        bc.BeamSensor(f"{kind}_{k}", kind, 0.2 * k) for kind in ("displacement", "acceleration") for k in (15, 40)
    ]
    sensors += [bc.BeamSensor(f"slope_{k}", "slope", 0.2 * k) for k in (14, 15, 16)]
    sensors += [bc.BeamSensor("gauge", "strain", 3.0, 0.01), bc.BeamSensor("axis", "strain", 3.0, 0.0)]
    sensors += [bc.BeamSensor("moment", "moment", 3.0), bc.BeamSensor("clamp", "moment", 0.0)]
    forces = np.array([30.0, 5.0, 0.7])
    drive = {name: np.full(2, f) for name, f in zip(("torque", "disturbance_torque", "tip_force"), forces, strict=True)}
    run = bc.simulate_loop(beam, None, [0.0, 1e-4], drive, sample_time=1e-4, initial_state=start, sensors=sensors)
    turned = np.exp(-1j * start[0])

    def position(t):
        a = accelerations(beam, start[:half], start[half:], forces)
        return beam.deformed_shape(np.concatenate([start[:half] + t * start[half:] + 0.5 * t**2 * a, start[half:]]))[0]

    h = 1e-3
    here = position(0.0) * turned
    second = (-position(2 * h) + 16 * position(h) - 30 * position(0.0) + 16 * position(-h) - position(-2 * h)) / (
        12 * h**2
    )
    for k in (15, 40):
        assert run[f"displacement_{k}"][0] == pytest.approx(here[k].imag, abs=1e-13)
        assert run[f"acceleration_{k}"][0] == pytest.approx((second * turned)[k].imag, rel=1e-6)
    assert run["tip_acceleration"][0] == pytest.approx(run["acceleration_40"][0], rel=1e-13)
    assert run["clamp"][0] == pytest.approx(run["root_moment"][0], rel=1e-13)
    assert run["root_moment"][0] == pytest.approx(beam._root_moment_row @ start, rel=1e-10)
    # Simpson's rule on the slopes; the curvature turns moment and strain
    across = run["slope_14"][0] + 4.0 * run["slope_15"][0] + run["slope_16"][0]
    assert (here[16] - here[14]).imag == pytest.approx(0.4 / 6.0 * across, rel=1e-2)
    curvature = run["moment"][0] / beam.parameters.bending_stiffness
    assert run["gauge"][0] - run["axis"][0] == pytest.approx(-0.01 * curvature, rel=1e-12)
    assert (run["axis"][0] == 0.0) is not beam.has_axial_modes


def test_noise_reproducible_with_its_variance():
    time = 0.01 * np.arange(4001)
    plant = ct.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs=["u"], outputs=["y"])
    law = ct.ss([], [], [], [[-1.0]], 0.01, inputs=["y"], outputs=["u"])
    runs = [bc.simulate_loop(plant, law, time, None, sample_time=0.01, noise=0.3, seed=seed) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(runs[0].commanded["u"], runs[1].commanded["u"])
    assert not np.array_equal(runs[0].commanded["u"], runs[2].commanded["u"])
    heard = -(runs[0].commanded["u"] + runs[0]["y"])
    assert np.std(heard) == pytest.approx(0.3, rel=0.05)
    quiet = bc.simulate_loop(plant, law, time, {"u": np.ones(time.size)}, sample_time=0.01, noise=0.0)
    plain = bc.simulate_loop(plant, law, time, {"u": np.ones(time.size)}, sample_time=0.01)
    np.testing.assert_array_equal(quiet["y"], plain["y"])


@pytest.mark.parametrize("model", _FEW)
def test_small_motions_match_linear_model(model):
    beam, time, small = _beam(model, 3, 0.1, damping=0.01), np.linspace(0.0, 2.0, 201), 1e-6
    kinds = {"displacement": None, "slope": None, "moment": None, "acceleration": None, "strain": 0.01}
    sensors = [bc.BeamSensor(kind, kind, 3.0, height) for kind, height in kinds.items()]
    rows = {"tip_force": 0.1 * small * np.cos(4.0 * time), "disturbance_torque": small * np.sin(3.0 * time)}
    read = ["hub_angle", "hub_speed", "slope", "tip_acceleration"]
    law = ct.ss([], [], [], [[-80.0, -240.0, -80.0, -2.0]], _TS, inputs=read, outputs=["torque"])
    reference = {"hub_angle": np.full(time.size, small)}
    options = {"sample_time": _TS, "delay": 0.013, "control_limit": 50.0 * small, "atol": 1e-16}
    options |= {"reference": reference, "feedforward": {"torque": 20.0 * small * np.cos(time)}}
    linear = bc.simulate_loop(beam.linearize(sensors=sensors), law, time, rows, **options)
    nonlinear = bc.simulate_loop(beam, law, time, rows, sensors=sensors, **options)
    assert linear.saturation_fraction["torque"] > 0.0
    assert set(linear.outputs) == set(nonlinear.outputs)
    for name in linear.outputs:
        atol = (1e-6 if "acceleration" in name else 1e-7) * np.abs(linear[name]).max()
        np.testing.assert_allclose(nonlinear[name], linear[name], rtol=0.0, atol=atol)


@pytest.mark.parametrize("model", [*_MODELS, *_SLOW_MODELS])
def test_the_linear_model_with_sensors_holds_the_one_without(model):
    beam = _beam(model, 2, 0.1, damping=0.02)
    for speed in (0.0, 1.3):
        plain, whole = beam.linearize(speed), beam.linearize(speed, sensors=())
        assert whole.input_labels == ["torque", "disturbance_torque", "tip_force"]
        np.testing.assert_allclose(whole.A, plain.A, rtol=0.0, atol=1e-9 * np.abs(plain.A).max())
        np.testing.assert_allclose(whole.B[:, :1], plain.B, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(whole.B[:, 1], whole.B[:, 0], rtol=1e-12)
        np.testing.assert_allclose(whole.C[:3], plain.C, rtol=0.0, atol=1e-12)
        # a force at the tip moves the tip as a torque turns it: reciprocity of what is conservative
        mobility = whole.C[[0, 2]] @ whole.A @ whole.B[:, [0, 2]]
        if not speed:
            reach = beam.parameters.hub_radius + beam.parameters.length
            assert mobility[1, 0] + reach * mobility[0, 0] == pytest.approx(mobility[0, 1], rel=1e-9)


@pytest.mark.parametrize("count", [1, BLOCK + 1])
def test_at_columns_sparse_function_equals_plain_call(count):
    x, sparse = ca.SX.sym("x", 3), ca.SX(4, 1)
    sparse[0], sparse[2] = x[0] * x[1], ca.sin(x[2])
    function = ca.Function("some", [x], [ca.sumsqr(x), sparse])
    given = np.random.default_rng(count).normal(size=(3, count))
    for found, wanted in zip(at_columns(function, given), function(given), strict=True):
        np.testing.assert_array_equal(found, np.array(ca.densify(wanted)))


@examples(60)
@given(st.floats(1e-8, 1e4))
def test_stumpff_functions(y):
    values = [float(item) for item in stumpff(np.array(y))]
    with mpmath.workdps(40):
        for k, value in enumerate(values, start=1):
            exact = mpmath.hyper([1], [mpmath.mpf(k + 1) / 2, mpmath.mpf(k + 2) / 2], -mpmath.mpf(y) / 4)
            # away from 0 the functions oscillate about 1/y: that is the size to compare with
            assert value == pytest.approx(float(exact / math.factorial(k)), rel=1e-12, abs=1e-14 / max(1.0, y))
