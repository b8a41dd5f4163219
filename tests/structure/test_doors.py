"""What a user of python-control looks for at a structure, a norm and a regulator is there, or says where."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose

import boomctl as bc
from tests import handed_out as one


def test_signals_by_index_are_outputs_first():
    boom = bc.spray_boom()
    one = boom["tip_left", "actuator_left"]
    assert (one.inputs, one.outputs) == (("actuator_left",), ("tip_left",))
    assert boom[["tip_right", "tip_left"], "cradle"].outputs == ("tip_right", "tip_left")
    with pytest.raises(ValueError, match="did you mean 'tip_left'"):
        boom["tip_lef", "cradle"]
    with pytest.raises(TypeError, match=r"expected model\[outputs, inputs\]"):
        boom["tip_left"]  # type: ignore[index]


def test_poles_are_those_of_the_state_space():
    boom = bc.spray_boom()
    assert_allclose(np.sort_complex(boom.poles()), np.sort_complex(boom.to_statespace().poles()), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["A", "dcgain", "sample", "plot_phase"])
def test_what_only_state_spaces_have_says_so(name):
    with pytest.raises(AttributeError, match=rf"no attribute '{name}'; its \.to_statespace\(\) has"):
        getattr(bc.spray_boom(), name)


def test_a_norm_is_a_number_and_a_regulator_unpacks():
    swing = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    assert float(bc.hinf_norm(swing)) == bc.hinf_norm(swing).lower
    assert float(bc.h2_norm(swing)) == bc.h2_norm(swing).value
    K, S, E = bc.lqr(swing, np.eye(2), np.eye(1))
    K2, S2, E2 = control.lqr(swing, np.eye(2), np.eye(1))
    assert_allclose(K, K2)
    assert_allclose(S, S2)
    assert_allclose(np.sort_complex(E), np.sort_complex(E2))


def test_a_name_where_frequencies_stand_and_speeds_where_one_stands():
    with pytest.raises(
        TypeError, match="omega = 'tip_left': expected frequencies; signals are named by inputs= and outputs="
    ):
        bc.sigma(bc.spray_boom(), "tip_left")
    with pytest.raises(TypeError, match=r"\.campbell\(speeds\) takes many"):
        bc.hub_beam(modes=1).frequencies_hz(np.array([0.0, 1.0]))


def test_a_sampled_structure_is_that_of_python_control():
    """Inputs held between samples."""
    jolt, _ = bc.split_symmetric(bc.spray_boom())
    sampled, theirs = jolt.to_statespace(dt=0.01), control.sample_system(jolt.to_statespace(), 0.01)
    assert (sampled.dt, sampled.input_labels, sampled.state_labels) == (0.01, theirs.input_labels, theirs.state_labels)
    for ours, other in zip(
        (sampled.A, sampled.B, sampled.C, sampled.D), (theirs.A, theirs.B, theirs.C, theirs.D), strict=True
    ):
        assert_allclose(ours, other, rtol=0, atol=1e-12 * np.abs(other).max(initial=1.0))
    with pytest.raises(ValueError, match=r"dt = -1\.0: expected"):
        jolt.to_statespace(dt=-1.0)


def test_halves_are_told_apart_by_their_names():
    boom = bc.spray_boom()
    halves = [half.to_statespace() for half in bc.split_symmetric(boom)]
    assert [half.name for half in (*halves, boom.to_statespace())] == ["jolt", "yaw", "structure"]


@pytest.mark.parametrize(
    ("look", "what"),
    [
        (lambda boom: bc.bode(boom, "tip_left"), "omega = 'tip_left': expected frequencies"),
        (lambda boom: bc.sigma(boom, ["tip_left"]), r"omega = \['tip_left'\]: expected frequencies"),
        (lambda boom: bc.step(boom, "tip_left"), r"timepts = 'tip_left': expected instants \[s\]"),
        (lambda boom: bc.nyquist(boom, "tip_left"), "controller = 'tip_left': expected a controller"),
    ],
)
def test_names_where_something_else_stands_say_where_they_are_given(look, what):
    with pytest.raises(TypeError, match=f"{what}; signals are named by inputs= and outputs="):
        look(bc.spray_boom())


def test_nyquist_and_compare_take_signals_as_sigma_does():
    boom = bc.spray_boom()
    pair = {"inputs": "suspension_left", "outputs": "stroke_left"}
    part = boom[pair["outputs"], pair["inputs"]]
    assert_allclose(bc.nyquist(boom, **pair).curve, bc.nyquist(part).curve)
    assert bc.compare({"boom": boom}, **pair)["boom"] == bc.compare({"part": part})["part"]
    both = bc.compare({"boom": boom.to_statespace(), "part": part}, **pair)
    assert both["boom"]["H-infinity norm"] == pytest.approx(both["part"]["H-infinity norm"], rel=1e-4)
    spring = control.ss([], [], [], [[-100.0]], inputs="stroke_left", outputs="suspension_left")
    assert_allclose(bc.nyquist(boom, spring, **pair).curve, bc.nyquist(boom, spring).curve, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "of_old"),
    [
        (lambda: bc.hinf_norm(one.mass()), lambda r: r.value),
        (lambda: bc.h2_norm(one.mass()), lambda r: r.value),
        (lambda: bc.sigma(one.mass()), lambda r: r.peak),
        (one.h_infinity, lambda r: r.gamma),
        (one.tuned, lambda r: r.gamma),
        (lambda: bc.lqg(one.mass(), np.eye(2), 1.0, np.eye(2), 1.0), lambda r: np.sqrt(r.cost)),
        (lambda: bc.h2(one.generalized()), lambda r: r.optimum),
        (lambda: one.h_infinity().certificate, lambda r: r.norm.value),
        (lambda: bc.reduce_controller(one.generalized(), one.h_infinity().controller, order=1), lambda r: r.gamma),
        pytest.param(
            lambda: bc.worst_case(one.family(), one.suspension(), "actuator_anti", "tip_anti"),
            lambda r: r.norm.lower,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_every_result_that_has_a_norm_has_it_by_this_name(make, of_old):
    result = make()
    assert float(result.norm) == pytest.approx(float(of_old(result)), rel=1e-6)


@pytest.mark.parametrize(
    ("wrong", "remedy"),
    [
        (lambda: bc.sigma(one.machine()), r"got Assembly; its \.assemble\(\) is one"),
        (lambda: bc.sigma(one.family()), r"got AffineFamily; its \.at\(\.\.\.\) is one"),
        (lambda: bc.sigma(one.hub_beam()), r"its \.linearize\(hub_speed\) is one"),
        (lambda: bc.hinf_norm(bc.reduce(one.mass(), order=2)), r"got ReductionResult; its \.system is one"),
        (
            lambda: bc.discretize(one.mass(), 0.01),
            r"got SecondOrderModel; .* sampled by its \.to_statespace\(dt=0\.01\)",
        ),
        (
            lambda: bc.write_controller(one.machine(), "law.json"),
            r"got Assembly; its \.assemble\(\)\.to_statespace\(\) is one",
        ),
        (lambda: bc.sigma(np.eye(2)), r"got ndarray; .* or control\.ss\(A, B, C, D\) makes one"),
        (lambda: bc.split_symmetric(one.machine()), r"got Assembly; .*\.assemble\(\) of an Assembly"),
        (lambda: bc.structure.Force("push", one.machine().bodies[0]), r"got RigidBody; \.at\(s\) of a beam"),
        (
            lambda: bc.structure.RigidBody("bar", bc.structure.GROUND.at(0), bc.structure.revolute),
            r"expected Joint, got function; revolute\(\)",
        ),
        (lambda: bc.robust_stability(one.boom(), one.suspension()), r"got SecondOrderModel; boom_family\(\)"),
        (lambda: bc.platform_motion("C", speed=3.0, sample_time=0.01), r"expected Track, got str; iso_track\(\.\.\.\)"),
    ],
)
def test_another_kind_of_thing_is_told_what_makes_the_right_one(wrong, remedy):
    with pytest.raises(TypeError, match=remedy):
        wrong()


@pytest.mark.parametrize("lost", [lambda K: -K, lambda K: 2.0 * K, lambda K: control.ss(K.A, K.B, K.C, K.D)])
def test_a_controller_that_lost_its_names_says_where_and_how_it_gets_them_back(lost):
    K = lost(one.suspension())
    with pytest.raises(
        ValueError, match=r"no names but u\[0\], y\[0\]: python-control loses them in -K, .* K\.update_names\("
    ):
        bc.margins(one.yaw(), K)
    K.update_names(inputs=["stroke_anti"], outputs=["suspension_anti"])
    assert bc.margins(one.yaw(), K).loops
