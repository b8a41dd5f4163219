"""SecondOrderModel: what it is made of, and its answers for systems solved by hand."""

import numpy as np
import pytest
from hypothesis import given
from scipy import sparse

from boomctl.structure import SecondOrderModel
from tests.references import direct
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
    assert (part.input_labels, part.output_labels, part.ncoordinates) == (
        ("f2", "f0"),
        ("y1",),
        structure.model.ncoordinates,
    )
    whole = structure.model.frequency_response([1.0]).frdata
    assert np.allclose(part.frequency_response([1.0]).frdata, whole[1:2, [2, 0]], rtol=1e-12)


def test_coordinates_have_the_names_given():
    model = SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), coordinates=["left", "right"])
    assert model.coordinates == ("left", "right")
    assert SecondOrderModel(np.eye(2), np.eye(2), np.eye(2)).coordinates == ("q0", "q1")
