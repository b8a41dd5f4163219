"""The benchmark's loops: its references against the simulation and against each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.lab.benchmark.peers.boom_loop import (
    continuous_loop,
    continuous_reference,
    extended_maps,
    loop_scene,
    sampled_loop,
    sampled_reference,
)


def test_the_extended_maps_are_matrix_exponentials():
    rng = np.random.default_rng(1)
    A, B = 30.0 * rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    Phi, held, ramp = extended_maps(A, B, 0.1)
    np.testing.assert_allclose(Phi.astype(float), linalg.expm(0.1 * A), rtol=1e-9)
    np.testing.assert_allclose((A @ held).astype(float), (Phi - np.eye(4)) @ B, rtol=1e-9)
    np.testing.assert_allclose((A @ ramp).astype(float), (held - 0.1 * B).astype(float) / 0.1, rtol=1e-8)


@pytest.fixture(scope="module")
def short():
    scene = loop_scene(1.0)
    return replace(scene, limit=0.05)


def test_the_simulation_solves_the_loop_that_it_is_raced_on(short):
    disturbance = {name: short.W[short.plant.input_labels.index(name)] for name in ACTUATORS}
    found = bc.simulate_loop(
        short.plant,
        short.controller,
        disturbance,
        short.time,
        sample_time=1e-3,
        force_limit=short.limit,
        anti_windup=False,
    )
    true = sampled_reference(short)
    assert max(found.saturation_share.values()) > 0.05
    for k, name in enumerate(TIPS):
        np.testing.assert_allclose(found[name], true[k], atol=1e-10 * np.abs(true).max())


@pytest.mark.slow
def test_the_sampled_loop_tends_to_the_continuous_one(short):
    begin = short.until(301)
    exact = continuous_reference(begin)
    fine = np.linspace(0.0, 0.3, 6001)
    rows = {name: np.interp(fine, begin.time, begin.W[begin.plant.input_labels.index(name)]) for name in ACTUATORS}
    found = bc.simulate_loop(
        begin.plant, begin.controller, rows, fine, sample_time=5e-5, force_limit=begin.limit, anti_windup=False
    )
    sampled = sampled_reference(begin)
    close, far = (np.abs(y - exact).max() for y in (np.array([found[name] for name in TIPS])[:, ::20], sampled))
    assert close < 0.1 * far
    assert far < 1e-2 * np.abs(exact).max()


@pytest.mark.slow
def test_the_peers_solve_their_loops(short):
    begin = short.until(201)
    exact = continuous_reference(begin)
    np.testing.assert_allclose(continuous_loop(begin, "RK45", 1e-3), exact, atol=1e-3 * np.abs(exact).max())
    np.testing.assert_allclose(sampled_loop(begin), sampled_reference(begin), atol=2e-2 * np.abs(exact).max())
    assert begin.plant.nstates == 40
