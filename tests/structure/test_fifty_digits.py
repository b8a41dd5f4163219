"""The fifty-digit solutions and the package agree, though they share nothing."""

import numpy as np
import pytest

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.lab.benchmark.high_precision import exact_response, peak_in_many_digits, sigma_of
from tests.fifty_digits import mesh_response

OMEGA = 2.0 * np.pi * np.geomspace(0.1, 10.0, 12)
OTHER = bc.BoomParameters(boom_mass=50.0, boom_inertia=420.0, length=10.0, spring_distance=3.1, stiffness_damping=4e-4)


def largest(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


@pytest.mark.parametrize(("p", "elements"), [(bc.BoomParameters(), 6), (OTHER, 6), (OTHER, 2), (OTHER, 24)])
def test_mesh(p, elements):
    model = bc.spray_boom(p, elements=elements)
    ours = np.asarray(model.frequency_response(OMEGA, ACTUATORS, TIPS).frdata)
    assert largest(ours, mesh_response(p, OMEGA, elements)) < 1e-9


@pytest.mark.slow
def test_mesh_approaches_the_exact_beam_with_the_fourth_order():
    p = bc.BoomParameters(spring_distance=3.0)  # springs at nodes of 8, 16, 32 elements
    omega = OMEGA[:8]
    exact = exact_response(p, omega)[:2, :2]
    errors = [largest(mesh_response(p, omega, n), exact) for n in (16, 32, 64)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([4.0, 4.0], abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("elements", [50, 100, 190])
def test_mesh_with_many_elements_loses_few_digits(elements):
    p = bc.BoomParameters()
    ours = bc.sigma(bc.spray_boom(p, elements=elements), OMEGA).sigma
    assert ours == pytest.approx(sigma_of(mesh_response(p, OMEGA, elements)), rel=2e-5)


@pytest.mark.slow
def test_peak_in_fifty_digits_is_the_certified_one():
    found = bc.hinf_norm(bc.spray_boom(None, "high-order", 4, order=14).between())
    assert found.certified
    assert peak_in_many_digits(bc.BoomParameters()) == pytest.approx(found.value, rel=1e-10)
