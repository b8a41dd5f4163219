"""Scaled signals: systems that carry their scales, and functions that reject a controller in other scales."""

import pickle
from copy import deepcopy

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import boomctl as bc
from tests.synthesis.plants import yaw_plant

T = 0.02
SCALES = {"actuator_anti": 0.03, "suspension_anti": 150.0, "tip_anti": 0.2, "stroke_anti": 0.05}
scale = st.floats(1e-3, 1e3)


def weighted(plant):
    weights = {"disturbances": {"actuator_anti": bc.low_pass(1.0, 2.0)}, "effort": {"suspension_anti": 0.5}}
    return yaw_plant("stroke_anti", noise=0.02, plant=plant, **weights)


BOOM = bc.spray_boom(elements=2)
YAW = bc.split_symmetric(BOOM)[1]
SCALED = bc.scale_signals(YAW, SCALES)
P = weighted(SCALED)


@pytest.fixture(scope="module")
def design():
    return bc.h2(P)


def plant() -> control.StateSpace:
    rng = np.random.default_rng(3)
    A = rng.standard_normal((4, 4)) - 4.0 * np.eye(4)
    B, C, D = rng.standard_normal((4, 2)), rng.standard_normal((2, 4)), rng.standard_normal((2, 2))
    return control.ss(A, B, C, D, inputs=["push", "pull"], outputs=["stroke", "tip"])


def law() -> control.StateSpace:
    return control.ss([[-2.0]], [[1.0]], [[0.3]], 0.1, inputs=["stroke"], outputs=["push"])


@given(scale, scale)
def test_closed_loop_poles_invariant_to_scales(push, stroke):
    scales = {"push": push, "pull": 2.0, "stroke": stroke, "tip": 0.5}
    G, K, poles = plant(), law(), []
    scaled, unscaled = bc.scale_signals(G, scales), bc.unscale_controller(K, {"push": push, "stroke": stroke})
    for system, loop in ((scaled, K), (G, unscaled)):
        one = control.ss(system.A, system.B[:, [0]], system.C[[0]], system.D[[0]][:, [0]])
        poles.append(np.sort_complex(control.feedback(one, control.ss(loop.A, loop.B, loop.C, loop.D), sign=1).poles()))
    assert_allclose(*poles, rtol=1e-8, atol=1e-8)
    assert scaled.scales == scales
    assert_allclose(scaled(0.5j)[1, 0], G(0.5j)[1, 0] * push / 0.5)


@pytest.mark.parametrize(
    ("scales", "message"),
    [
        ({"push": 0.0, "stroke": 0.05}, r"scales\['push'\] = 0"),
        ({"push": 100.0, "stroke": 0.05, "pushes": 2.0}, "entry for each signal.* and no other, got one for 'pushes'"),
        ({"push": 100.0}, "entry for each signal.* got none for 'stroke'"),
        ({"push": 1e-310, "stroke": 0.05}, "at least 1e-100"),
    ],
)
def test_scales_invalid_raises(scales, message):
    with pytest.raises(ValueError, match=message):
        bc.scale_signals(plant(), {"pull": 1.0, "tip": 0.2} | scales)
    with pytest.raises(ValueError, match=message):
        bc.unscale_controller(law(), scales)


def test_scaled_system_keeps_scales(design):
    assert isinstance(SCALED, bc.ScaledStateSpace)
    for system in (
        bc.reduce(SCALED, order=4).system,
        P,
        bc.mixed_sensitivity(SCALED, W1=1.0),
        bc.with_state_outputs(SCALED),
        bc.analysis.sample_plant(SCALED, T),
        bc.reduce(bc.analysis.sample_plant(SCALED, T), order=4).system,
        bc.synthesis.select_channels(SCALED, outputs="stroke_anti"),
        bc.discretize(design.scaled_controller, 1e-3),
        bc.feedback_loop(SCALED, design),
        bc.kalman(SCALED, {"actuator_anti": 1.0}, 1.0).estimator,
        bc.lqr(SCALED, None, 1.0, output_weight=1.0, controls="suspension_anti").closed_loop,
        pickle.loads(pickle.dumps(SCALED)),
        deepcopy(SCALED),
    ):
        labels = (*system.input_labels, *system.output_labels)
        assert {SCALES[label] == system.scales[label] for label in labels if label in SCALES} == {True}
    assert bc.mixed_sensitivity(SCALED, W1=1.0).scales["error_stroke_anti"] == SCALES["stroke_anti"]
    assert not hasattr(bc.lft(P, design), "scales")
    assert not hasattr(2.0 * SCALED, "scales")
    unscaled = bc.h2(weighted(YAW))
    assert_allclose(unscaled.controller.B, unscaled.scaled_controller.B)
    assert not hasattr(unscaled.scaled_controller, "scales")


DESIGNS = {
    "h2": bc.h2,
    "h_infinity": bc.h_infinity,
    "tune": lambda P: bc.tune(P, structure=bc.tunable.gain(), n_starts=1),
    "reduce_controller": lambda P: bc.reduce_controller(P, bc.h2(P), max_degradation=0.5),
    "lqg": lambda P: bc.lqg(
        P, None, 1.0, {"w_actuator_anti": 1.0}, 1.0, "stroke_anti", "suspension_anti", output_weight={"z_tip_anti": 1.0}
    ),
}


