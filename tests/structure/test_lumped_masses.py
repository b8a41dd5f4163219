"""A flexible robot: lumped masses on light beams, where Anthonis & Ramon (2003) expect discrete elements to do better.

A straight arm of two equal links, clamped at the shoulder, with a motor at the elbow and a payload at the tip, both point
masses.  How many times heavier these are than the beam is the parameter.
"""

import mpmath as mp
import numpy as np
import pytest

from boomctl.lab.benchmark.high_precision import carried
from boomctl.structure.assembly import Assembly
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from boomctl.structure.beams.elements import DiscreteElements, FiniteElements
from boomctl.structure.parts import GROUND, Beam, BeamSegment, RigidBody, fixed

LINK, BEAM_MASS, STIFFNESS = 1.0, 1.0, 100.0  # m, kg of both links, N m^2
MOTOR = 0.6  # share of the lumped mass that is at the elbow
MODES = 2  # as many as there are lumped masses


def arm(ratio, mesh):
    section = BeamSegment(LINK, BEAM_MASS / (2 * LINK), STIFFNESS)
    beam = Beam("arm", GROUND.at(0.0), fixed(), (0.0, 0.0), (section, section), mesh)
    masses = (("motor", LINK, MOTOR * ratio * BEAM_MASS), ("payload", 2 * LINK, (1.0 - MOTOR) * ratio * BEAM_MASS))
    return Assembly((beam, *(RigidBody(name, beam.at(x), fixed(), mass) for name, x, mass in masses)))


def exact(ratio):
    """Return the natural frequencies of the exact arm [rad/s] in 40 digits: roots of its determinant, started at ours.

    From the clamp, moment and force are carried over both links; at the tip the moment is to vanish, and the force to be
    that of the payload.
    """
    starts = undamped_frequencies(arm(ratio, FiniteElements(1)).to_exact(), MODES)
    motor, payload = MOTOR * ratio * BEAM_MASS, (1.0 - MOTOR) * ratio * BEAM_MASS
    with mp.workdps(40):

        def determinant(omega):
            link = carried(mp.sqrt(omega * mp.sqrt(mp.mpf(BEAM_MASS) / (2 * LINK) / STIFFNESS)), mp.mpf(LINK))
            state = link[:, 2:]  # of a unit moment, and a unit force, at the clamp
            state[3, :] += motor * omega**2 / STIFFNESS * state[0, :]  # E I w''' jumps by what accelerates the motor
            state = link * state
            state[3, :] += payload * omega**2 / STIFFNESS * state[0, :]
            return mp.det(state[2:, :])

        return np.array([float(mp.findroot(determinant, mp.mpf(float(start)))) for start in starts])


def error(ratio, mesh):
    return np.abs(2.0 * np.pi * arm(ratio, mesh).assemble().eigenfrequencies_hz(MODES) / exact(ratio) - 1.0).max()


def test_arm_without_mass_matches_clamped_beam():
    rate = np.sqrt(STIFFNESS * 2 * LINK / BEAM_MASS) / 4.0
    assert exact(0.0) == pytest.approx(rate * np.array([1.8751040687119611, 4.694091132974174]) ** 2, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.0, 1.0, 10.0, 100.0, 1000.0])
def test_meshes_of_the_arm_converge_to_the_exact_one(ratio):
    finite, order = (
        [error(ratio, FiniteElements(*sizes)) for sizes in pairs] for pairs in (((2,), (8,)), ((2, 4), (2, 6)))
    )
    assert finite[1] < 0.2 * finite[0]
    assert order[1] < order[0]
    assert undamped_frequencies(arm(ratio, FiniteElements(1)).to_exact(), MODES) == pytest.approx(
        exact(ratio), rel=1e-12
    )


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [100.0, 1000.0])
def test_heavy_masses_need_no_more_unknowns_in_discrete_elements(ratio):
    """For 1 %: two deflections of lumped elements do, where finite ones have slopes with a mass, too."""
    assert error(ratio, DiscreteElements(2, "lumped")) <= 1e-2
    assert error(1.0, DiscreteElements(2, "lumped")) > 1e-2
