"""Prescribed motions by steps of modes in closed form: with jumps and short pulses they are as exact as stated."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import PPoly

import boomctl as bc
from boomctl.rotating_beam.modal.integrals import modal_integrals
from tests.profiles import examples


def jumping(seed):
    """A beam and a hub that is accelerated evenly from one random jump of its acceleration to the next."""
    generator = np.random.default_rng(seed)
    beam = bc.hub_beam(
        bc.HubBeamParameters(length=generator.uniform(2.0, 8.0), tip_mass=generator.uniform(0.0, 2.0)),
        "sfoam",
        modes=int(generator.integers(2, 5)),
    )
    end = generator.uniform(0.3, 3.0) / beam.eigenfrequencies_hz()[0]
    jumps = np.append(0.0, np.sort(generator.uniform(0.05, 0.95, generator.integers(1, 5)))) * end
    pulls = 10.0 ** generator.uniform(-1.5, 0.3) * generator.normal(size=jumps.size)
    acceleration = PPoly(pulls[None], np.append(jumps, end))
    motion = acceleration.antiderivative(2), acceleration.antiderivative(), acceleration
    return beam, motion, pulls


@pytest.mark.slow
@examples(50)
@given(seed=st.integers(0, 10**6), digits=st.floats(4.0, 9.0))
@example(seed=0, digits=5.0)
def test_error_estimate_with_jump_of_acceleration(seed, digits):
    """Against the equations written out, integrated from jump to jump; fast modes vibrate after each of them."""
    beam, motion, pulls = jumping(seed)
    bounds, speed = motion[2].x, motion[1]
    m = modal_integrals(beam.parameters, beam.modes)
    solved = np.linalg.inv(m.M2)
    instants = np.union1d(np.linspace(0.0, bounds[-1], 60), bounds)
    state, found = np.zeros(2 * beam.modes), [0.0]
    for (begin, stop), pull in zip(pairwise(bounds), pulls, strict=True):

        def derivative(t, state, pull=pull):
            q, rate = np.split(state, 2)
            return np.append(rate, solved @ (speed(t) ** 2 * (m.M2 - m.D) @ q - m.K2 @ q - pull * m.V2))

        wanted = instants[(instants > begin) & (instants <= stop)]
        piece = solve_ivp(derivative, (begin, stop), state, "DOP853", wanted, rtol=1e-11, atol=1e-15)
        state = piece.y[:, -1]
        found += list(m.tip2 @ piece.y[: beam.modes])
    rtol = 10.0**-digits
    result = beam.simulate(bc.maneuvers.prescribed_motion(*motion), instants, rtol=rtol, atol=1e-12)
    error, largest = np.abs(result.tip_displacement - found).max(), np.abs(found).max()
    assert error <= 1e-12 + rtol * largest
    assert error <= result.error_estimate + 1e-10 * largest