@pytest.mark.parametrize("method", DESIGNS)
@pytest.mark.parametrize("dt", [0.0, pytest.param(T, marks=pytest.mark.slow)])
def test_design_controller_in_machine_units(method, dt):
    """The loop gain at one frequency, computed from the matrices, is that of the scaled loop."""
    if dt and method == "tune":
        pytest.skip("continuous time only")
    plants = [bc.analysis.sample_plant(system, T) if dt else system for system in (YAW, SCALED)]
    design = DESIGNS[method](weighted(plants[1]))
    assert type(design.controller) is control.StateSpace
    point = np.exp(0.7j * T) if dt else 0.7j
    gains, margins = [], []
    for system, K in zip(plants, (design.controller, design.scaled_controller), strict=True):
        G = system if isinstance(system, control.StateSpace) else system.to_statespace()
        entry = bc.synthesis.select_channels(G, "suspension_anti", "stroke_anti")
        gains.append(entry(point) * K(point))
        margin = bc.margins(system, design)["suspension_anti"]
        margins.append([margin.phase_margin_deg, margin.disk_margin.alpha])
    assert_allclose(*gains, rtol=1e-8)
    assert_allclose(*margins, rtol=1e-6)
    bc.prove(design)


def sampled(K):
    return bc.discretize(K, T, samples_per_period=2.0)


def stroke_gain(side):
    return control.ss([], [], [], [[-200.0]], inputs=f"stroke_{side}", outputs=f"suspension_{side}")


EITHER = {  # calls with a plant in units of the machine, or scaled, and a controller
    "margins": bc.margins,
    "nyquist": bc.nyquist,
    "feedback_loop": bc.feedback_loop,
    "simulate_loop": lambda G, K: bc.simulate_loop(G, K, np.linspace(0.0, 0.1, 6), None, sample_time=T),
    "sampled_data_norm": lambda G, K: bc.analysis.sampled_data_norm(G, sampled(K)),
    "reduce_controller": lambda G, K: bc.reduce_controller(weighted(G), K),
    "tune": lambda G, K: bc.tune(weighted(G), structure=bc.tunable.state_space(9), initial_controller=K, n_starts=1),
}
MACHINE = {  # in units of the machine alone
    "lft": lambda yaw, K: bc.lft(weighted(yaw), K),
    "compare": lambda yaw, K: bc.compare({"passive": yaw, "active": bc.feedback_loop(SCALED, K)}),
    "worst_case": lambda _, K: bc.worst_case(bc.boom_family(subsystem="yaw"), K),
    "worst_case sampled": lambda _, K: bc.worst_case(bc.boom_family(subsystem="yaw"), sampled(K)),
    "robust_stability": lambda _, K: bc.robust_stability(bc.boom_family(subsystem="yaw"), K),
    "robust_stability_margin": lambda _, K: bc.analysis.robust_stability_margin(bc.boom_family(subsystem="yaw"), K),
    "closed_loop_response": lambda yaw, K: bc.analysis.closed_loop_response(
        yaw.frequency_response(np.array([1.0, 2.0])), K
    ),
    "join_symmetric": lambda _, K: bc.join_symmetric(BOOM, stroke_gain("sym"), K),
    "schedule": lambda _, K: bc.gain_schedule([K, K], [0.0, 1.0]),
}


@pytest.mark.parametrize("call", [*EITHER.values(), *MACHINE.values()], ids=[*EITHER, *MACHINE])
def test_scaled_controller_with_unscaled_plant_raises(design, call):
    with pytest.raises(ValueError, match=r"units of the machine.*\.controller|same scales"):
        call(YAW, design.scaled_controller)


@pytest.mark.parametrize("call", EITHER.values(), ids=EITHER)
def test_unscaled_controller_with_scaled_plant_raises(design, call):
    with pytest.raises(ValueError, match=r"must be in scaled signals.*\.scaled_controller"):
        call(SCALED, design.controller)


def test_controller_in_matching_scales_accepted(design):
    for name in ("margins", "nyquist", "feedback_loop", "simulate_loop"):  # others weigh the plants differently
        EITHER[name](YAW, design.controller)
        EITHER[name](YAW, design)
        EITHER[name](SCALED, design.scaled_controller)
    for name in MACHINE.keys() - {"compare", "lft"}:
        MACHINE[name](YAW, design.controller)
    MACHINE["worst_case sampled"](YAW, design)
    poles = [np.sort_complex(bc.lft(P, K).poles()) for K in (design, design.controller, design.scaled_controller)]
    assert_allclose(poles[1], poles[0], rtol=1e-6)
    assert_allclose(poles[2], poles[0], rtol=1e-6)


def test_write_controller_scaled_raises(tmp_path, design):
    with pytest.raises(ValueError, match=r"units of the machine.*\.controller"):
        bc.write_controller(design.scaled_controller, tmp_path / "K.json", allow_subsystem=True)
    assert not list(tmp_path.iterdir())
    bc.write_controller(design, tmp_path / "K.json", allow_subsystem=True)
    assert_allclose(bc.read_controller(tmp_path / "K.json").B, design.controller.B)


def test_other_scales_raise(design):
    words = r"scaled signals \('stroke_anti' by 0\.1\), got one in scaled signals \('stroke_anti' by 0\.05\)"
    with pytest.raises(ValueError, match=words):
        bc.margins(bc.scale_signals(YAW, SCALES | {"stroke_anti": 0.1}), design.scaled_controller)
    with pytest.raises(ValueError, match="got one in the units of the machine"):
        bc.unscale_controller(design.controller, {"stroke_anti": 0.05, "suspension_anti": 150.0})
    with pytest.raises(ValueError, match="`scales` must be those of the controller"):
        bc.unscale_controller(design.scaled_controller, {"stroke_anti": 0.1, "suspension_anti": 150.0})
    with pytest.raises(ValueError, match="must not be scaled"):
        bc.scale_signals(SCALED, SCALES)
    with pytest.raises(ValueError, match="carries none"):
        bc.unscale_controller(law())
    assert_allclose(bc.unscale_controller(design.scaled_controller).B, design.controller.B)
