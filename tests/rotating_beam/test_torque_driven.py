"""Motion under a torque, in modes of the free hub: laws, and plain collocation beside it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from boomctl.gauss import gauss_method
from boomctl.maneuvers import applied_torque, free_hub, sine_torque
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.rotating_beam.motion.run import _collocated
from boomctl.rotating_beam.motion.simulation import Simulation
from boomctl.slew.torque import bang_bang, held
from tests.profiles import examples
from tests.rotating_beam.strategies import ALL_MODELS

BAI = HubBeamParameters()
LOADED = HubBeamParameters(tip_mass=0.4, tip_mass_position=6.0)
MODELS = ("sfoam", "sfoam-consistent", "foam", "tlam")
SWEPT = ("free-hub modes",)


def collocated(beam, maneuver, timepts, rtol):
    """The same motion by plain collocation."""
    p, size = beam.parameters, beam.equations.size
    start = np.zeros(size), np.zeros(size)
    simulation = Simulation(beam.equations, maneuver, timepts, start, rtol, 1e-14, p.length, p.hub_radius + p.length)
    return _collocated(simulation)


def smooth(rng, end):
    """A smooth torque of up to 100 N m that begins and ends with no torque."""
    sizes = rng.uniform(-25.0, 25.0, 4)
    return applied_torque(lambda t: sum(a * np.sin((k + 1) * np.pi * t / end) for k, a in enumerate(sizes)))


@pytest.mark.parametrize("model", MODELS)
@examples(24)
@given(
    modes=st.sampled_from([1, 2, 3]),
    amplitude=st.sampled_from([1.0, 50.0, 200.0, 400.0]),
    tip_mass=st.sampled_from([0.0, 0.1, 0.4]),
    damping=st.sampled_from([0.0, 0.03]),
    rtol=st.sampled_from([1e-6, 1e-8]),
)
@example(modes=2, amplitude=100.0, tip_mass=0.0, damping=0.03, rtol=1e-8)
def test_the_error_is_below_what_is_asked_for(model, modes, amplitude, tip_mass, damping, rtol):
    beam = hub_beam(replace(BAI, tip_mass=tip_mass, damping_ratio=damping), model, modes)
    timepts, maneuver = np.linspace(0.0, 6.0, 61), sine_torque(amplitude, 4.0, 4.0)
    result = beam.simulate(maneuver, timepts, rtol=rtol, atol=1e-14)
    assert result.stages == SWEPT
    exact = collocated(beam, maneuver, timepts, 1e-2 * rtol)
    largest = np.abs(exact.tip).max()
    error = np.abs(result.tip_displacement - exact.tip).max()
    assert error <= rtol * largest
    assert result.error_estimate >= error - 1e-2 * rtol * largest
    angle = exact.states()[0][:, 0]
    assert np.abs(result.hub_angle - angle).max() <= rtol * np.abs(angle).max()


def test_error_includes_coupled_damping():
    """With the hub free the modes are coupled by their damping, which a light hub or a tip mass makes stronger."""
    p = HubBeamParameters(length=5.0, hub_inertia=1000.0, tip_mass=1.0, damping_ratio=0.1)
    beam, timepts = hub_beam(p, "sfoam", 5), np.linspace(0.0, 2.8, 281)
    state = np.zeros(2 * beam.equations.size)
    state[1:6] = 0.02 / np.arange(1, 6) ** 2
    found, exact = (beam.simulate(free_hub(), timepts, state, rtol=rtol, atol=1e-15) for rtol in (1e-6, 1e-10))
    assert found.stages == exact.stages == SWEPT
    error = np.abs(found.tip_displacement - exact.tip_displacement).max()
    assert error <= found.error_estimate + exact.error_estimate


@pytest.mark.parametrize("modes", [5, 10])
def test_a_looser_tolerance_takes_hardly_more_steps(modes):
    """Steps that are short while the torque makes fast modes vibrate are so no longer when it has ended."""
    timepts, beam = np.linspace(0.0, 60.0, 61), hub_beam(BAI, "sfoam", modes)
    tolerances = (1e-2, 1e-4, 1e-6, 1e-7, 3e-8, 1e-8, 1e-9)
    taken = [
        beam.simulate(sine_torque(200.0, 10.0, 10.0), timepts, rtol=rtol, atol=1e-15).n_steps for rtol in tolerances
    ]
    assert all(loose <= 1.1 * tight for loose, tight in pairwise(taken))


@pytest.mark.parametrize("model", [*ALL_MODELS, pytest.param("geometrically-exact", marks=pytest.mark.slow)])
@examples(4)
@given(seed=st.integers(0, 99))
def test_the_work_of_the_torque_is_in_the_energy(model, seed):
    """SFOAM as printed neglects the torque of the beam's inertia forces, which is then missing."""
    beam, end = hub_beam(LOADED, model, 2), 5.0
    maneuver = smooth(np.random.default_rng(seed), end)
    method = gauss_method(10)
    edges = np.linspace(0.0, end, 101)
    nodes = (edges[:-1, None] + np.diff(edges)[:, None] * method.nodes).ravel()
    result = beam.simulate(maneuver, np.append(nodes, end), rtol=1e-9)
    weights = np.tile(method.weights * (end / 100.0), 100)
    torque = result.torque - (result.inertia_torque if model == "sfoam" else 0.0)
    work = weights @ (torque * result.hub_speed)[:-1]
    scale = np.abs(result.energy).max()
    assert abs(result.energy[-1] - work) <= 1e-6 * scale
    momentum = weights @ torque[:-1]
    assert abs(result.angular_momentum[-1] - momentum) <= 1e-7 * np.abs(result.angular_momentum).max()


