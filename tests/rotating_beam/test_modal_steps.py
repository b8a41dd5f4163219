"""Prescribed motions by steps of modes in closed form: with jumps and short pulses they are as exact as stated."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

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
    end = generator.uniform(0.3, 3.0) / beam.frequencies_hz()[0]
    jumps = np.append(0.0, np.sort(generator.uniform(0.05, 0.95, generator.integers(1, 5)))) * end
    pulls = 10.0 ** generator.uniform(-1.5, 0.3) * generator.normal(size=jumps.size)
    speeds = np.append(0.0, np.cumsum(pulls[:-1] * np.diff(jumps)))
    turned = np.append(0.0, np.cumsum((speeds[:-1] + 0.5 * pulls[:-1] * np.diff(jumps)) * np.diff(jumps)))

    def of_piece(k, t):
        since = t - jumps[k]
        return (
            turned[k] + (speeds[k] + 0.5 * pulls[k] * since) * since,
            speeds[k] + pulls[k] * since,
            pulls[k] + 0.0 * since,
        )

    def function(which):
        return lambda t: of_piece(np.searchsorted(jumps, t, side="right") - 1, t)[which]

    return beam, bc.hub_profile(*map(function, range(3))), np.append(jumps, end), of_piece


@pytest.mark.slow
@examples(50)
@given(seed=st.integers(0, 10**6), digits=st.floats(4.0, 9.0))
@example(seed=0, digits=5.0)
def test_tolerance_and_estimate_hold_where_the_acceleration_jumps(seed, digits):
    """Against the equations written out, integrated from jump to jump; fast modes vibrate after each of them."""
    beam, motion, bounds, of_piece = jumping(seed)
    m = modal_integrals(beam.parameters, beam.modes)
    solved = np.linalg.inv(m.M2)
    instants = np.union1d(np.linspace(0.0, bounds[-1], 60), bounds)
    state, found = np.zeros(2 * beam.modes), [0.0]
    for k, (begin, stop) in enumerate(pairwise(bounds)):

        def derivative(t, state, k=k):
            _, speed, pull = of_piece(k, t)
            q, rate = np.split(state, 2)
            return np.append(rate, solved @ (speed**2 * (m.M2 - m.D) @ q - m.K2 @ q - pull * m.V2))

        wanted = instants[(instants > begin) & (instants <= stop)]
        piece = solve_ivp(derivative, (begin, stop), state, "DOP853", wanted, rtol=1e-11, atol=1e-15)
        state = piece.y[:, -1]
        found += list(m.tip2 @ piece.y[: beam.modes])
    rtol = 10.0**-digits
    result = beam.simulate(motion, instants, rtol=rtol, atol=1e-12)
    error, largest = np.abs(result.tip_displacement - found).max(), np.abs(found).max()
    assert error <= 1e-12 + rtol * largest
    assert error <= result.error_estimate + 1e-10 * largest
