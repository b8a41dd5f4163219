"""Meshes with elements up to 1e11 times as long as their neighbours, and very fine ones: right, or said not to be."""

import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.analysis.norm import LOST
from boomctl.structure.response.poles import damped_poles, undamped_modes
from tests.profiles import examples
from tests.strategies import seeds


def graded_pair(seed):
    """Return a boom with random nodes, and one with three more a hair's breadth beside some of them."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5)) if rng.random() < 0.8 else 40
    half = np.linspace(0.2, 5.9, count) + rng.uniform(0.0, 0.05, count)
    beside = [half[:2] + 10.0 ** rng.uniform(-11.0, -5.0, 2), 10.0 ** rng.uniform(-11.0, -4.0, 1)]
    booms = []
    for right in (np.unique([*half, 6.0]), np.unique(np.concatenate([half, *beside, [6.0]]))):
        booms.append(bc.spray_boom(elements=tuple(np.concatenate([-right[::-1], [0.0], right]))))
    return booms


@given(seeds)
@examples(30)
def test_a_boom_with_elements_of_no_length_is_the_boom_without(seed):
    """Modes, damped poles, responses, and the peak, which no locking of a half or short element changes.

    Where an element is so short that the last digits of its stiffness decide the peak, this is said, and the bounds hold.
    """
    plain, short = graded_pair(seed)
    modes, poles = (find(plain.structure, 4) for find in (lambda s, n: undamped_modes(s, n)[0], damped_poles))
    assert undamped_modes(short.structure, 4)[0] == pytest.approx(modes, rel=1e-4)
    assert np.abs(damped_poles(short.structure, 4) / poles - 1.0).max() < 1e-4
    omega = np.array([0.1, 1.5, 5.0])
    found, truth = (model.frequency_response(omega).frdata for model in (short, plain))
    assert np.abs(found - truth).max() < 1e-4 * np.abs(truth).max()
    certified, peak = bc.sigma(short).certificate, bc.sigma(plain).peak
    assert certified.lower <= peak * 1.0001 <= certified.upper * 1.0002
    if certified.certified:
        assert certified.lower == pytest.approx(peak, rel=1e-4)
    else:
        assert certified.method.startswith(LOST)


@pytest.mark.parametrize("elements", [40, pytest.param(300, marks=pytest.mark.slow)])
def test_springs_that_hardly_hold_are_not_rigid_bodies(elements):
    """The slowest mode is 1e-8 of what the mesh's fastest is; the peak is finite, and that of a coarse mesh."""
    p = bc.BoomParameters(spring_stiffness=1e-6)
    found, coarse = bc.sigma(bc.spray_boom(p, elements=elements)).certificate, bc.sigma(bc.spray_boom(p, elements=12))
    assert np.isfinite(found.lower)
    assert found.lower <= coarse.peak * 1.001 <= found.upper * 1.002


@pytest.mark.slow
@pytest.mark.parametrize("elements", [10000, 20000, 100000])
def test_the_peak_of_very_fine_meshes_is_certified_and_right(elements):
    """It does not change any more from 3,000 elements on."""
    found, truth = bc.sigma(bc.spray_boom(elements=elements)), bc.sigma(bc.spray_boom(elements=3000))
    assert found.certificate.certified
    assert found.peak == pytest.approx(truth.peak, rel=1e-7)
