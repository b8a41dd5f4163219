"""Modes and poles: residuals, orthogonality, and rigid-body modes."""

import numpy as np
import pytest
from hypothesis import given
from scipy import linalg

from boomctl.structure import (
    SecondOrderModel,
    prescribe_displacement,
)
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.poles import damped_poles
from tests.references import natural_frequencies
from tests.strategies import random_machine, random_stepped_beam, seeds, structures


def chain(n, ends=0.0):
    """Return unit masses in a row with unit springs between them, ``ends`` to the walls; a little damping."""
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[0, 0] = K[-1, -1] = 1.0 + ends
    return SecondOrderModel(np.eye(n), 0.01 * K, K, {"f": np.eye(n)[0]}, {"y": np.eye(n)[-1]})


@given(seeds)
def test_modes_diagonalise_mass_and_stiffness(seed):
    """The lowest six; the highest of a stiff machine are a hundred million times stiffer than the lowest."""
    model = random_machine(seed).assemble()
    found = model.mode_shapes(min(6, model.ncoordinates))
    omega, V = 2.0 * np.pi * found.eigenfrequencies_hz, found.shapes
    assert (np.diff(omega) >= 0.0).all()
    M, K = model.M, model.K
    assert np.abs(V.T @ M @ V - np.eye(len(omega))).max() < 1e-9
    size = np.sqrt(np.outer(*2 * [omega**2 + 1.0]))
    assert np.abs((V.T @ K @ V - np.diag(omega**2)) / size).max() < 1e-8


@pytest.mark.parametrize("order", [3, 6, 10, 14])
@given(seed=seeds)
def test_floating_structures_keep_their_elastic_modes(seed, order):
    """However many digits the rigid-body modes and the highest ones would like to take."""
    model = random_stepped_beam(seed, order).assemble()
    found, expected = undamped_modes(model.structure, 6)[0], natural_frequencies(model)[:6]
    assert np.allclose(found**2, expected**2, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("ends", [0.0, 1.0])
def test_undamped_modes_long_chain_closed_form(ends):
    """Of 400 masses: ``2 sin(k pi/2n)`` free, ``2 sin(k pi/(2n + 2))`` between walls."""
    n = 400
    k = np.arange(8) if ends == 0.0 else np.arange(1, 9)
    expected = 2 * np.sin(k * np.pi / (2 * n + 2 * ends))
    found = undamped_modes(chain(n, ends).structure, 8)[0]
    assert np.allclose(found, expected, rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize("skew", [0.0, 0.05])
@given(structure=structures(), seed=seeds)
def test_poles_are_the_roots_of_the_quadratic_pencil(structure, seed, skew):
    """Of unsymmetric matrices too."""
    parts = skew * np.random.default_rng(seed).standard_normal((3, *structure.M.shape))
    M, C, K = (X + part for X, part in zip((structure.M, structure.C, structure.K), parts, strict=True))
    model = SecondOrderModel(M, C, K)
    poles = damped_poles(model.structure, 2)
    for s in poles:
        D = K + s * C + s * s * M
        assert linalg.svdvals(D)[-1] < 1e-12 * linalg.norm(D)
        assert s.imag > 0
    assert model.eigenfrequencies_hz(2) == pytest.approx(poles.imag / (2 * np.pi), rel=1e-12)


@given(structures(inputs=2))
def test_poles_invariant_to_redundant_inputs(structure):
    """Velocity and acceleration inputs add integrators, not resonances."""
    models = [prescribe_displacement(structure.model, "f0", motion=m) for m in ("displacement", "acceleration")]
    first, second = (model.eigenfrequencies_hz(1) for model in models)
    assert np.array_equal(first, second)


@pytest.mark.parametrize(("n", "oscillating"), [(1, 1), (3, 3), (7, 5)])
def test_default_number_of_modes_is_five_or_all(n, oscillating):
    model = chain(n, 1.0)
    assert len(model.eigenfrequencies_hz()) == len(model.mode_shapes().eigenfrequencies_hz) == oscillating
    assert len(SecondOrderModel(np.eye(n), 10.0 * np.eye(n), np.eye(n)).eigenfrequencies_hz()) == 0
