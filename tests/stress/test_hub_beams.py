"""The hub-beam: modes, speeds, masses at the tip, the neighborhood of a critical speed, units."""

from math import pi, sqrt

import pytest

from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters
from tests.stress.cases import EPS, SCALES, each_relative, in_other_units, over
from tests.stress.references import clamped_free_frequencies, rotating_frequencies

P = HubBeamParameters()
RATE = sqrt(P.bending_stiffness / P.mass_per_length) / P.length**2  # the unit of a clamped beam's frequencies, rad/s


def frequencies(p, model, modes, speed=0.0):
    return 2 * pi * hub_beam(p, model, modes).eigenfrequencies_hz(speed)


@over("modes", 5, 1, 12, 20, 50, 100, 200)
def test_frequencies_at_rest_equal_the_clamped_beam(check_error, modes):
    """Relative error against cos b cosh b = -1 in sixty digits."""
    true = RATE * clamped_free_frequencies(modes)
    check_error(lambda: each_relative(frequencies(P, "sfoam", modes), true), 1e-10, may_refuse=modes > 20)


@over("speed", 1.0, 0.0, 100.0, 1e4)
@over("ratio", 1.0, 0.0, 1e-6, 1e3, 1e6)
def test_rotating_frequencies_equal_sixty_digits(check_error, speed, ratio):
    """Three modes of SFOAM, tip mass over the beam's; relative error against integrals in sixty digits."""
    p = HubBeamParameters(tip_mass=ratio * P.mass_per_length * P.length)
    limit = max(1e-10, 1e2 * EPS * ratio)  # the first mode is a difference of terms as large as the mass itself
    found = lambda: frequencies(p, "sfoam", 3, speed)  # noqa: E731
    check_error(lambda: each_relative(found(), rotating_frequencies(3, speed, p)), limit, may_refuse=ratio > 1.0)


# powers of length, force and time in the unit of each parameter
UNITS = {
    "length": (1, 0, 0),
    "density": (-4, 1, 2),
    "area": (2, 0, 0),
    "youngs_modulus": (-2, 1, 0),
    "second_moment": (4, 0, 0),
    "hub_inertia": (1, 1, 2),
    "hub_radius": (1, 0, 0),
    "tip_mass": (-1, 1, 2),
}


@pytest.mark.parametrize("unit", ["length", "force", "time"])
@over("scale", *SCALES)
def test_hub_beam_in_other_units_scales(check_error, unit, scale):
    """Relative error of frequencies against the law of scaling."""
    p, slower = HubBeamParameters(tip_mass=0.1), scale if unit == "time" else 1.0
    other = in_other_units(p, UNITS, unit, scale)
    found = lambda: frequencies(other, "sfoam", 3, 1.0 / slower) * slower  # noqa: E731
    check_error(lambda: each_relative(found(), frequencies(p, "sfoam", 3, 1.0)), 1e-9, may_refuse=True)
