"""Verified norms: against closed forms, against another solver, and never below an attained value."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis import h2_norm, hinf_norm
from boomctl.analysis.model_norm import SplitModel
from boomctl.analysis.norm import IN_MODES, NO_CROSSING
from boomctl.boom import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lti.frequency import singular_values
from boomctl.structure import SecondOrderModel
from boomctl.structure.response.direct import direct_response
from tests.exact import Exact
from tests.profiles import examples


@pytest.mark.parametrize("rate", [1e-120, 1e-60, 1.0, 1e60])
@pytest.mark.parametrize("gain", [1e-100, 1.0, 1e30])
def test_whatever_the_units_it_is_the_same(rate, gain):
    """Squares of entries of 1e-220 are no numbers: a level of a tenth of the peak counted as reached by nothing."""
    A, B = rate * np.array([[0.0, 1.0], [-1.0, -0.1]]), np.array([[0.0], [gain * rate]])
    norm, exact = hinf_norm(control.ss(A, B, [[1.0, 0.0]], 0.0)), gain / (0.1 * np.sqrt(1.0 - 0.0025))
    assert norm.certified
    assert norm.lower_bound == pytest.approx(exact, rel=1e-10)
    assert norm.lower_bound <= exact * (1.0 + 1e-14) <= norm.upper_bound


@pytest.mark.parametrize(("rate", "seed"), [(1e-139, 17), (1e-150, 46)])
def test_norm_bounds_of_ill_conditioned_system(rate, seed):
    """Of entries below 1e-138: levels 1e5 and 5e7 times below the peak were certified."""
    rng = np.random.default_rng(seed)
    turned, stretched = np.linalg.qr(rng.standard_normal((2, 2)))[0], np.diag(10.0 ** rng.uniform(-2.0, 2.0, 2))
    T = turned @ stretched @ np.linalg.qr(rng.standard_normal((2, 2)))[0]
    A = T @ (rate * np.array([[-1e-8, 1.0], [-1.0, -1e-8]])) @ np.linalg.inv(T)
    system = control.ss(A, rng.standard_normal((2, 1)), rng.standard_normal((1, 2)) * rate, 0.0)
    norm, (low, high, _) = hinf_norm(system), Exact.of(system).norm()
    assert norm.lower_bound <= high
    assert low <= norm.upper_bound


@pytest.mark.filterwarnings("error")
def test_modes_whose_squares_are_no_numbers_have_a_norm():
    decay, step = 0.01, 1e90
    A = [[-decay, step, 0.0], [-1.0 / step, -decay, step], [0.0, -1.0 / step, -decay]]
    norm = hinf_norm(control.ss(A, np.full((3, 1), step), np.full((1, 3), 1.0 / step), 0.0))
    assert norm.certified
    assert norm.lower_bound == pytest.approx(step**2 / (decay * (decay**2 + 2.0)), rel=1e-9)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_a_norm_larger_than_any_float_is_not_certified():
    lags = -np.eye(6) + 1e99 * np.eye(6, k=1)
    assert not hinf_norm(control.ss(lags, np.ones((6, 1)), np.ones((1, 6)), 0.0)).certified


def test_norms_of_boom_have_default_signals_of_sigma():
    boom = spray_boom(elements=4)
    tips = boom.select(["actuator_left", "actuator_right"], ["tip_left", "tip_right"]).to_statespace()
    assert hinf_norm(boom).value == pytest.approx(bc.sigma(boom).peak, rel=1e-9)
    assert hinf_norm(boom).value == pytest.approx(control.linfnorm(tips)[0], rel=1e-6)
    assert h2_norm(boom).value == pytest.approx(control.norm(tips, 2), rel=1e-6)
    ends = "actuator_left, actuator_right -> tip_left, tip_right"
    assert all(ends in repr(found) for found in (hinf_norm(boom), h2_norm(boom), bc.sigma(boom), bc.step(boom)))


@pytest.mark.parametrize("order", [14, 20])
def test_norm_of_stiff_structure(order):
    model = spray_boom(BoomParameters(), "high-order", 4, order=order)
    norm = hinf_norm(model.select(model.input_labels, model.output_labels))
    assert norm.certified
    assert norm.lower_bound == pytest.approx(2469.1458521, rel=1e-6)


@pytest.mark.parametrize(("signals", "method"), [(3, IN_MODES), (12, NO_CROSSING)])
def test_that_of_many_signals_is_told_by_eigenvalues(signals, method):
    """A sum over the modes of so many entries takes longer."""
    rng = np.random.default_rng(1)
    A, B = np.diag(-rng.uniform(0.1, 10.0, 20)), rng.normal(size=(20, signals))
    norm = hinf_norm(control.ss(A, B, B.T, 0.0))  # highest at rest: A is symmetric, and the response positive there
    assert norm.method == method
    assert norm.verified
    assert norm.lower_bound == pytest.approx(np.linalg.norm(B.T @ np.linalg.solve(-A, B), 2), rel=1e-9)


def test_wrong_bounds_are_refuted_and_missing_ones_are_not():
    """A proof refutes verified bounds that are wrong; of a result without an upper bound it states the stored numbers."""
    norm = hinf_norm(control.ss(-1.0, 1.0, 1.0, 0.0))
    wrong = replace(norm, lower_bound=2.0, upper_bound=2.1, _proved=False)
    assert wrong.verified
    assert not wrong.certified
    assert "norm between" in bc.prove(replace(norm, upper_bound=np.inf)).claim
    lag = h2_norm(control.ss(-1.0, 1.0, 1.0, 0.0))
    assert not replace(lag, lower_bound=2.0, upper_bound=2.1, _proved=False).certified


def test_a_static_gain_and_a_zero_system_have_norms():
    assert hinf_norm(control.ss([], [], [], [[3.0, 4.0]])).lower_bound == pytest.approx(5.0)
    zero = hinf_norm(control.ss([[-1.0]], [[0.0]], [[1.0]], 0.0))
    assert zero.certified
    assert zero.upper_bound == 0.0


def test_norm_by_subsystems_needs_symmetric_signals():
    model = spray_boom(elements=6).select(ACTUATORS, TIPS)
    both, one = SplitModel.of(model), model.select("actuator_left", "tip_left")
    assert len(both.parts) == 2
    assert both.norm().stages == ("halves", "undamped modes", "undamped modes")
    assert SplitModel.of(one).parts == (one,)
    assert SplitModel.of(one).norm().stages == ("undamped modes",)
    system = hinf_norm(one.to_statespace())
    assert SplitModel.of(one).norm().lower_bound == pytest.approx(system.lower_bound, rel=1e-7)
    assert system.stages == ()
    pushed = SecondOrderModel(np.eye(2), 0.3 * np.eye(2), [[4.0, 1.0], [0.0, 9.0]], {"f": [1, 0]}, {"y": [0, 1]})
    assert SplitModel.of(pushed).norm().stages == ("given coordinates",)
    none = SplitModel(model, ())  # halves of which none has inputs and outputs
    assert none.norm().upper_bound == 0.0
    assert np.array_equal(none.singular_values(np.array([1.0, 2.0])), np.zeros((2, 2)))
    assert len(none.resonances().poles) == 0


def test_norm_of_subsystems_with_nearly_equal_peaks():
    """Two equal masses side by side, one spring between them: the halves' norms differ by a millionth and less."""
    for between in (0.0, 1e-9, 1e-7, 1e-3):
        K = np.array([[4.0 + between, -between], [-between, 4.0 + between]])
        model = SecondOrderModel(np.eye(2), 0.1 * np.eye(2), K, {"f": [1.0, 0.0]}, {"y": [1.0, 0.0]})
        parts = tuple(
            SecondOrderModel([[1.0]], [[0.1]], [[4.0 + 2.0 * extra]], {"f": [1.0]}, {"y": [1.0]})
            for extra in (between, 0.0)
        )
        found = SplitModel(model, parts).norm()
        expected = 1.0 / (0.1 * np.sqrt(4.0 - 0.05**2))
        assert found.lower_bound == pytest.approx(expected, rel=1e-12)
        assert found.certified
        assert SplitModel(model, parts[::-1]).norm().lower_bound == pytest.approx(found.lower_bound, rel=1e-14)


