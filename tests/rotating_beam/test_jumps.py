"""Jumps and swift motions that a torque or a hub profile does not declare cost steps, and no accuracy."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.rotating_beam.jumps import steps_resolving
from tests.profiles import examples

END = 20.0
SECONDS = np.arange(0.0, END + 1.0)


def pulse(begin, width):
    """Return a torque that jumps twice, and when."""
    return lambda t: np.where((t >= begin) & (t < begin + width), 2.0, 0.0), (begin, begin + width)


def bell(begin, width):
    """Return a torque that is swift and smooth, and instants close to one another along it."""
    return lambda t: 2.0 * np.exp(-(((t - begin) / width) ** 2)), tuple(begin + width * np.arange(-6.0, 6.5, 0.5))


def numbers(begin, width):
    """Return a torque that takes a number, no array, and when it jumps."""
    return lambda t: 2.0 * math.sin(t) if t > begin else 0.0, (begin,)


@pytest.mark.parametrize(
    ("shape", "model"),
    [
        (bell, "sfoam"),
        pytest.param(numbers, "sfoam", marks=pytest.mark.slow),
        *(pytest.param(pulse, model, marks=pytest.mark.slow) for model in ("sfoam", "foam", "tlam")),
    ],
)
@examples(50)
@given(st.floats(0.01, 18.0), st.floats(-3.2, -0.5))
def test_torque_undeclared_moves_beam_as_declared(shape, model, begin, decades):
    """From just above the resolution, 0.5 ms."""
    beam, (function, instants) = bc.hub_beam(model=model, modes=2), shape(begin, 10.0**decades)
    inside = tuple(t for t in instants if 0.0 < t < END)
    found, declared = (beam.simulate(bc.maneuvers.applied_torque(function, each), SECONDS) for each in ((), inside))
    peak = np.abs(declared.tip_displacement).max()
    apart = np.abs(found.tip_displacement - declared.tip_displacement).max()
    assert peak > 0.0
    assert apart <= 1e-10 + 1e-8 * peak
    assert apart <= found.error_estimate + 1e-14


@pytest.mark.parametrize("model", ["cfoam", pytest.param("geometrically-exact", marks=pytest.mark.slow)])
def test_other_integrators_know_of_the_jumps_too(model):
    beam, (function, instants) = bc.hub_beam(model=model, modes=1), pulse(0.25031, 0.003)
    found, declared = (
        beam.simulate(bc.maneuvers.applied_torque(function, each), np.linspace(0.0, 1.0, 3), rtol=1e-6, atol=1e-8)
        for each in ((), instants)
    )
    assert found.tip_displacement == pytest.approx(declared.tip_displacement, abs=1e-9)
    assert np.abs(found.tip_displacement).max() > 1e-6


@examples(50)
@given(st.lists(st.floats(0.05, 19.9), min_size=1, max_size=8, unique=True))
def test_steps_of_a_torque_that_jumps_end_at_its_jumps(instants):
    places = np.sort(instants)
    edges = steps_resolving(
        np.linspace(0.0, END, 11), lambda t: (np.searchsorted(places, t, side="right") % 2).astype(float)
    )
    assert np.abs(edges[:, None] - places).min(axis=0).max() <= 2e-12 * END


@pytest.mark.parametrize("smooth", [np.sin, lambda t: np.exp(-t), lambda t: t**3 - 1e3 * t, lambda t: 1.0 + 0.0 * t])
def test_steps_of_a_smooth_torque_stay_as_they_are(smooth):
    edges = np.linspace(0.0, END, 21)
    np.testing.assert_array_equal(steps_resolving(edges, smooth), edges)


@examples(50)
@given(
    st.floats(1.0, 4.0),
    st.one_of(st.floats(0.3, 2.0), st.floats(-4.0, -3.3).map(lambda decades: 10.0**decades)),
    st.sampled_from([2, 3]),
    st.sampled_from(["sfoam", "foam"]),
)
@example(begin=2.1, width=3e-4, order=2, model="sfoam")
def test_profile_undeclared_moves_beam_as_declared(begin, width, order, model):
    """The second or the third derivative of the angle jumps; a pulse shorter than what is looked at shows in the speed."""
    scale, swing = (0.01, 0.0) if width >= 0.3 else (0.5, 1.0)

    def derivative(k):
        def value(t):
            since, after = (np.asarray(t) - begin - late for late in (0.0, width))
            pair = [np.where(each >= 0.0, np.abs(each) ** (order - k), 0.0) for each in (since, after)]
            turned = scale * math.perm(order, k) * (pair[0] - pair[1])
            return turned + swing * ((k == 0) - np.cos(np.asarray(t) + 0.5 * k * np.pi))

        return value

    functions, beam = [derivative(k) for k in range(3)], bc.hub_beam(model=model, modes=2)
    found = beam.simulate(bc.maneuvers.prescribed_motion(*functions), np.arange(0.0, 9.0))
    known = beam.simulate(bc.maneuvers.prescribed_motion(*functions, (begin, begin + width)), np.arange(0.0, 9.0))
    apart = np.abs(found.tip_displacement - known.tip_displacement).max()
    assert apart <= found.error_estimate + known.error_estimate + 1e-13
    assert apart <= 1e-10 + 2e-8 * np.abs(known.tip_displacement).max()