@pytest.mark.parametrize("model", MODELS)
@examples(4)
@given(seed=st.integers(0, 99))
def test_motion_runs_back_when_time_does(model, seed):
    beam, end = hub_beam(BAI, model, 2), 4.0
    there = smooth(np.random.default_rng(seed), end)
    last = beam.simulate(there, [end], rtol=1e-10).states[-1]
    half = last.size // 2
    turned = np.concatenate([last[:half], -last[half:]])
    back = beam.simulate(applied_torque(lambda t: there.torque(end - t)), [end], turned, rtol=1e-10).states[-1]
    sizes = np.abs(last).max()
    assert np.abs(back).max() <= 1e-6 * sizes


@pytest.mark.parametrize("model", MODELS)
def test_motion_may_be_taken_up_at_any_instant(model):
    beam = hub_beam(BAI, model, 2)
    whole = sine_torque(150.0, 5.0, 5.0)
    middle, end = 2.3, 7.0
    first = beam.simulate(whole, [middle], rtol=1e-9)
    later = applied_torque(lambda t: whole.torque(t + middle), (5.0 - middle,))
    second = beam.simulate(later, [end - middle], first.states[-1], rtol=1e-9)
    direct = beam.simulate(whole, [end], rtol=1e-9)
    size = np.abs(direct.states[-1]).max()
    assert np.abs(second.states[-1] - direct.states[-1]).max() <= 1e-6 * size
    assert second.tip_displacement[-1] == pytest.approx(direct.tip_displacement[-1], abs=2e-8)


@pytest.mark.parametrize("model", MODELS)
def test_the_opposite_torque_mirrors_the_motion(model):
    beam, timepts = hub_beam(BAI, model, 2), np.linspace(0.0, 5.0, 26)
    left, right = (beam.simulate(sine_torque(a, 4.0, 4.0), timepts, rtol=1e-8) for a in (100.0, -100.0))
    assert left.stages == SWEPT
    assert np.abs(left.tip_displacement + right.tip_displacement).max() <= 1e-12 * np.abs(left.tip_displacement).max()
    assert np.abs(left.hub_angle + right.hub_angle).max() <= 1e-12 * np.abs(left.hub_angle).max()
    assert np.abs(left.energy - right.energy).max() <= 1e-11 * left.energy.max()


@pytest.mark.parametrize("model", MODELS)
def test_without_torque_what_rests_stays_at_rest(model):
    result = hub_beam(BAI, model, 3).simulate(free_hub(), np.linspace(0.0, 60.0, 7))
    assert result.stages == SWEPT
    assert not result.states.any()
    assert result.error_estimate == 0.0


@pytest.mark.parametrize("intervals", [None, 1, 7, 55, 220, 257])
@pytest.mark.parametrize("model", ["sfoam", pytest.param("foam", marks=pytest.mark.slow)])
def test_a_planned_torque_moves_the_beam_as_its_function_does(model, intervals):
    """Steps end at the corners, evenly spaced or not; those of FOAM resolve the axial modes that corners excite."""
    beam, rng = hub_beam(BAI, model, 2), np.random.default_rng(intervals)
    profile = bang_bang(np.array([0.7, 1.9, 2.2]), 3.0, 80.0, 1.0)
    if intervals is not None:
        profile = held(np.linspace(0.0, 3.0, intervals + 1), rng.uniform(-80.0, 80.0, intervals))
    timepts = np.linspace(0.0, 3.0, 61)
    found = beam.simulate(profile, timepts, rtol=1e-10, atol=1e-14)
    exact = collocated(beam, applied_torque(profile, profile.breakpoints), timepts, 1e-11)
    assert found.stages == SWEPT
    assert np.abs(found.tip_displacement - exact.tip).max() <= 1e-9 * np.abs(exact.tip).max()
    ends = np.concatenate([
        p.begin + p.h * np.arange(p.force.shape[1] + 1) for p in found.details.args[2].states.func.windows
    ])  # fmt: skip
    assert np.abs(ends[:, None] - profile.edges).min(axis=0).max() <= 1e-9


def test_modes_that_creep_are_left_to_collocation():
    beam = hub_beam(replace(BAI, damping_ratio=0.999), "sfoam", 1)
    assert beam.equations.free_hub_form is None
    assert beam.simulate(sine_torque(10.0, 2.0, 2.0), [3.0]).stages == ("collocation",)
