"""Meshes finer, or more graded, than a stiffness matrix in double precision carries: solved through rows, or refused."""

import subprocess
import sys
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.boom.exact import exact_boom
from boomctl.structure import SecondOrderModel
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from boomctl.structure.response.direct import respond
from boomctl.structure.response.pencil import factorized_sparse
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.rounding import AccuracyWarning
from tests.profiles import examples
from tests.strategies import random_machine, seeds

P = bc.BoomParameters()


@given(seeds, st.floats(0.01, 100.0))
@examples(60)
def test_the_sparse_solution_is_what_the_matrices_say(seed, omega):
    """Real shifts, imaginary ones, and stiffness with a share of mass; of random machines, with their rows and without."""
    model = random_machine(seed).assemble()
    rhs = np.random.default_rng(seed).standard_normal((model.n, 2))
    M, C, K = (np.asarray(matrix) for matrix in (model.M, model.C, model.K))
    bare = SecondOrderModel(M, C, K).structure
    for m, c in ((omega**2, omega), (-(omega**2), 1j * omega), (omega, 0.0)):
        matrix = m * M + c * C + K
        for structure in (model.structure, bare):
            solve = factorized_sparse(structure, m, c)
            x = solve(rhs)
            size = np.abs(matrix) @ np.abs(x) + np.abs(rhs)
            assert (np.abs(matrix @ x - rhs) < 1e-10 * size.max()).all()
            assert solve(rhs[:, 0]) == pytest.approx(x[:, 0], rel=1e-9, abs=1e-12 * np.abs(x).max())


@pytest.mark.parametrize("elements", [1900, *(pytest.param(n, marks=pytest.mark.slow) for n in (2100, 10000))])
def test_frequencies_of_fine_meshes_are_those_of_the_exact_beam(elements):
    """To what a mesh that fine is off; its stiffness matrix has lost two digits to all of them."""
    model = bc.spray_boom(elements=elements)
    found = undamped_modes(model.structure, 5)[0] / (2.0 * np.pi)
    assert found == pytest.approx(bc.exact_eigenfrequencies_hz(P, 5, damped=False), rel=1e-9)
    assert model.eigenfrequencies_hz(5) == pytest.approx(bc.exact_eigenfrequencies_hz(P, 5), rel=1e-9)


@pytest.mark.slow
def test_rigid_modes_of_fine_meshes_are_exactly_zero():
    model = bc.spray_boom(elements=5000, excitation="force")
    found = undamped_modes(model.structure, 6)[0]
    elastic = undamped_frequencies(exact_boom(P, "force"), 4)
    assert np.array_equal(found[:2], [0.0, 0.0])
    assert found[2:] == pytest.approx(elastic, rel=1e-9)


@pytest.mark.parametrize(("elements", "top"), [(3000, 0.05), pytest.param(20000, 10.0, marks=pytest.mark.slow)])
def test_the_response_of_a_fine_mesh_is_that_of_the_exact_beam(elements, top):
    """Up to a frequency [Hz] that the stiffness matrix has lost; and nothing is said of rounding."""
    model, omega = bc.spray_boom(elements=elements), 2 * np.pi * top * np.array([0.1, 0.5, 1.0])
    assert model.structure.noise > 1e-2 * omega[-1] ** 2
    with warnings.catch_warnings():
        warnings.simplefilter("error", AccuracyWarning)
        found = respond(model.structure, model.ports, omega)
    truth = bc.exact_frequency_response(P, omega).frdata
    assert found.path == ("halves", "sparse factorisations", "sparse factorisations")
    assert np.abs(found.values - truth).max() < 1e-9 * np.abs(truth).max()


_LARGE = """
import resource, warnings
import numpy as np, boomctl as bc
warnings.simplefilter("error")
model = bc.spray_boom(elements=100000)
omega = 2 * np.pi * np.geomspace(0.1, 10.0, 8)
found, truth = model.eigenfrequencies_hz(5), bc.exact_eigenfrequencies_hz(bc.BoomParameters(), 5)
Y, Z = model.frequency_response(omega).frdata, bc.exact_frequency_response(bc.BoomParameters(), omega).frdata
print(np.abs(found / truth - 1.0).max(), (np.abs(Y - Z).max(axis=(0, 1)) / np.abs(Z).max(axis=(0, 1))).max())
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_a_hundred_thousand_elements_are_right_and_fit():
    """Eigenfrequencies and 8 frequencies: the exact beam's, within 3 GB and some tens of seconds of processor time."""
    done = subprocess.run([sys.executable, "-c", _LARGE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    frequencies, response, used = map(float, done.stdout.split())
    assert frequencies < 1e-9
    assert response < 1e-8
    assert used < 3e6  # kilobytes


def test_more_eigenfrequencies_than_a_large_model_can_give_at_once_are_refused_with_a_number():
    model = bc.spray_boom(elements=3000)
    with pytest.raises(ValueError, match=r"count = 2000: expected at most 894 of a model of 6002 coordinates"):
        model.eigenfrequencies_hz(2000)


def graded(ratio, count):
    """Return nodes of both arms, each interval ``ratio`` times as long as the one next to it towards the hinge."""
    x = 6.0 * ratio ** -np.arange(count, dtype=float)[::-1]
    return tuple(np.concatenate([-x[::-1], [0.0], x]))


@given(st.integers(3, 20), st.floats(1.2, 5.0), st.integers(2, 17), st.floats(-6.0, 1.0), st.sampled_from([5, 30]))
@examples(30)
def test_beams_of_high_order_answer_or_refuse_in_words(order, ratio, count, distance, wanted):
    """All orders, on equal nodes and on graded ones down to 1e-6 m: no message of LAPACK, SuperLU or ARPACK."""
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
    """Where factors were singular or indefinite, and Lanczos' method did not converge: strain coordinates answer."""
    p = bc.BoomParameters(spring_distance=distance)
    x = np.asarray(graded(ratio, count))
    nodes = tuple(np.unique(np.concatenate([x, [-distance / 2, distance / 2, -3.0, 3.0]])))
    model = bc.spray_boom(p, "high-order", nodes, order=order)
    found = undamped_modes(model.structure, 4)[0] / (2.0 * np.pi)
    assert found == pytest.approx(bc.exact_eigenfrequencies_hz(p, 4, damped=False), rel=1e-8)


@pytest.mark.slow
@given(seeds, st.integers(260, 340), st.sampled_from(["force", "displacement", "acceleration"]), st.integers(3, 40))
@examples(10)
def test_few_modes_of_many_coordinates_are_those_of_strain_coordinates(seed, elements, excitation, count):
    """By Lanczos' method and sparse factors, of halves that float too: rigid motions exactly zero, springs of any size."""
    rng = np.random.default_rng(seed)
    p = bc.BoomParameters(spring_stiffness=10.0 ** rng.uniform(0.0, 6.0), spring_distance=float(rng.uniform(0.05, 2.0)))
    whole = bc.spray_boom(p, elements=elements, excitation=excitation).structure
    for half in (whole.halves[parity][1] for parity in (1, -1)):
        found, shapes = undamped_modes(half, count)
        truth = half.strain_form.modes()[0][:count]
        assert np.array_equal(found == 0.0, truth == 0.0)
        assert found == pytest.approx(truth, rel=1e-9)
        assert np.abs(shapes.T @ (half.M @ shapes) - np.eye(count)).max() < 1e-8
