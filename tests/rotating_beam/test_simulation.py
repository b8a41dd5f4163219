"""Simulation: conservation, limits, independent integration, then the reference numbers."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import PPoly

import boomctl as bc
from boomctl.maneuvers import applied_torque, free_hub, hold_angle, prescribed_motion, sine_torque, spin_up
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.rotating_beam.modal.integrals import modal_integrals
from boomctl.rotating_beam.motion import modal_collocation
from tests.profiles import examples
from tests.rotating_beam import references
from tests.rotating_beam.strategies import ALL_MODELS

pytestmark = pytest.mark.early

BAI = HubBeamParameters()
LOADED = HubBeamParameters(tip_mass=0.4, tip_mass_position=6.0)


def bent_and_spinning(beam, bend, spin):
    """A state with the first two transverse modes bent and the hub turning."""
    state = np.zeros(2 * beam.equations.size)
    first = 1 + (beam.modes if beam.has_axial_modes else 0)
    state[first], state[first + 1] = bend, -0.2 * bend
    state[beam.equations.size] = spin
    return state


@pytest.mark.parametrize("model", ["tlam", "sfoam-consistent", "foam", pytest.param("cfoam", marks=pytest.mark.slow)])
@examples(4)
@given(bend=st.floats(0.05, 0.4), spin=st.floats(-2.0, 2.0), tip_mass=st.sampled_from([0.0, 0.3]))
def test_energy_and_momentum_conserved_without_torque(model, bend, spin, tip_mass):
    beam = hub_beam(HubBeamParameters(tip_mass=tip_mass), model, 2)
    result = beam.simulate(free_hub(), np.linspace(0.0, 3.0, 31), initial_state=bent_and_spinning(beam, bend, spin))
    scale = result.energy[0] + 1e-12
    assert np.ptp(result.energy) <= 1e-7 * scale
    assert np.ptp(result.angular_momentum) <= 1e-7 * max(abs(result.angular_momentum[0]), math.sqrt(scale))
    left = [beam.residual_energy(state) for state in result.states]
    np.testing.assert_allclose(left, result.energy[0], rtol=0, atol=1e-7 * scale)


@pytest.mark.parametrize("model", ALL_MODELS)
def test_residual_energy_steady_rotation_zero(model):
    """The energy of the deviation does not depend on the hub angle, and is positive elsewhere."""
    beam, speed = hub_beam(LOADED, model, 2), 1.3
    steady = beam.steady_state(speed)
    steady[0] = 0.7
    assert beam.residual_energy(steady, speed) == 0.0
    assert beam.residual_energy(steady + bent_and_spinning(beam, 0.1, 0.0), speed) > 0.0


@pytest.mark.parametrize(
    "model", ["tlam", "sfoam", "foam", "cfoam", pytest.param("geometrically-exact", marks=pytest.mark.slow)]
)
def test_prescribed_motion_needs_the_torque_that_reproduces_it(model):
    """The torque that a prescribed motion needs, applied to the free hub, gives that motion."""
    beam = hub_beam(LOADED, model, 2)
    t = np.linspace(0.0, 8.0, 4001)
    prescribed = beam.simulate(spin_up(1.5, 6.0), t)
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(t, prescribed.torque)
    driven = beam.simulate(applied_torque(spline, breakpoints=(6.0,)), t[::100], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(driven.hub_angle, prescribed.hub_angle[::100], rtol=0, atol=1e-5)
    np.testing.assert_allclose(driven.tip_displacement, prescribed.tip_displacement[::100], rtol=0, atol=1e-5)


def test_models_agree_as_the_speed_goes_to_zero():
    """TLAM, SFOAM, FOAM and CFOAM differ by the square of the speed."""
    t = np.linspace(0.0, 12.0, 25)
    spread = []
    for speed in (0.2, 0.02):
        tips = [hub_beam(LOADED, m, 2).simulate(spin_up(speed, 6.0), t).tip_displacement for m in ALL_MODELS]
        spread.append(np.ptp(tips, axis=0).max() / np.abs(tips[0]).max())
    assert spread[1] < 0.02 * spread[0]


@pytest.mark.parametrize("model", ["sfoam", "foam"])
@pytest.mark.parametrize("damping_ratio", [0.0, 0.02])
def test_closed_form_continues_the_collocation(model, damping_ratio):
    """The same hub motion as a profile is integrated to the end; as a spin-up it has a closed form from 5 s on."""
    p = HubBeamParameters(tip_mass=0.2, damping_ratio=damping_ratio)
    beam = hub_beam(p, model, 2)
    spin = spin_up(2.0, 5.0)
    profile = prescribed_motion(spin.angle, spin.speed, spin.acceleration, breakpoints=(5.0,))
    t = np.linspace(0.0, 12.0, 121)
    one, other = (beam.simulate(each, t) for each in (spin, profile))
    np.testing.assert_allclose(one.tip_displacement, other.tip_displacement, rtol=0, atol=3e-8 * 0.3)
    np.testing.assert_allclose(one.energy, other.energy, rtol=1e-7, atol=1e-9)


# in the second, a fast mode moves the tip against a slow one in some steps, which does not make them exact
OPPOSED = HubBeamParameters(tip_mass=0.1, damping_ratio=0.1, hub_inertia=1000.0)
SPUN = [
    *((BAI, spin_up(2.8, 30.0), 40.0, modes, rtol) for modes in (2, 5) for rtol in (1e-4, 1e-6, 1e-8)),
    (OPPOSED, spin_up(2.13875675, 3.186523285), 3.585071454, 3, 1e-8),
]


@pytest.mark.parametrize(("p", "maneuver", "end", "modes", "rtol"), SPUN)
def test_error_stays_within_what_was_asked_and_estimated(p, maneuver, end, modes, rtol):
    beam, t = hub_beam(p, "sfoam", modes), np.linspace(0.0, end, 401)
    exact, result = (beam.simulate(maneuver, t, rtol=each, atol=1e-14) for each in (1e-11, rtol))
    error = np.abs(result.tip_displacement - exact.tip_displacement).max()
    assert error <= 1.5 * result.error_estimate + 1e-14
    assert error <= rtol * np.abs(exact.tip_displacement).max()


def test_held_hub_vibrates_at_the_clamped_frequency():
    beam = hub_beam(BAI, "foam", 3)
    state = bent_and_spinning(beam, 0.1, 0.0)
    state[5] = 0.0
    t = np.linspace(0.0, 20.0, 201)
    result = beam.simulate(hold_angle(), t, initial_state=state)
    expected = 0.2 * np.cos(2.0 * np.pi * beam.eigenfrequencies_hz()[0] * t)
    np.testing.assert_allclose(result.tip_displacement, expected, atol=1e-10)
    assert np.all(result.hub_angle == 0.0)


def test_axial_stretch_of_steady_rotation():
    """Simo & Vu-Quoc (1987): rhoA w^2 L^3 / 3 EA = 5.143e-4 at 6 rad/s."""
    p = HubBeamParameters(10.0, 1.2, 1.0, 2.8e7, 5e-4, hub_inertia=1.0, hub_radius=0.0)
    beam = hub_beam(p, "foam", 40)
    stretched = beam._steady_coordinates(6.0)
    assert beam.equations.tip.axial @ stretched == pytest.approx(5.143e-4, abs=5e-8)
    few = hub_beam(p, "foam", 4)
    result = few.simulate(spin_up(6.0, 15.0), np.linspace(15.0, 60.0, 2001), rtol=1e-6)
    stretched = few._steady_coordinates(6.0)
    assert result.tip_extension.mean() == pytest.approx(few.equations.tip.axial @ stretched, rel=1e-4)


@pytest.mark.parametrize("model", ["tlam", "foam"])
def test_spin_up_peaks(model):
    t = np.linspace(0.0, 40.0, 4001)
    result = hub_beam(BAI, model, 5).simulate(spin_up(2.8, 30.0), t)
    assert np.abs(result.tip_displacement).max() == pytest.approx(references.SPIN_UP_PEAK[model], abs=5e-5)


@pytest.mark.slow
def test_foam_and_cfoam_agree_and_tlam_diverges_at_3_rad_per_s():
    t = np.linspace(0.0, 60.0, 3001)
    foam, cfoam, tlam = (
        hub_beam(BAI, m, 5).simulate(spin_up(3.0, 30.0), t, rtol=1e-6) for m in ("foam", "cfoam", "tlam")
    )
    peak = np.abs(foam.tip_displacement).max()
    assert np.abs(np.abs(cfoam.tip_displacement).max() / peak - 1.0) < 4.5e-4
    assert np.isfinite(tlam.tip_displacement).all()
    assert np.abs(tlam.tip_displacement[-1]) > 1e6
    first = t[np.argmax(np.abs(tlam.tip_displacement) > 0.8)]
    assert first - 0.021 < tlam.small_deformation_until <= first
    last_only = hub_beam(BAI, "tlam", 5).simulate(spin_up(3.0, 30.0), [60.0], rtol=1e-6)
    assert last_only.small_deformation_until == pytest.approx(tlam.small_deformation_until, abs=1e-3)
    assert foam.small_deformation_until == math.inf


@pytest.mark.parametrize("amplitude", [50.0, 100.0, 200.0, 400.0])
def test_inertia_torque_of_table_3(amplitude):
    t = np.linspace(0.0, 30.0, 6001)
    result = hub_beam(BAI, "foam", 5).simulate(sine_torque(amplitude, 10.0, 10.0), t, rtol=1e-6)
    expected = references.INERTIA_TORQUE_PEAK[amplitude]
    digit = 10.0 ** math.floor(math.log10(expected)) / (1000 if expected > 1.0 else 100)
    assert np.abs(result.inertia_torque).max() == pytest.approx(expected, abs=0.5 * digit)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["foam", "cfoam"])
def test_residual_after_400_newton_meters(model):
    t = np.linspace(0.0, 30.0, 6001)
    result = hub_beam(BAI, model, 5).simulate(sine_torque(400.0, 10.0, 10.0), t, rtol=1e-6)
    residual = np.abs(result.tip_displacement[t > 10.0]).max()
    assert residual == pytest.approx(references.RESIDUAL_AT_400[model], abs=5e-4)


@pytest.mark.parametrize(
    ("model", "maneuver", "atol"),
    [
        ("foam", sine_torque(100.0, 4.0, 4.0), 1e-12),
        pytest.param("geometrically-exact", spin_up(2.0, 4.0), 2e-8, marks=pytest.mark.slow),
    ],
)
def test_result_does_not_depend_on_the_instants_asked_for(model, maneuver, atol):
    beam = hub_beam(BAI, model, 2)
    many = beam.simulate(maneuver, np.linspace(0.0, 6.0, 601))
    few = beam.simulate(maneuver, [0.7, 2.5, 6.0])
    np.testing.assert_allclose(few.tip_displacement, many.tip_displacement[[70, 250, 600]], rtol=0, atol=atol)


@pytest.mark.parametrize(
    ("model", "maneuver", "path"),
    [
        ("sfoam", spin_up(1.0, 2.0), ("modal collocation",)),
        ("sfoam", hold_angle(), ("steady rotation by modes",)),
        ("tlam", spin_up(1.0, 2.0), ("collocation", "steady rotation by eigenvectors")),
        ("foam", sine_torque(10.0, 2.0, 2.0), ("free-hub modes",)),
        ("cfoam", sine_torque(10.0, 2.0, 2.0), ("collocation",)),
        ("geometrically-exact", spin_up(1.0, 2.0), ("collocation of momenta",)),
    ],
)
def test_the_path_names_the_ways_that_ran(model, maneuver, path):
    beam = hub_beam(BAI, model, 2)
    assert beam.simulate(maneuver, [1.0, 3.0], rtol=1e-5).stages == path
    assert beam.simulate(maneuver, [0.0]).stages == ("initial state",)


def test_a_way_that_misses_the_tolerance_is_in_the_path(monkeypatch):
    beam, t = hub_beam(BAI, "sfoam", 2), np.linspace(0.0, 5.0, 51)
    expected = beam.simulate(spin_up(2.0, 4.0), t)
    monkeypatch.setattr(modal_collocation, "_REFINED", 1)
    found = beam.simulate(spin_up(2.0, 4.0), t)
    assert found.stages == ("modal collocation (given up)", "collocation", "steady rotation by modes")
    np.testing.assert_allclose(found.tip_displacement, expected.tip_displacement, rtol=0, atol=2e-8)


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
