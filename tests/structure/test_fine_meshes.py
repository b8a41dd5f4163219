"""Fine and graded meshes against the exact beam, and meshes that are refused."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

import boomctl as bc
from boomctl.boom.exact import exact_boom
from boomctl.structure import SecondOrderModel
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from boomctl.structure.response.direct import respond
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.rounding import AccuracyWarning
from tests.profiles import examples
from tests.strategies import seeds

P = bc.BoomParameters()


@pytest.mark.parametrize("elements", [25, 50, 100, 190])
def test_frequencies_fine_mesh_are_those_of_exact_beam(elements):
    """The error falls with the third power of the elements' length, where springs act between nodes."""
    model = bc.spray_boom(elements=elements)
    slack = 4e-6 * (100.0 / elements) ** 3
    found = undamped_modes(model.structure, 5)[0] / (2.0 * np.pi)
    assert found == pytest.approx(bc.exact_eigenfrequencies_hz(P, 5, damped=False), rel=slack)
    assert model.eigenfrequencies_hz(5) == pytest.approx(bc.exact_eigenfrequencies_hz(P, 5), rel=slack)


@pytest.mark.parametrize("elements", [100, pytest.param(190, marks=pytest.mark.slow)])
def test_frequencies_floating_mesh_rigid_modes_exactly_zero(elements):
    model = bc.spray_boom(elements=elements, excitation="force")
    found = undamped_modes(model.structure, 6)[0]
    elastic = undamped_frequencies(exact_boom(P, "force"), 4)
    slack = 4e-6 * (100.0 / elements) ** 3
    assert np.array_equal(found[:2], [0.0, 0.0])
    assert found[2:] == pytest.approx(elastic, rel=slack)
    assert model.eigenfrequencies_hz(3).min() > 0.1  # none is a rigid motion's rounding


@pytest.mark.parametrize("elements", [25, 100, 190])
def test_response_fine_mesh_is_that_of_exact_beam(elements):
    """And nothing is said of rounding; few frequencies are solved directly, many by undamped modes."""
    model = bc.spray_boom(elements=elements)
    for points, way in ((3, "dense solutions"), (100, "undamped modes")):
        omega = 2 * np.pi * np.geomspace(0.05, 5.0, points)
        with warnings.catch_warnings():
            warnings.simplefilter("error", AccuracyWarning)
            found = respond(model.structure, model.ports, omega)
        truth = bc.exact_frequency_response(P, omega).frdata
        assert found.path == ("halves", way, way)
        assert np.abs(found.values - truth).max() < 3e-4 * (100.0 / elements) ** 3 * np.abs(truth).max()


@pytest.mark.parametrize("excitation", ["displacement", "force"])
@pytest.mark.parametrize("elements", [25, 100, 190])
def test_response_fine_mesh_each_signal_is_near_exact_beam(elements, excitation):
    """Relative to the largest output of each input, not to that of all."""
    omega = 2.0 * np.pi * np.geomspace(0.1, 10.0, 20)
    exact = np.asarray(bc.exact_frequency_response(P, omega, excitation=excitation).frdata)
    found = np.asarray(bc.spray_boom(P, elements=elements, excitation=excitation).frequency_response(omega).frdata)
    slack = 2e-4 * (100.0 / elements) ** 3
    assert (np.abs(found - exact) <= slack * np.abs(exact).max(axis=1, keepdims=True)).all()


@pytest.mark.parametrize("elements", [500, 100_000])
def test_spray_boom_too_many_elements_raises(elements):
    """Before any matrix is made."""
    with pytest.raises(
        ValueError, match=r"must have at most 1000 coordinates, got \d+. Use a few elements of high order"
    ):
        bc.spray_boom(elements=elements)


def test_second_order_model_too_many_coordinates_raises():
    large = sparse.eye_array(1001)
    for matrix in (large, large.toarray(), sparse.eye_array(10**6)):
        with pytest.raises(ValueError, match=r"must have at most 1000 coordinates, got"):
            SecondOrderModel(matrix, matrix, matrix)


