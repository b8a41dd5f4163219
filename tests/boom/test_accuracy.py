"""Meshes chosen by accuracy: as exact as asked for between the frequencies they were tried at, and not finer than need be."""

from dataclasses import replace

import numpy as np
import pytest

import boomctl as bc


def _machine(rng):
    """Return a boom of 4 to 40 m in steel or aluminum, springs and dampers a decade up and down, and a band [Hz]."""

    def around(value, decades=0.5):
        return value * 10.0 ** rng.uniform(-decades, decades)

    length = rng.uniform(4.0, 40.0)
    width = length * rng.uniform(0.0008, 0.003)
    steel = rng.random() < 0.5
    p = bc.BoomParameters(
        length=length,
        outer_width=width,
        inner_width=width * rng.uniform(0.0, 0.9),
        outer_height=width * 2.0,
        inner_height=width * rng.uniform(0.0, 1.8),
        density=7800.0 if steel else 2700.0,
        youngs_modulus=1.8e11 if steel else 7e10,
        spring_distance=length * rng.uniform(0.03, 0.5),
        actuator_distance=length * rng.uniform(0.03, 0.3),
        spring_stiffness=around(1100.0),
        cradle_damping=around(160.0),
        hinge_damping=around(2.0, 1.0),
        stiffness_damping=around(1e-4, 1.0),
        boom_mass=1e4,
        boom_inertia=1e6,
    )
    p = replace(p, boom_mass=p.tube_mass * rng.uniform(1.0, 2.0), boom_inertia=p.tube_inertia * rng.uniform(1.0, 1.5))
    return p, float(rng.choice([2.0, 10.0, 40.0])), float(10.0 ** rng.uniform(-6.5, -0.5))


def _error(p, model, band, rng):
    """Return the largest error at other frequencies than the choice was made at, resonances of the exact boom included."""
    poles = bc.spray_boom(p, "high-order", 12, order=12).to_statespace().poles()
    poles = poles[(poles.imag > 0.0) & (poles.imag < 2.2 * np.pi * band)]
    near = (poles.imag[:, None] + np.abs(poles.real)[:, None] * rng.uniform(-2.0, 2.0, 15)).ravel()
    omega = np.concatenate([near, 2.0 * np.pi * band * 10.0 ** rng.uniform(-3.0, 0.0, 400)])
    omega = np.sort(omega[(omega > 2e-3 * np.pi * band) & (omega < 2.0 * np.pi * band)])
    wanted = bc.exact_frequency_response(p, omega).frdata
    found = model.frequency_response(omega).frdata
    worst = 0.0
    for rows in ([0, 1], [2, 3], [4]):
        for columns in ([0, 1], [2, 3, 4]):
            sizes = [
                np.linalg.norm(np.moveaxis(each[np.ix_(rows, columns)], 2, 0), 2, axis=(1, 2))
                for each in (found - wanted, wanted)
            ]
            worst = max(worst, float((sizes[0] / sizes[1]).max()))
    return worst


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_random_boom_is_as_exact_as_asked_for(seed):
    rng = np.random.default_rng(seed)
    p, band, accuracy = _machine(rng)
    model = bc.spray_boom(p, accuracy=accuracy, max_frequency_hz=band)
    assert model.selection.error <= accuracy
    assert _error(p, model, band, rng) <= accuracy


def test_what_was_chosen_is_said_and_is_what_is_built():
    model = bc.spray_boom(accuracy=1e-3, max_frequency_hz=10.0, nozzles=[-2.0, 0.5])
    assert (model.selection.elements, model.selection.order) == (4, 9)
    assert "4 high-order elements of order 9" in repr(model)
    same = bc.spray_boom(discretization="high-order", elements=4, order=9, nozzles=[-2.0, 0.5])
    np.testing.assert_array_equal(model.K, same.K)
    assert model.selection.tried[0][:2] == (4, 14)  # from the finest of so many elements down
    coarser = next(error for elements, order, error in model.selection.tried if (elements, order) == (4, 8))
    assert coarser > 1e-3 * 0.8


def test_of_a_boom_driven_by_forces():
    model = bc.spray_boom(accuracy=1e-3, max_frequency_hz=10.0, excitation="force")
    omega = np.geomspace(0.1, 60.0, 50)
    wanted = bc.exact_frequency_response(bc.BoomParameters(), omega, outputs=["tip_left"], excitation="force").frdata
    found = model.frequency_response(omega, outputs=["tip_left"]).frdata
    assert (np.abs(found - wanted).max(axis=(0, 1)) <= 1e-3 * np.abs(wanted).max(axis=(0, 1))).all()
