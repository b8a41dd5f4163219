"""SecondOrderModel: what it is made of, what it refuses, and its answers for systems solved by hand."""

import numpy as np
import pytest
from hypothesis import given
from scipy import sparse

import boomctl
from boomctl.structure import SecondOrderModel
from tests.references import dense, direct
from tests.strategies import structures

ONE = np.eye(1)


def oscillator(m=2.0, c=0.4, k=8.0):
    """Return one mass on a spring."""
    return SecondOrderModel([[m]], [[c]], [[k]], {"force": [1.0]}, {"position": [1.0]})


def test_a_mass_on_a_spring_has_its_textbook_frequency_and_response():
    m, c, k = 2.0, 0.4, 8.0
    damped = np.sqrt(k / m - (c / (2 * m)) ** 2) / (2 * np.pi)
    assert oscillator().eigenfrequencies_hz(1) == pytest.approx([damped], rel=1e-15)
    omega = np.array([0.0, 1.0, 2.0, 30.0])
    found = oscillator().frequency_response(omega)
    assert np.allclose(found.frdata[0, 0], 1 / (k + 1j * omega * c - m * omega**2), rtol=1e-15)
    assert (found.input_labels, found.output_labels) == (["force"], ["position"])


def test_its_state_space_is_the_companion_form():
    system = oscillator().to_statespace()
    assert np.allclose(system.A, [[0.0, 1.0], [-4.0, -0.2]], rtol=1e-15)
    assert np.allclose(system.B, [[0.0], [0.5]], rtol=1e-15)
    assert system.state_labels == ["q0.x1", "q0.x2"]


@pytest.mark.parametrize("store", [np.asarray, sparse.csr_array, sparse.csc_array, sparse.coo_array, list])
@given(structure=structures())
def test_it_does_not_matter_how_matrices_are_stored(structure, store):
    model = SecondOrderModel(
        *(store(X) for X in (structure.M, structure.C, structure.K)), {"f": structure.B[:, 0]}, {"y": structure.L[0]}
    )
    omega = np.array([0.5, 2.0])
    expected = direct(structure.model, omega)[:1, :1]
    assert np.allclose(model.frequency_response(omega).frdata, expected, rtol=1e-12)


@given(structures(inputs=3))
def test_a_selection_has_only_what_was_selected(structure):
    part = structure.model.select(["f2", "f0"], "y1")
    assert (part.inputs, part.outputs, part.n) == (("f2", "f0"), ("y1",), structure.model.n)
    whole = structure.model.frequency_response([1.0]).frdata
    assert np.allclose(part.frequency_response([1.0]).frdata, whole[1:2, [2, 0]], rtol=1e-12)


@given(structures())
def test_a_model_cannot_be_changed(structure):
    model = structure.model
    with pytest.raises(AttributeError):
        model.M = np.eye(3)
    assert np.array_equal(dense(model.M), structure.M)


def test_coordinates_have_the_names_given():
    model = SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), coordinates=["left", "right"])
    assert model.coordinates == ("left", "right")
    assert SecondOrderModel(np.eye(2), np.eye(2), np.eye(2)).coordinates == ("q0", "q1")