@given(st.floats(1e-6, 0.9), st.floats(0.1, 100.0))
def test_h2_norm_of_an_oscillator_is_its_closed_form(zeta, omega):
    model = SecondOrderModel([[1.0]], [[2 * zeta * omega]], [[omega**2]], {"f": [1.0]}, {"y": [1.0]})
    found = h2_norm(model)
    assert found.certified
    assert found.value == pytest.approx(1.0 / np.sqrt(4.0 * zeta * omega**3), rel=1e-8)
    assert found.lower_bound <= found.value <= found.upper_bound


def test_h2_norm_is_infinite_for_reasons_it_names():
    through = control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]], inputs=["f"], outputs=["y"])
    assert h2_norm(through).value == np.inf
    assert "feedthrough to 'y' from 'f'" in h2_norm(through).method
    assert "unstable pole at 1" in h2_norm(control.ss([[1.0]], [[1.0]], [[1.0]], 0.0)).method
    undamped = SecondOrderModel([[1.0]], [[0.0]], [[4.0]], {"f": [1.0]}, {"y": [1.0]})
    assert "axis at 0+2j rad/s" in h2_norm(undamped).method
    assert "unstable pole at 2" in h2_norm(control.ss(2.0, 1.0, 1.0, 1.0)).method  # before its feedthrough


@pytest.mark.slow
@examples(12)
@given(
    stiffness=st.floats(30.0, 90000.0),
    damping=st.floats(1e-6, 1e-3),
    elements=st.integers(40, 110),
    inputs=st.sampled_from([["actuator_left"], ["cradle", "suspension_left"], ["actuator_left", "actuator_right"]]),
    outputs=st.sampled_from([["tip_left"], ["tip_left", "cradle_slip"], ["tip_left", "tip_right"]]),
)
def test_the_norm_of_a_fine_mesh_is_that_of_all_its_coordinates(stiffness, damping, elements, inputs, outputs):
    """No value of the response over all strain coordinates is above it; it is attained where it says."""
    model = spray_boom(BoomParameters(spring_stiffness=stiffness, stiffness_damping=damping), elements=elements)
    chosen = model.select(inputs, outputs)
    norm = SplitModel.of(chosen).norm()
    omega = np.concatenate(
        [np.geomspace(0.05, 3000.0, 40), 2.0 * np.pi * model.eigenfrequencies_hz(8), [norm.peak_omega]]
    )
    values = singular_values(direct_response(chosen.structure, chosen.ports, omega))[0]
    assert values[-1] == pytest.approx(norm.lower_bound, rel=1e-6)
    assert values.max() <= norm.upper_bound
    if inputs[0] == "actuator_left":
        assert norm.upper_bound < np.inf