@pytest.mark.slow
def test_spray_boom_largest_mesh_is_computed():
    model = bc.spray_boom(elements=499)
    assert model.n == 1000
    assert model.eigenfrequencies_hz(3) == pytest.approx(
        bc.exact_eigenfrequencies_hz(P, 3), rel=4e-6 * (100.0 / 499.0) ** 3
    )
    omega = 2 * np.pi * np.geomspace(0.1, 10.0, 8)
    truth = bc.exact_frequency_response(P, omega).frdata
    slack = 4e-4 * (100.0 / 499.0) ** 3  # an odd number of elements: the hinge is inside one
    assert np.abs(model.frequency_response(omega).frdata - truth).max() < slack * np.abs(truth).max()


def graded(ratio, count):
    """Return nodes of both arms, each interval ``ratio`` times as long as the one next to it towards the hinge."""
    x = 6.0 * ratio ** -np.arange(count, dtype=float)[::-1]
    return tuple(np.concatenate([-x[::-1], [0.0], x]))


@given(st.integers(3, 20), st.floats(1.2, 5.0), st.integers(2, 17), st.floats(-6.0, 1.0), st.sampled_from([5, 30]))
@examples(30)
def test_beams_of_high_order_answer_or_refuse_in_words(order, ratio, count, distance, wanted):
    """All orders, on equal nodes and on graded ones down to 1e-6 m: no message of LAPACK."""
    count = min(count, 1 + int(np.log(6e6) / np.log(ratio)))
    p = bc.BoomParameters(spring_distance=10.0**distance)
    for nodes in (graded(ratio, count), 2 * count + 2):
        model = bc.spray_boom(p, "high-order", nodes, order=order)
        if model.n > 300:
            continue  # strain coordinates of larger ones take seconds
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AccuracyWarning)
            assert np.isfinite(model.frequency_response([0.5, 20.0]).frdata).all()
        refused: Exception | None = None
        try:
            assert np.isfinite(model.eigenfrequencies_hz(wanted)).all()
        except ValueError as error:
            refused = error
        # numpy's error of linear algebra is a ValueError too
        assert refused is None or type(refused) is ValueError
        assert refused is None or "count = " in str(refused) or "singular to rounding" in str(refused)


@pytest.mark.parametrize(
    ("order", "ratio", "count", "distance"),
    [
        (10, 4.21, 8, 0.0012),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [(13, 3.01, 10, 0.89), (18, 4.16, 6, 0.0026), (15, 2.86, 6, 0.0023), (14, 3.47, 9, 0.02)]
        ),
    ],
)
def test_undamped_modes_of_graded_beams_are_those_of_the_exact_beam(order, ratio, count, distance):
    """Where factors are singular or indefinite: strain coordinates answer."""
    p = bc.BoomParameters(spring_distance=distance)
    x = np.asarray(graded(ratio, count))
    nodes = tuple(np.unique(np.concatenate([x, [-distance / 2, distance / 2, -3.0, 3.0]])))
    model = bc.spray_boom(p, "high-order", nodes, order=order)
    found = undamped_modes(model.structure, 4)[0] / (2.0 * np.pi)
    assert found == pytest.approx(bc.exact_eigenfrequencies_hz(p, 4, damped=False), rel=1e-8)


@pytest.mark.slow
@given(seeds, st.integers(130, 190), st.sampled_from(["force", "displacement", "acceleration"]), st.integers(3, 40))
@examples(10)
def test_undamped_modes_half_boom_are_those_in_strains(seed, elements, excitation, count):
    """Of halves that float too: rigid motions exactly zero, springs of any size."""
    rng = np.random.default_rng(seed)
    p = bc.BoomParameters(spring_stiffness=10.0 ** rng.uniform(0.0, 6.0), spring_distance=float(rng.uniform(0.05, 2.0)))
    whole = bc.spray_boom(p, elements=elements, excitation=excitation).structure
    for half in (whole.halves[parity][1] for parity in (1, -1)):
        found, shapes = undamped_modes(half, count)
        truth = half.strain_form.modes()[0][:count]
        assert np.array_equal(found == 0.0, truth == 0.0)
        assert found == pytest.approx(truth, rel=1e-9)
        assert np.abs(shapes.T @ (half.M @ shapes) - np.eye(count)).max() < 1e-8