@pytest.mark.parametrize(
    ("matrices", "error", "message"),
    [
        ((np.eye(2), np.eye(3), np.eye(2)), ValueError, r"C has shape \(3, 3\); expected that of M, \(2, 2\)"),
        ((np.eye(2), np.eye(2), np.eye(1)), ValueError, r"K has shape \(1, 1\)"),
        ((np.ones((2, 3)), ONE, ONE), ValueError, r"M has shape \(2, 3\); expected a square matrix"),
        ((np.zeros((0, 0)), ONE, ONE), ValueError, r"M has shape \(0, 0\)"),
        ((np.ones(3), ONE, ONE), ValueError, r"M: expected 2 dimension\(s\), got shape \(3,\)"),
        ((ONE, ONE, [[np.nan]]), ValueError, r"K: expected finite numbers, got nan at \(0, 0\)"),
        ((ONE, [[np.inf]], ONE), ValueError, "C: expected finite numbers, got inf"),
        ((sparse.csr_array([[np.nan]]), ONE, ONE), ValueError, "M: expected finite numbers"),
        (([["a"]], ONE, ONE), TypeError, "M: expected real numbers"),
        (([[1j]], ONE, ONE), TypeError, "M: expected real numbers"),
        ((sparse.csr_array([[1j]]), ONE, ONE), TypeError, "M: expected real numbers"),
        ((ONE, sparse.csr_array(np.ones((2, 1))), ONE), ValueError, r"C has shape \(2, 1\)"),
    ],
)
def test_matrices_that_fit_nothing_are_refused(matrices, error, message):
    with pytest.raises(error, match=message):
        SecondOrderModel(*matrices)


@pytest.mark.parametrize(
    ("ports", "error", "message"),
    [
        (
            {"force_inputs": {"f": [1.0, 2.0]}},
            ValueError,
            "force input 'f' has 2 entries; expected 1, one a coordinate",
        ),
        ({"outputs": {"y": [1.0, 2.0]}}, ValueError, "output 'y' has 2 entries; expected 1"),
        ({"outputs": {"y": [np.nan]}}, ValueError, "output 'y': expected finite numbers"),
        ({"force_inputs": {"f.x": [1.0]}}, ValueError, "name of a force input = 'f.x': expected a name that .* no dot"),
        ({"outputs": {"": [1.0]}}, ValueError, "name of an? output = '': expected a name that is not empty"),
        ({"force_inputs": {"f": ["one"]}}, TypeError, "force input 'f': expected real numbers"),
        ({"coordinates": ["a", "b"]}, ValueError, "coordinates: expected 1 different names, got 2"),
    ],
)
def test_ports_that_fit_nothing_are_refused(ports, error, message):
    with pytest.raises(error, match=message):
        SecondOrderModel(ONE, ONE, ONE, **ports)


def test_two_coordinates_of_one_name_are_refused():
    with pytest.raises(ValueError, match="coordinates: expected 2 different names"):
        SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), coordinates=["a", "a"])


@pytest.mark.parametrize("method", ["frequency_response", "to_statespace", "select"])
@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"inputs": "forse"}, r"unknown input 'forse'; did you mean 'force'\? \(there are: force\)"),
        ({"outputs": "positoin"}, "unknown output 'positoin'; did you mean 'position'"),
        ({"inputs": ["force", "force"]}, "input 'force' is asked for twice"),
        ({"outputs": "zzz"}, r"unknown output 'zzz' \(there are: position\)"),
    ],
)
def test_unknown_names_are_answered_with_those_that_exist(method, asked, message):
    first = ([1.0],) if method == "frequency_response" else ()
    with pytest.raises(ValueError, match=message):
        getattr(oscillator(), method)(*first, **asked)


@pytest.mark.parametrize(
    ("count", "error", "message"),
    [
        (0, ValueError, "count = 0: expected a whole number not below 1"),
        (-3, ValueError, "count = -3"),
        (1.5, TypeError, "count = 1.5: expected a whole number, got float"),
        (True, TypeError, "count = True: expected a whole number, got bool"),
        (2, ValueError, "count = 2: the model has only 1"),
    ],
)
def test_a_count_that_is_none_is_refused(count, error, message):
    with pytest.raises(error, match=message):
        oscillator().eigenfrequencies_hz(count)


def test_a_structure_is_combined_as_a_state_space():
    boom = boomctl.spray_boom(elements=4)
    for combine in (
        lambda m: m * m,
        lambda m: 2.0 * m,
        lambda m: m + m,
        lambda m: 1.0 - m,
        lambda m: m / 2.0,
        lambda m: -m,
    ):
        with pytest.raises(TypeError, match=r"its \.to_statespace\(\) is"):
            combine(boom)
