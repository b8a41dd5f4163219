"""The geometrically exact beam in motion: small motion, reference numbers, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import boomctl as bc
from boomctl.maneuvers import free_hub, sine_torque, spin_up
from boomctl.rotating_beam import HubBeamParameters
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from tests.profiles import examples
from tests.rotating_beam.exact_cases import BAI, LOADED, SIMO

# -- small motion -----------------------------------------------------------------------------------------------------


def test_small_deformation_checked_between_samples():
    model, push = GeometricallyExactBeam(BAI, 4), sine_torque(400.0, 10.0, 10.0)
    fine = model.simulate(push, np.linspace(0, 3, 3001), rtol=1e-6)
    tip, times = fine.tip_displacement, fine.time
    k = int(np.flatnonzero(np.abs(tip) > 0.8)[0])
    crossing = times[k - 1] + (0.8 - abs(tip[k - 1])) / (abs(tip[k]) - abs(tip[k - 1])) * 1e-3
    assert fine.small_deformation_until == pytest.approx(crossing, abs=1e-6)
    assert model.simulate(push, [0.0, 3.0], rtol=1e-6).small_deformation_until == pytest.approx(crossing, abs=1e-6)


@pytest.mark.parametrize(
    "parameters", [replace(BAI, hub_radius=0.0, hub_inertia=0.0), replace(LOADED, tip_mass_position=0.0)]
)
def test_extreme_hubs_and_one_polynomial(parameters):
    model = GeometricallyExactBeam(parameters, 1)
    r = model.simulate(sine_torque(20.0, 2.0, 2.0), np.linspace(0, 4, 41), rtol=1e-6)
    after = r.time >= 2.0
    assert np.all(np.isfinite(r.states))
    assert np.ptp(r.energy[after]) < 1e-9 * r.energy[-1]
    assert np.all(r._dynamics.mass_matrix_margin > 0.0)


def test_steady_rotation_stays_steady():
    model = GeometricallyExactBeam(LOADED, 5)
    r = model.simulate(free_hub(), np.linspace(0, 5, 51), initial_state=model.steady_state(40.0))
    assert np.max(np.abs(r.tip_displacement)) < 1e-10
    assert np.ptp(r.hub_speed) < 1e-9
    assert np.ptp(r.tip_extension) < 1e-10 < r.tip_extension[0]


# -- reference numbers ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_simo_vu_quoc_spin_up():
    """Steady stretch ``L (tan(g)/g - 1)``, ``g = w L sqrt(rho/E)``: 5.143e-4; the peak deflection to four digits."""
    g = 6.0 * 10.0 * math.sqrt(1.2 / 2.8e7)
    stretch = 10.0 * (math.tan(g) / g - 1.0)
    assert stretch == pytest.approx(5.143e-4, abs=5e-8)
    times = np.linspace(0, 30, 3001)
    runs = [GeometricallyExactBeam(SIMO, n).simulate(spin_up(6.0, 15.0), times) for n in (4, 8)]
    for n in (4, 8):
        model = GeometricallyExactBeam(SIMO, n)
        assert model.dynamics.extension(model.steady_state(6.0)[: 2 * n + 1]) == pytest.approx(stretch, rel=1e-11)
    peaks = [np.max(np.abs(r.tip_displacement)) for r in runs]
    assert peaks[1] == pytest.approx(0.57379, abs=5e-6)
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-5)
    turning = runs[1].tip_extension[times > 15]
    assert np.mean(turning) == pytest.approx(stretch, rel=1e-4)


EXUDYN = {
    "spin-up": (
        spin_up(2.8, 30.0),
        {2.5: -0.014339, 8.5: -0.130980, 14.5: -0.204310, 20.5: -0.128223, 26.5: -0.021776, 44.5: -0.000752},
    ),
    "400 N m": (
        sine_torque(400.0, 10.0, 10.0),
        {2.5: -1.244148, 5.5: 0.634391, 8.5: 1.651328, 11.5: 0.251454, 17.5: 0.146347, 29.5: -0.082212},
    ),
}
"""Tip displacement [m] by time [s] from exudyn 1.13.6: 16 ANCF cable elements and steps of 5 ms, 24 and 1.25 ms."""


@pytest.mark.slow
@pytest.mark.parametrize("case", EXUDYN)
def test_equals_what_exudyn_computed(case):
    maneuver, theirs = EXUDYN[case]
    r = GeometricallyExactBeam(BAI, 6).simulate(maneuver, list(theirs), rtol=1e-6)
    peak = {"spin-up": 0.2043, "400 N m": 1.966}[case]
    np.testing.assert_allclose(r.tip_displacement, list(theirs.values()), atol=1e-3 * peak)
    late = np.array(list(theirs)) > 30.0
    np.testing.assert_allclose(r.tip_displacement[late], np.array(list(theirs.values()))[late], atol=1e-4 * peak)


# -- what polynomials leave out ----------------------------------------------------------------------------------------


@pytest.mark.slow
@examples(60)
@given(st.floats(3.0, 9.0), st.floats(0.4, 1.0), st.integers(3, 5), st.floats(0.0, 1.0), st.floats(0.0, 0.3))
@example(speed=7.93695191, duration=0.91773355, modes=5, radius=0.882407583, tip_mass=0.424180920)
def test_the_error_of_a_whip_is_that_of_its_polynomials_too(speed, duration, modes, radius, tip_mass):
    """A spin-up that leaves the tip behind: few polynomials are wrong by up to a meter, and say so."""
    p, whip = HubBeamParameters(hub_radius=radius, tip_mass=tip_mass), spin_up(speed, duration)
    times = np.linspace(0.0, duration + 0.2, 30)
    few, true = (GeometricallyExactBeam(p, n).simulate(whip, times, rtol=1e-4) for n in (modes, 2 * modes + 3))
    error = np.abs(few.tip_displacement - true.tip_displacement).max()
    assert error <= few.error_estimate + true.error_estimate
    assert few.error_estimate <= 50.0 * error + 1e-3 * np.abs(true.tip_displacement).max()


@pytest.mark.slow
@examples(6)
@given(st.floats(4.0, 7.0), st.floats(0.5, 1.2))
def test_a_whip_moves_as_a_chain_of_links(speed, duration):
    whip, times = spin_up(speed, duration), np.linspace(0.0, duration + 0.3, 30)
    tip = GeometricallyExactBeam(BAI, 14).simulate(whip, times, rtol=1e-4).tip_displacement
    coarse, fine = (chain_tip(BAI, whip, times, links) for links in (30, 60))
    limit = fine + (fine - coarse) / 3.0
    assert np.abs(limit - tip).max() <= max(np.abs(limit - fine).max(), 1e-3 * BAI.length)


# -- bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_motion_too_short_for_its_first_steps_is_refined(seed):
    """There are at least twelve steps between corners: halved ones are to be more, or two runs agree on anything."""
    generator = np.random.default_rng(seed)
    beam = bc.hub_beam(bc.HubBeamParameters(length=generator.uniform(2.0, 8.0)), "geometrically-exact", modes=4)
    pull = generator.uniform(1.0, 4.0)
    jerk = bc.maneuvers.prescribed_motion(lambda t: 0.5 * pull * t**2, lambda t: pull * t, lambda t: pull + 0.0 * t)
    time = np.linspace(0.0, 0.15 / beam.eigenfrequencies_hz()[0], 8)
    assert beam.simulate(jerk, time, rtol=1e-8, atol=1e-13).n_steps > beam.simulate(jerk, time, rtol=1e-2).n_steps


def chain_tip(p, motion, times, links):
    """Return where the free end is across the hub, its motion prescribed; inextensible, of second order in the links.

    Masses stand at the joints, half a link's at the free end; springs bend between links, the first to the clamp with half
    a link. Unknowns are the links' angles against the hub, and their rates in fixed axes.
    """
    length = p.length / links
    masses = np.full(links, p.mass_per_length * length)
    masses[-1] = 0.5 * masses[-1] + p.tip_mass
    beyond = np.cumsum(masses[::-1])[::-1]
    kernel, hub = length**2 * np.minimum.outer(beyond, beyond), p.hub_radius * length * beyond
    springs = np.full(links, p.bending_stiffness / length)
    springs[0] *= 2.0
    bending = np.diag(springs + np.append(springs[1:], 0.0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)

    def rate(t, y):
        bent, turning = y[:links], y[links:]
        speed, acceleration = float(motion.speed(t)), float(motion.acceleration(t))
        apart = bent[:, None] - bent
        force = -(kernel * np.sin(apart)) @ turning**2 - bending @ bent
        force -= hub * (np.cos(bent) * acceleration + np.sin(bent) * speed**2)
        return np.concatenate([turning - speed, np.linalg.solve(kernel * np.cos(apart), force)])

    start = np.concatenate([np.zeros(links), np.full(links, float(motion.speed(0.0)))])
    found = solve_ivp(rate, (0.0, times[-1]), start, method="Radau", t_eval=times, rtol=1e-6, atol=1e-7)
    return length * np.sin(found.y[:links]).sum(axis=0)
