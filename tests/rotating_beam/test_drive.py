"""Jumps and swift motions that a torque or a hub profile does not declare cost steps, and no accuracy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.rotating_beam.drive import resolving
from tests.profiles import examples

END = 20.0
SECONDS = np.arange(0.0, END + 1.0)
MODELS = ("sfoam", "foam", "tlam")


def pulse(begin, width, size=2.0):
    return lambda t: np.where((t >= begin) & (t < begin + width), size, 0.0)


@pytest.mark.slow
@examples(100)
@given(st.floats(0.01, 18.0), st.floats(-3.2, 0.2), st.sampled_from(MODELS))
def test_a_pulse_that_is_not_declared_moves_the_beam_as_one_that_is(begin, decades, model):
    width = 10.0**decades  # from just above the resolution, 0.5 ms
    beam = bc.hub_beam(model=model, modes=2)
    found = beam.simulate(bc.torque(pulse(begin, width)), SECONDS)
    declared = beam.simulate(bc.torque(pulse(begin, width), (begin, begin + width)), SECONDS)
    peak = np.abs(declared.tip_displacement).max()
    apart = np.abs(found.tip_displacement - declared.tip_displacement).max()
    assert peak > 0.0
    assert apart <= 1e-10 + 1e-8 * peak
    assert apart <= found.error_estimate + 1e-14


@pytest.mark.parametrize("model", ["cfoam", pytest.param("geometrically-exact", marks=pytest.mark.slow)])
def test_other_integrators_know_of_the_jumps_too(model):
    beam, timepts = bc.hub_beam(model=model, modes=1), np.linspace(0.0, 1.0, 3)
    found = beam.simulate(bc.torque(pulse(0.25031, 0.003)), timepts, rtol=1e-6, atol=1e-8)
    declared = beam.simulate(bc.torque(pulse(0.25031, 0.003), (0.25031, 0.25331)), timepts, rtol=1e-6, atol=1e-8)
    assert found.tip_displacement == pytest.approx(declared.tip_displacement, abs=1e-9)
    assert np.abs(found.tip_displacement).max() > 1e-6


@examples(50)
@given(st.lists(st.floats(0.05, 19.9), min_size=1, max_size=8, unique=True))
def test_steps_of_a_torque_that_jumps_end_at_its_jumps(instants):
    places = np.sort(instants)
    edges = resolving(np.linspace(0.0, END, 11), lambda t: (np.searchsorted(places, t, side="right") % 2).astype(float))
    assert np.abs(edges[:, None] - places).min(axis=0).max() <= 2e-12 * END


@pytest.mark.parametrize("smooth", [np.sin, lambda t: np.exp(-t), lambda t: t**3 - 1e3 * t, lambda t: 1.0 + 0.0 * t])
def test_steps_of_a_smooth_torque_stay_as_they_are(smooth):
    edges = np.linspace(0.0, END, 21)
    np.testing.assert_array_equal(resolving(edges, smooth), edges)


@examples(50)
@given(st.floats(1.0, 18.0), st.floats(-3.5, -0.5))
def test_a_swift_and_smooth_pulse_is_not_passed_over(middle, decades):
    width = 10.0**decades
    beam = bc.hub_beam(model="sfoam", modes=2)

    def bell(t):
        return 2.0 * np.exp(-(((t - middle) / width) ** 2))

    found = beam.simulate(bc.torque(bell), SECONDS)
    close = tuple(middle + width * np.arange(-6.0, 6.5, 0.5))
    known = beam.simulate(bc.torque(bell, close), SECONDS)
    apart = np.abs(found.tip_displacement - known.tip_displacement).max()
    assert apart <= 1e-10 + 1e-8 * np.abs(known.tip_displacement).max()


def test_a_function_of_numbers_alone_is_looked_at_too():
    def stepped(t):
        return 2.0 * math.sin(t) if t > 3.00021 else 0.0

    beam = bc.hub_beam(model="sfoam", modes=1)
    found = beam.simulate(bc.torque(stepped), SECONDS)
    known = beam.simulate(bc.torque(stepped, (3.00021,)), SECONDS)
    assert found.tip_displacement == pytest.approx(known.tip_displacement, abs=1e-10)


@examples(30)
@given(st.floats(1.0, 4.0), st.floats(0.3, 2.0), st.sampled_from(["sfoam", "foam"]))
def test_hub_profiles_with_jumps_of_the_acceleration_or_its_slope_are_honest(begin, width, model):
    def since(t, k):
        return np.maximum(np.asarray(t) - begin, 0.0) ** k - np.maximum(np.asarray(t) - begin - width, 0.0) ** k

    beam = bc.hub_beam(model=model, modes=2)
    for order in (2, 3):  # of the angle: its second derivative jumps, or its third
        profile = (
            lambda t, order=order: 0.01 * since(t, order),
            lambda t, order=order: 0.01 * order * since(t, order - 1),
            lambda t, order=order: 0.01 * order * (order - 1) * (since(t, 1) if order == 3 else _box(t, begin, width)),
        )
        found = beam.simulate(bc.hub_profile(*profile), np.arange(0.0, 9.0))
        known = beam.simulate(bc.hub_profile(*profile, breakpoints=(begin, begin + width)), np.arange(0.0, 9.0))
        apart = np.abs(found.tip_displacement - known.tip_displacement).max()
        assert apart <= found.error_estimate + known.error_estimate + 1e-13


def _box(t, begin, width):
    return ((np.asarray(t) >= begin) & (np.asarray(t) < begin + width)).astype(float)
