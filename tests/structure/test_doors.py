"""What a user of python-control looks for at a structure, a norm and a regulator is there, or says where."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose

import boomctl as bc


def test_signals_by_index_are_outputs_first():
    boom = bc.spray_boom()
    one = boom["tip_left", "actuator_left"]
    assert (one.input_labels, one.output_labels) == (("actuator_left",), ("tip_left",))
    assert boom[["tip_right", "tip_left"], "cradle"].output_labels == ("tip_right", "tip_left")
    with pytest.raises(ValueError, match="did you mean 'tip_left'"):
        boom["tip_lef", "cradle"]
    with pytest.raises(TypeError, match=r"expected model\[outputs, inputs\]"):
        boom["tip_left"]  # type: ignore[index]


def test_poles_are_those_of_the_state_space():
    boom = bc.spray_boom()
    assert_allclose(np.sort_complex(boom.poles()), np.sort_complex(boom.to_statespace().poles()), rtol=1e-9, atol=1e-9)


def test_a_norm_is_a_number_and_a_regulator_unpacks():
    swing = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    assert float(bc.hinf_norm(swing)) == bc.hinf_norm(swing).lower_bound
    assert float(bc.h2_norm(swing)) == bc.h2_norm(swing).value
    K, S, E = bc.lqr(swing, np.eye(2), np.eye(1))
    K2, S2, E2 = control.lqr(swing, np.eye(2), np.eye(1))
    assert_allclose(K, K2)
    assert_allclose(S, S2)
    assert_allclose(np.sort_complex(E), np.sort_complex(E2))


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
