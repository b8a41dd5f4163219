"""The hub-beam: modes, speeds, masses at the tip, the neighborhood of a critical speed, units, motion."""

from math import pi, sqrt

import control
import numpy as np
import pytest

from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import hold, hub_profile, sine_torque, spin_up
from boomctl.rotating_beam.parameters import HubBeamParameters
from tests.stress.cases import EPS, SCALES, each_relative, in_other_units, over, relative
from tests.stress.references import clamped_free_frequencies, rotating_frequencies

P = HubBeamParameters()
RATE = sqrt(P.bending_stiffness / P.mass_per_length) / P.length**2  # the unit of a clamped beam's frequencies, rad/s


def frequencies(p, model, modes, speed=0.0):
    return 2 * pi * hub_beam(p, model, modes).frequencies_hz(speed)


@over("modes", 5, 1, 12, 20, 50, 100, 200)
def test_frequencies_at_rest_equal_the_clamped_beam(check_error, modes):
    """Relative error against cos b cosh b = -1 in sixty digits."""
    true = RATE * clamped_free_frequencies(modes)
    check_error(lambda: each_relative(frequencies(P, "sfoam", modes), true), 1e-10, may_refuse=modes > 20)


@over("speed", 1.0, 0.0, 100.0, 1e4)
@over("tip", 0.5, 0.0)
def test_rotating_frequencies_equal_sixty_digits(check_error, speed, tip):
    """Three modes of SFOAM; relative error against integrals in sixty digits."""
    p = HubBeamParameters(tip_mass=tip)
    check_error(lambda: each_relative(frequencies(p, "sfoam", 3, speed), rotating_frequencies(3, speed, p)), 1e-10)


@over("ratio", 1e3, 1e-6, 1.0, 1e6)
def test_heavy_tip_frequencies_equal_sixty_digits(check_error, ratio):
    """Tip mass over the beam's; relative error against integrals in sixty digits."""
    p = HubBeamParameters(tip_mass=ratio * P.mass_per_length * P.length)
    limit = max(1e-10, 1e2 * EPS * ratio)  # the first mode is a difference of terms as large as the mass itself
    found = lambda: frequencies(p, "sfoam", 3, 1.0)  # noqa: E731
    check_error(lambda: each_relative(found(), rotating_frequencies(3, 1.0, p)), limit, may_refuse=True)


@over("delta", 1e-3, 1e-1, 1e-6, 1e-9, 1e-12)
def test_tlam_frequency_near_the_critical_speed_equals_its_law(check_error, delta):
    """Relative error against sqrt(critical^2 - speed^2)."""
    critical = RATE * float(clamped_free_frequencies(1)[0])
    speed = critical * (1.0 - delta)
    true = [sqrt((critical - speed) * (critical + speed))]
    found = lambda: frequencies(P, "tlam", 1, speed)  # noqa: E731
    check_error(lambda: each_relative(found(), true), max(1e-10, 20 * EPS / delta), may_refuse=True)


@pytest.mark.parametrize("delta", [0.0, 1e-12, 1e-3])
def test_tlam_frequency_beyond_the_critical_speed_is_refused(delta):
    beam = hub_beam(P, "tlam", 1)
    with pytest.raises(ValueError, match="hub_speed"):
        beam.frequencies_hz(beam.critical_speed() * (1.0 + delta))


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


@pytest.mark.parametrize("model", ["tlam", "sfoam", "foam"])
@over("rate", 1.0, 1e-3, 1e2)
def test_energy_without_torque_is_constant(check_error, model, rate):
    """The first mode is set moving, the hub held; relative change of energy over ten periods."""
    beam = hub_beam(P, model, 1)
    state = np.zeros(len(beam.state_names))
    state[-1] = rate

    def error():
        energy = beam.simulate(hold(), np.linspace(0.0, 20.0, 101), initial=state).energy
        return float(np.ptp(energy) / np.abs(energy).max())

    check_error(error, 1e-6, may_refuse=True)


@over("speed", 1e-3, 1e-6, 0.1)
def test_slow_spin_up_is_the_same_in_all_models(check_error, speed):
    """Difference of TLAM from FOAM, of the largest deflection: the square of speed over the first frequency."""
    grid = np.linspace(0.0, 40.0, 201)

    def tip(model):
        return hub_beam(model=model, modes=2).simulate(spin_up(speed, 30.0), grid).tip_displacement

    check_error(lambda: relative(tip("tlam"), tip("foam")), max(1e-6, 2.0 * (speed / 2.9) ** 2), may_refuse=True)


@over("off", 1e-4, 1e-2, 1e-6, 1e-8, 1e-12)
def test_profile_with_wrong_acceleration_is_refused_or_harmless(check_error, off):
    """Difference of the deflection from that of the consistent profile, of the largest."""
    beam, grid = hub_beam(modes=2), np.linspace(0.0, 20.0, 201)

    def tip(z):
        profile = hub_profile(lambda t: 1.0 - np.cos(t), np.sin, lambda t: z * np.cos(t))
        return beam.simulate(profile, grid).tip_displacement

    check_error(lambda: relative(tip(1.0 + off), tip(1.0)), 1e-8, may_refuse=True)


@pytest.mark.slow
@pytest.mark.parametrize("modes", [2, 4, 8, 16])
def test_exact_beam_error_is_within_its_estimate(check_error, modes):
    """A spin-up that leaves the tip behind; error of the tip over the estimated one, against 24 polynomials."""
    grid = np.linspace(0.0, 0.9, 31)

    def error():
        beams = (hub_beam(model="geometrically-exact", modes=n) for n in (modes, 24))
        few, true = (beam.simulate(spin_up(5.0, 0.7), grid, rtol=1e-4) for beam in beams)
        off = np.abs(few.tip_displacement - true.tip_displacement).max()
        return float(off / (few.error_estimate + true.error_estimate))

    check_error(error, 1.0)


@over("torque", 1e-2, 1e-6, 1.0)
def test_small_torque_response_is_linear(check_error, torque):
    """SFOAM under a sine of torque; difference from python-control on its linear model, of the largest."""
    beam, grid = hub_beam(modes=1), np.linspace(0.0, 20.0, 4001)
    u = np.where(grid <= 10.0, torque * np.sin(2 * pi * grid / 10.0), 0.0)

    def error():
        system = beam.linearize()
        true = np.asarray(control.forced_response(system, grid, u).outputs)
        found = beam.simulate(sine_torque(torque, 10.0, 10.0), grid).tip_displacement
        return relative(found, true[system.output_labels.index("tip_displacement")])

    check_error(error, max(1e-5, 1e-4 * torque**2))
