"""Fine and graded meshes against the exact beam."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.boom.exact import exact_boom
from boomctl.exceptions import AccuracyWarning
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from boomctl.structure.response.modes import undamped_modes
from tests.profiles import examples

P = bc.BoomParameters()


@pytest.mark.parametrize(("excitation", "rigid"), [("displacement", 0), ("force", 2)])
@pytest.mark.parametrize("elements", [25, 50, *(pytest.param(n, marks=pytest.mark.slow) for n in (100, 190))])
def test_frequencies_of_fine_mesh_are_those_of_exact_beam(elements, excitation, rigid):
    """The error falls with the third power of the elements' length, where springs act between nodes."""
    model = bc.spray_boom(elements=elements, excitation=excitation)
    slack = 4e-6 * (100.0 / elements) ** 3
    found = undamped_modes(model.structure, rigid + 5)[0]
    assert np.array_equal(found[:rigid], np.zeros(rigid))
    assert found[rigid:] == pytest.approx(undamped_frequencies(exact_boom(P, excitation), 5), rel=slack)
    if rigid:
        assert model.eigenfrequencies_hz(3).min() > 0.1  # none is a rigid motion's rounding
    else:
        assert model.eigenfrequencies_hz(5) == pytest.approx(bc.exact_eigenfrequencies_hz(P, 5), rel=slack)


@pytest.mark.parametrize("excitation", ["displacement", "force"])
@pytest.mark.parametrize("elements", [25, 100, pytest.param(190, marks=pytest.mark.slow)])
def test_response_fine_mesh_each_signal_is_near_exact_beam(elements, excitation):
    """Relative to the largest output of each input, at many frequencies to that of all; nothing is said of rounding."""
    model = bc.spray_boom(P, elements=elements, excitation=excitation)
    for highest, points, share, axis in ((10.0, 20, 2e-4, 1), (5.0, 100, 3e-4, None)):
        omega = 2.0 * np.pi * np.geomspace(0.01 * highest, highest, points)
        exact = np.asarray(bc.exact_frequency_response(P, omega, excitation=excitation).frdata)
        with warnings.catch_warnings():
            warnings.simplefilter("error", AccuracyWarning)
            found = np.asarray(model.frequency_response(omega).frdata)
        slack = share * (100.0 / elements) ** 3
        assert (np.abs(found - exact) <= slack * np.abs(exact).max(axis=axis, keepdims=True)).all()


@pytest.mark.slow
def test_spray_boom_largest_mesh_is_computed():
    model = bc.spray_boom(elements=499)
    assert model.ncoordinates == 1000
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
        if model.ncoordinates > 300:
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
def test_graded_beam_modes_match_exact_beam(order, ratio, count, distance):
    """Where factors are singular or indefinite: strain coordinates answer."""
    p = bc.BoomParameters(spring_distance=distance)
    x = np.asarray(graded(ratio, count))
    nodes = tuple(np.unique(np.concatenate([x, [-distance / 2, distance / 2, -3.0, 3.0]])))
    model = bc.spray_boom(p, "high-order", nodes, order=order)
    found = undamped_modes(model.structure, 4)[0] / (2.0 * np.pi)
    assert found == pytest.approx(bc.exact_eigenfrequencies_hz(p, 4, damped=False), rel=1e-8)
