"""SecondOrderModel: its parts, systems solved by hand, and what a user of python-control expects of it."""

import weakref

import control
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from scipy import sparse

import boomctl as bc
from boomctl.structure import SecondOrderModel
from tests.references import direct
from tests.strategies import structures


def oscillator(m=2.0, c=0.4, k=8.0):
    """Return one mass on a spring."""
    return SecondOrderModel([[m]], [[c]], [[k]], {"force": [1.0]}, {"position": [1.0]})


def test_mass_on_spring_closed_form():
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


def test_rigid_motions_of_given_matrices_are_not_counted():
    K = np.array([[30.0, -30.0, 0.0], [-30.0, 80.0, -50.0], [0.0, -50.0, 50.0]])
    M = np.diag([1.0, 2.0, 3.0])
    two = SecondOrderModel(np.kron(np.eye(2), M), np.kron(np.eye(2), 0.002 * K), np.kron(np.eye(2), K))
    squares = np.sort(np.roots([6.0, -520.0, 9000.0]))  # det(K - s M) = -s (6 s^2 - 520 s + 9000)
    found = (2.0 * np.pi * two.eigenfrequencies_hz(4)) ** 2 / (1.0 - (0.001 * np.repeat(squares, 2) ** 0.5) ** 2)
    assert found == pytest.approx(np.repeat(squares, 2), rel=1e-9)
    soft = SecondOrderModel(np.eye(2), np.zeros((2, 2)), np.diag([1e14, 0.25]))  # stiffer by 4e14, and not rigid
    assert 2.0 * np.pi * soft.eigenfrequencies_hz(2) == pytest.approx([0.5, 1e7])
    held = SecondOrderModel(np.eye(2), np.zeros((2, 2)), [[5e9 + 1e-3, -5e9], [-5e9, 5e9]])
    assert 2.0 * np.pi * held.mode_shapes(1).eigenfrequencies_hz == pytest.approx([np.sqrt(0.5e-3)], rel=1e-2)
    loose = SecondOrderModel(np.diag([1.0, 4.0]), np.zeros((2, 2)), np.zeros((2, 2)))
    modes = loose.mode_shapes()
    assert not modes.eigenfrequencies_hz.any()
    assert np.abs(modes.shapes) @ np.ones(2) == pytest.approx([1.0, 0.5])


@pytest.mark.parametrize("n", [3, 70])
@pytest.mark.parametrize(
    ("turn", "squares"),
    [((2.0, 0.0), [5.0]), ((0.0, 3.0), [1.0, 9.0]), ((2.0, 3.0), [(14 - 160**0.5) / 2, (14 + 160**0.5) / 2])],
)
def test_rigid_motions_that_gyroscopic_forces_couple_are_counted(n, turn, squares):
    """``s^2 (s^4 + (1 + a^2 + b^2) s^2 + b^2)``, beside springs of 100 N/m and more."""
    (a, b), C = turn, np.zeros((n, n))
    C[:2, 2], C[2, :2] = (0.0, a), (0.0, -a)
    C[0, 1], C[1, 0] = b, -b
    K = np.diag(np.r_[0.0, 0.0, 1.0, np.arange(n - 3) + 100.0])
    found = SecondOrderModel(np.eye(n), C, K).eigenfrequencies_hz(len(squares))
    assert (2.0 * np.pi * found) ** 2 == pytest.approx(squares, rel=1e-9)


@pytest.mark.parametrize("dampers", [(0.0, 0.0, 0.0), (1.0, 2.0, 0.0)])
def test_soft_mode_beside_stiff_rigid_motion_is_counted(dampers):
    K = 1e14 * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 2.5e-15]])
    model = SecondOrderModel(np.diag([1.0, 2.0, 1.0]), np.diag(dampers), K)
    assert 2.0 * np.pi * model.eigenfrequencies_hz(2) == pytest.approx([0.5, 1e7 * 1.5**0.5])


@pytest.mark.parametrize("elements", [20, 100])  # all modes, and a basis of the lowest
def test_free_beam_of_given_matrices_has_its_elastic_modes(elements):
    h, N = 1.0 / elements, 2 * elements + 2
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h], [-12, -6 * h, 12, -6 * h]])
    k = np.vstack([k, [6 * h, 2 * h * h, -6 * h, 4 * h * h]]) / h**3
    m = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h], [54, 13 * h, 156, -22 * h]])
    m = np.vstack([m, [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]) * h / 420
    M, K = np.zeros((N, N)), np.zeros((N, N))
    for first in range(0, N - 2, 2):
        part = slice(first, first + 4)
        M[part, part] += m
        K[part, part] += k
    found = 2.0 * np.pi * SecondOrderModel(M, 1e-6 * K, K).eigenfrequencies_hz(2)
    assert found == pytest.approx([22.3732854, 61.6728229], rel=1e-4)  # cos b cosh b = 1


def test_coordinates_have_the_names_given():
    model = SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), coordinates=["left", "right"])
    assert model.coordinates == ("left", "right")
    assert SecondOrderModel(np.eye(2), np.eye(2), np.eye(2)).coordinates == ("q0", "q1")


def test_signals_by_index_are_outputs_first():
    boom = bc.spray_boom()
    one = boom["tip_left", "actuator_left"]
    assert (one.input_labels, one.output_labels) == (("actuator_left",), ("tip_left",))
    assert boom[["tip_right", "tip_left"], "cradle"].output_labels == ("tip_right", "tip_left")


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


def test_default_signals_selected_once():
    """And the model does not refer to itself: what it holds is freed without garbage collection."""
    model = bc.spray_boom().between()
    assert model.between() is model
    alive = weakref.ref(model)
    del model
    assert alive() is None
