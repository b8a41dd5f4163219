"""Structure-preserving reduction: the result is a structure, stable, and verified."""

import numpy as np
import pytest
from hypothesis import assume, given

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.structure import SecondOrderModel
from tests.profiles import examples
from tests.reduction.test_reduce import gap
from tests.strategies import seeds, structures


@given(structures(least=5))
def test_second_order_result_is_passive(structure):
    red = bc.reduce(structure.model, order=6, method="second-order")
    small = red.system
    assert isinstance(small, SecondOrderModel)
    assert (small.ncoordinates, red.order) == (3, 6)
    assert (small.input_labels, small.output_labels) == (structure.model.input_labels, structure.model.output_labels)
    for matrix in (small.M, small.C, small.K):
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    shown = gap(structure.model, small, np.concatenate([[0.0], np.geomspace(0.01, 100.0, 800)]))
    assert shown.max() <= red.error_norm * (1 + 1e-6)
    assert shown.max() >= 0.5 * red.error_norm
    assert shown[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("elements", [6, pytest.param(60, marks=pytest.mark.slow)])
def test_second_order_boom_within_max_error(elements):
    model = bc.spray_boom(elements=elements).select(ACTUATORS, TIPS)
    red = bc.reduce(model, max_error=1.0, method="second-order")
    assert (red.system.input_labels, red.system.output_labels) == (ACTUATORS, TIPS)
    assert red.error_norm <= 1.0
    assert gap(model, red.system.to_statespace(), bc.sigma(model).omega).max() <= red.error_norm
    worse = bc.reduce(model, order=red.order - 2, method="second-order")
    assert worse.error_norm > 1.0


def test_a_band_is_reduced_for_itself():
    model = bc.spray_boom(elements=20).select(ACTUATORS, TIPS)
    band = (60.0, 75.0)
    small, wide = (bc.reduce(model, order=6, method="second-order", omega_range=limits) for limits in (band, None))
    errors = [gap(model, found.system, np.linspace(*band, 400)).max() for found in (small, wide)]
    assert errors[0] <= small.error_norm * (1 + 1e-6)
    assert errors[0] <= errors[1]


def oscillators(frequencies, damping):
    """Return masses side by side, all pushed by one force and read by one output."""
    n = len(frequencies)
    return SecondOrderModel(np.eye(n), np.diag(damping), np.diag(frequencies**2), {"f": np.ones(n)}, {"y": np.ones(n)})


@pytest.mark.parametrize("band", [None, (1.0, 3.0)])
@given(seed=seeds)
@examples(100)
def test_mode_that_is_kept_has_the_highest_peak(band, seed):
    """Of one in all, or the one that reaches highest within the band."""
    rng = np.random.default_rng(seed)
    frequencies = np.array([0.4, 1.7, 4.0, 9.0]) * rng.uniform(0.8, 1.2, 4)
    damping = 10.0 ** rng.uniform(-3.0, 0.3, 4)
    omega = np.geomspace(*(band or (0.1, 30.0)), 20_000)
    s = 1j * np.append(omega, frequencies if band is None else [])[:, None]
    peaks = np.abs(1.0 / (s**2 + damping * s + frequencies**2)).max(axis=0)
    second, first = np.sort(peaks)[-2:]
    assume(first > 1.5 * second)
    small = bc.reduce(oscillators(frequencies, damping), order=2, method="second-order", omega_range=band).system
    assert small.K[0, 0] == pytest.approx(frequencies[peaks.argmax()] ** 2, rel=1e-9)


def test_band_reduction_is_exact_in_its_middle_but_for_damping():
    """What modes outside the band answer at its middle is added, at the mean of its ends on a logarithmic axis."""
    model = oscillators(np.array([0.2, 1.0, 4.0, 7.0]), np.full(4, 1e-6))
    small = bc.reduce(model, order=2, method="second-order", omega_range=(0.8, 1.4)).system
    middle = [np.sqrt(0.8 * 1.4)]
    full, found = (np.asarray(m.frequency_response(middle).frdata) for m in (model, small))
    assert small.K[0, 0] == pytest.approx(1.0)
    assert found == pytest.approx(full, rel=1e-5)
