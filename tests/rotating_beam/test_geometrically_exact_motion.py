"""The geometrically exact beam in motion: small motion, reference numbers, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.rotating_beam import HubBeamParameters, SimulationError, free, hub_beam, sine_torque, spin_up, torque
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from tests.profiles import examples
from tests.rotating_beam.chain import chain_tip
from tests.rotating_beam.exact_cases import BAI, LOADED, SIMO, bent

# -- small motion -----------------------------------------------------------------------------------------------------


def test_frequencies_of_the_clamped_beam_at_rest():
    """``cos(b L) cosh(b L) = -1``, and an axial bar clamped at one end."""
    model = GeometricallyExactBeam(BAI, 12)
    roots = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    omega = roots**2 * math.sqrt(BAI.bending_stiffness / BAI.mass_per_length / BAI.length**4)
    np.testing.assert_allclose(2 * math.pi * model.frequencies_hz()[:3], omega, rtol=1e-9)
    bar = math.pi / 2 / BAI.length * math.sqrt(BAI.youngs_modulus / BAI.density)
    assert model.critical_speed() == pytest.approx(bar, rel=1e-12)
    assert np.min(np.abs(2 * math.pi * model.frequencies_hz(coupled=True) / bar - 1)) < 1e-10


def test_published_frequencies_of_a_turning_cantilever():
    """Wright et al. 1982, flapwise; in the plane ``lambda^2`` is less by ``gamma^2``. An all but inextensible beam."""
    stiff = replace(BAI, hub_radius=0.0, area=BAI.area * 1e6, density=BAI.density * 1e-6)
    unit = math.sqrt(stiff.bending_stiffness / stiff.mass_per_length / stiff.length**4)
    model = GeometricallyExactBeam(stiff, 14)
    table = {
        0: (3.5160, 22.0345, 61.6972),
        2: (4.1373, 22.6149, 62.2732),
        6: (7.3604, 26.8091, 66.6839),
        12: (13.1702, 37.6031, 79.6145),
    }
    for speed, published in table.items():
        chordwise = 2 * math.pi * model.frequencies_hz(speed * unit)[:3] / unit
        np.testing.assert_allclose(np.sqrt(chordwise**2 + speed**2), published, atol=6e-5)


@pytest.mark.parametrize(("tip_mass", "expected"), [(0.0, 5.451), (0.1, 5.171), (0.5, 4.547)])
def test_tip_mass_lowers_the_first_frequency(tip_mass, expected):
    model = GeometricallyExactBeam(HubBeamParameters(tip_mass=tip_mass), 10)
    assert 2 * math.pi * model.frequencies_hz(10.0)[0] == pytest.approx(expected, abs=8e-4)


def test_bai_table_two_exactly():
    model = GeometricallyExactBeam(BAI, 16)
    clamped = [0.46325907, 2.90319507, 8.12903025, 15.92965488, 26.33286092]
    np.testing.assert_allclose(model.frequencies_hz()[:5], clamped, rtol=2e-8)
    turning = [0.47111124, 2.92933462, 8.15767075, 15.96005008, 26.36424078]
    np.testing.assert_allclose(model.frequencies_hz(1.0)[:5], turning, rtol=2e-6)
    assert model.frequencies_hz(1.0, coupled=True)[0] == pytest.approx(0.47111033, rel=2e-6)


@pytest.mark.slow
def test_small_free_vibration_is_the_linear_one():
    model = GeometricallyExactBeam(BAI, 4)
    speed, times = 1.3, np.linspace(0, 3, 61)
    steady, bump = model.steady_state(speed), bent(model, 1e-4)
    r = model.simulate(free(), times, initial=steady + bump, rtol=1e-7, atol=1e-13)
    system = model.linearize(speed)
    rates, modes = np.linalg.eig(system.A)
    start = np.linalg.solve(modes, bump.astype(complex))
    tip = np.real(system.C[2] @ (modes * start) @ np.exp(np.outer(rates, times)))
    np.testing.assert_allclose(r.tip_displacement, tip, atol=2e-5 * np.max(np.abs(tip)))


def test_linearisation_is_the_jacobian_of_the_nonlinear_system():
    model = GeometricallyExactBeam(LOADED, 3)
    speed, nlsys = 1.1, model.to_nlsys()
    linear, numeric = model.linearize(speed), nlsys.linearize(model.steady_state(speed), [0.0], eps=1e-7)
    scale = np.max(np.abs(linear.A), axis=1, keepdims=True)
    np.testing.assert_allclose(numeric.A / scale, linear.A / scale, atol=1e-6)
    np.testing.assert_allclose(numeric.B, linear.B, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(numeric.C, linear.C, rtol=1e-6, atol=1e-6)
    assert linear.input_labels == nlsys.input_labels == ["torque"]
    assert linear.output_labels == nlsys.output_labels == ["hub_angle", "hub_speed", "tip_displacement"]
    assert linear.state_labels == nlsys.state_labels == list(model.state_names)


@pytest.mark.slow
def test_nonlinear_system_moves_as_the_simulator():
    import control

    model, times = GeometricallyExactBeam(BAI, 2), np.linspace(0, 0.5, 26)
    push = sine_torque(300.0, 1.0, 0.5)
    response = control.input_output_response(
        model.to_nlsys(),
        times,
        push.torque(times),
        solve_ivp_method="Radau",
        solve_ivp_kwargs={"rtol": 1e-8, "atol": 1e-10},
    )
    held = torque(
        lambda t: np.interp(t, times, push.torque(times)), breakpoints=tuple(times)
    )  # control interpolates so
    r = model.simulate(held, times, rtol=1e-7)
    np.testing.assert_allclose(response.outputs[0], r.hub_angle, atol=1e-7)
    np.testing.assert_allclose(response.outputs[2], r.tip_displacement, atol=1e-6)


def test_the_small_deformation_range_is_watched_between_the_instants():
    model, push = GeometricallyExactBeam(BAI, 4), sine_torque(400.0, 10.0, 10.0)
    fine = model.simulate(push, np.linspace(0, 3, 3001), rtol=1e-6)
    tip, times = fine.tip_displacement, fine.time
    k = int(np.flatnonzero(np.abs(tip) > 0.8)[0])
    crossing = times[k - 1] + (0.8 - abs(tip[k - 1])) / (abs(tip[k]) - abs(tip[k - 1])) * 1e-3
    assert fine.small_deformation_until == pytest.approx(crossing, abs=1e-6)
    assert model.simulate(push, [0.0, 3.0], rtol=1e-6).small_deformation_until == pytest.approx(crossing, abs=1e-6)


@pytest.mark.parametrize(
    "parameters", [replace(BAI, hub_radius=0.0, hub_inertia=0.0), replace(LOADED, tip_position=0.0)]
)
def test_extreme_hubs_and_one_polynomial(parameters):
    model = GeometricallyExactBeam(parameters, 1)
    r = model.simulate(sine_torque(20.0, 2.0, 2.0), np.linspace(0, 4, 41), rtol=1e-6)
    after = r.time >= 2.0
    assert np.all(np.isfinite(r.states))
    assert np.ptp(r.energy[after]) < 1e-9 * r.energy[-1]
    assert np.all(r.mass_matrix_margin > 0.0)


def test_steady_rotation_stays_steady():
    model = GeometricallyExactBeam(LOADED, 5)
    r = model.simulate(free(), np.linspace(0, 5, 51), initial=model.steady_state(40.0))
    assert np.max(np.abs(r.tip_displacement)) < 1e-10
    assert np.ptp(r.hub_speed) < 1e-9
    assert np.ptp(r.axial_tip_displacement) < 1e-10 < r.axial_tip_displacement[0]


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
    turning = runs[1].axial_tip_displacement[times > 15]
    assert np.mean(turning) == pytest.approx(stretch, rel=1e-4)


@pytest.mark.slow
def test_spin_up_of_bai():
    r = GeometricallyExactBeam(BAI, 6).simulate(spin_up(2.8, 30.0), np.linspace(0, 60, 6001))
    assert np.max(np.abs(r.tip_displacement)) == pytest.approx(0.2043, abs=5e-5)
    assert math.isinf(r.small_deformation_until)


@pytest.mark.slow
def test_residual_amplitude_at_400_newton_metres():
    times = np.linspace(0, 30, 3001)
    r = GeometricallyExactBeam(BAI, 6).simulate(sine_torque(400.0, 10.0, 10.0), times, rtol=1e-6)
    assert np.max(np.abs(r.tip_displacement[times > 10])) == pytest.approx(0.4717, abs=1e-4)
    assert 0.0 < r.small_deformation_until < 10.0


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
    manoeuvre, theirs = EXUDYN[case]
    r = GeometricallyExactBeam(BAI, 6).simulate(manoeuvre, list(theirs), rtol=1e-6)
    peak = {"spin-up": 0.2043, "400 N m": 1.966}[case]
    np.testing.assert_allclose(r.tip_displacement, list(theirs.values()), atol=1e-3 * peak)
    late = np.array(list(theirs)) > 30.0
    np.testing.assert_allclose(r.tip_displacement[late], np.array(list(theirs.values()))[late], atol=1e-4 * peak)


@pytest.mark.slow
@pytest.mark.parametrize("case", EXUDYN)
def test_equals_exudyn(case):
    pytest.importorskip("exudyn")
    from tests.rotating_beam.exudyn_tip import exudyn_tip

    manoeuvre, step = EXUDYN[case][0], {"spin-up": 0.01, "400 N m": 0.0025}[case]
    times = np.linspace(0, 30, 301)
    tip = exudyn_tip(BAI, manoeuvre, times, elements=16, step=step)
    r = GeometricallyExactBeam(BAI, 6).simulate(manoeuvre, times, rtol=1e-6)
    np.testing.assert_allclose(tip, r.tip_displacement, atol=1e-3 * np.max(np.abs(r.tip_displacement)))


@pytest.mark.slow
def test_polynomials_and_tolerances_are_ordered_by_error():
    manoeuvre, times = spin_up(2.8, 30.0), np.linspace(0.0, 60.0, 301)
    true = GeometricallyExactBeam(BAI, 10).simulate(manoeuvre, times, rtol=1e-9).tip_displacement

    def error(beam, rtol):
        return np.abs(beam.simulate(manoeuvre, times, rtol=rtol).tip_displacement - true).max() / np.abs(true).max()

    exact = [error(GeometricallyExactBeam(BAI, n), rtol) for n, rtol in ((3, 1e-3), (4, 1e-5), (6, 1e-7), (8, 1e-8))]
    assert exact == sorted(exact, reverse=True)
    assert exact[-1] < 1e-8 < 1e-4 < error(hub_beam(BAI, "sfoam", 5), 1e-7) < 1e-3


# -- what polynomials leave out ----------------------------------------------------------------------------------------


@pytest.mark.slow
@examples(60)
@given(st.floats(3.0, 9.0), st.floats(0.4, 1.0), st.integers(3, 5), st.floats(0.0, 1.0), st.floats(0.0, 0.3))
def test_the_error_of_a_whip_is_that_of_its_polynomials_too(speed, duration, modes, radius, tip_mass):
    """A spin-up that leaves the tip behind: few polynomials are wrong by up to a metre, and say so."""
    p, whip = HubBeamParameters(hub_radius=radius, tip_mass=tip_mass), spin_up(speed, duration)
    times = np.linspace(0.0, duration + 0.2, 30)
    few, true = (GeometricallyExactBeam(p, n).simulate(whip, times, rtol=1e-4) for n in (modes, 2 * modes + 3))
    error = np.abs(few.tip_displacement - true.tip_displacement).max()
    assert error <= few.error_estimate + true.error_estimate
    assert few.error_estimate <= 50.0 * error + 1e-3 * np.abs(true.tip_displacement).max()


@pytest.mark.slow
def test_an_error_is_told_where_steps_that_do_for_some_polynomials_do_not_for_more():
    p = HubBeamParameters(hub_radius=0.882407583, tip_mass=0.424180920)
    times = np.linspace(0.0, 1.2300520212680028, 30)
    few, true = (
        GeometricallyExactBeam(p, n).simulate(spin_up(7.93695191, 0.91773355), times, rtol=1e-4) for n in (5, 14)
    )
    assert np.abs(few.tip_displacement - true.tip_displacement).max() <= few.error_estimate + true.error_estimate


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


@pytest.mark.parametrize(
    ("modes", "kind"), [(0, ValueError), (61, ValueError), (2.5, TypeError), (True, TypeError), ("5", TypeError)]
)
def test_bad_number_of_modes(modes, kind):
    with pytest.raises(kind, match="modes"):
        GeometricallyExactBeam(BAI, modes)


def test_the_factory_makes_it():
    model = hub_beam(LOADED, model="geometrically-exact", modes=3)
    assert isinstance(model, GeometricallyExactBeam)
    assert (model.parameters, model.modes, model.model) == (LOADED, 3, "geometrically-exact")


@pytest.mark.parametrize("speed", [981.0, -981.0, math.nan, math.inf])
def test_bad_hub_speed(speed):
    model = GeometricallyExactBeam(BAI, 4)
    for call in (model.frequencies_hz, model.linearize, model.steady_state):
        with pytest.raises(ValueError, match="hub_speed"):
            call(speed)


def test_bad_simulation():
    model = GeometricallyExactBeam(BAI, 3)
    with pytest.raises(TypeError, match="manoeuvre"):
        model.simulate("spin", [0.0, 1.0])
    with pytest.raises(ValueError, match="rtol"):
        model.simulate(free(), [0.0, 1.0], rtol=0.0)
    with pytest.raises(ValueError, match="atol"):
        model.simulate(free(), [0.0, 1.0], atol=-1.0)
    with pytest.raises(ValueError, match="timepts"):
        model.simulate(free(), [1.0, 0.0])
    with pytest.raises(ValueError, match="initial"):
        model.simulate(free(), [0.0, 1.0], initial=[1.0])
    with pytest.raises(ValueError, match="initial hub speed"):
        model.simulate(spin_up(1.0, 1.0), [0.0, 1.0], initial=model.steady_state(1.0))
    with pytest.raises(ValueError, match="torque"):
        model.simulate(torque(lambda t: math.nan), [0.0, 1.0])


@pytest.mark.slow
def test_a_tolerance_beyond_rounding_is_an_error():
    with pytest.raises(SimulationError, match="rtol"):
        GeometricallyExactBeam(BAI, 1).simulate(spin_up(2.0, 1.0), [0.0, 1.0], rtol=1e-17, atol=1e-99)


@pytest.mark.parametrize("seed", range(4))
def test_motion_too_short_for_its_first_steps_is_refined(seed):
    """There are at least twelve steps between corners: halved ones are to be more, or two runs agree on anything."""
    generator = np.random.default_rng(seed)
    beam = bc.hub_beam(bc.HubBeamParameters(length=generator.uniform(2.0, 8.0)), "geometrically-exact", modes=4)
    pull = generator.uniform(1.0, 4.0)
    jerk = bc.hub_profile(lambda t: 0.5 * pull * t**2, lambda t: pull * t, lambda t: pull + 0.0 * t)
    time = np.linspace(0.0, 0.15 / beam.frequencies_hz()[0], 8)
    assert beam.simulate(jerk, time, rtol=1e-8, atol=1e-13).steps > beam.simulate(jerk, time, rtol=1e-2).steps
