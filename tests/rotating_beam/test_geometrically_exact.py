"""The geometrically exact beam: laws first, then reference numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from boomctl.maneuvers import free_hub, hold_angle, sine_torque
from boomctl.rotating_beam.exact.basis import strain_basis
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.integrator import Trajectory, march
from boomctl.rotating_beam.exact.run import interpolate
from tests.profiles import examples, is_hunt
from tests.rotating_beam.exact_cases import BAI, LOADED, bent, states

pytestmark = pytest.mark.early


# -- discretisation ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "parameters", [BAI, LOADED, replace(BAI, tip_mass=0.3), replace(LOADED, tip_mass_position=0.0)]
)
def test_rigid_inertia(parameters):
    dynamics = ExactBeamDynamics(strain_basis(parameters, 3))
    assert dynamics.rest_mass[0, 0] == pytest.approx(parameters.rigid_body_inertia, rel=1e-14)


def test_uniform_curvature_is_a_circle():
    model = GeometricallyExactBeam(LOADED, 8)
    q, curvature = np.zeros(model._basis.coordinates), 0.3
    q[[1, 9]] = curvature * np.sqrt([5.0, 3.0])  # the mean of an orthonormal series over spans of 5 m and 3 m
    z = model.dynamics.tip(q)
    circle = 0.5 + (np.exp(1j * curvature * 8.0) - 1.0) / (1j * curvature)
    assert abs(z - circle) < 1e-12
    energy = 0.5 * BAI.bending_stiffness * curvature**2 * 8.0
    assert model.dynamics.energy(q, np.zeros_like(q)) == pytest.approx(energy, rel=1e-13)


# -- energies, momenta and forces belong together ---------------------------------------------------------------------


@examples(15)
@given(states(17))
def test_momentum_and_force_are_derivatives_of_the_energies(state):
    """By the complex step, which has no cancellation, on an independent transcription of the Lagrangian."""
    basis = strain_basis(LOADED, 4)
    q, v = state
    p, g = ExactBeamDynamics(basis).momentum_and_force(q, v)
    e = 1e-30j
    for k in range(q.size):
        nudge = np.zeros(q.size, dtype=complex)
        nudge[k] = e
        assert p[k] == pytest.approx(lagrangian(basis, q, v + nudge).imag / 1e-30, rel=1e-9, abs=1e-9)
        assert g[k] == pytest.approx(lagrangian(basis, q + nudge, v).imag / 1e-30, rel=1e-9, abs=1e-9)


def lagrangian(basis, q, v):
    """``T - U`` in real arithmetic, so that the complex step may pass through."""
    angle, stretch = basis.rotation @ q, 1.0 + basis.stretch @ q
    turn, rate = basis.rotation @ v, basis.stretch @ v
    x = basis.integration @ (rate * np.cos(angle) - stretch * turn * np.sin(angle))
    y = basis.integration @ (rate * np.sin(angle) + stretch * turn * np.cos(angle))
    kinetic = 0.5 * np.sum(basis.point_masses * (x**2 + y**2)) + 0.5 * basis.hub_inertia * v[0] ** 2
    return kinetic - 0.5 * np.sum(basis.stiffness * q**2)


@examples(10)
@given(states(17))
def test_matrices_are_derivatives_of_momentum_and_force(state):
    dynamics = ExactBeamDynamics(strain_basis(LOADED, 4))
    q, v = state
    mass, coupling, stiffness = dynamics.linearization(q, v)
    np.testing.assert_allclose(mass @ v, dynamics.momentum_and_force(q, v)[0], rtol=1e-12, atol=1e-12)
    h = 1e-6
    for k in range(q.size):
        nudge = np.zeros(q.size)
        nudge[k] = h
        ahead, behind = dynamics.momentum_and_force(q + nudge, v), dynamics.momentum_and_force(q - nudge, v)
        np.testing.assert_allclose(coupling[:, k], (ahead[0] - behind[0]) / (2 * h), rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(
            stiffness[:, k], (behind[1] - ahead[1]) / (2 * h), rtol=1e-7, atol=1e-12 * BAI.axial_stiffness
        )
    convective = coupling @ v - dynamics.momentum_and_force(q, v)[1] - dynamics.basis.stiffness * q
    np.testing.assert_allclose(dynamics.convective_force(q, v), convective, rtol=1e-9, atol=1e-9)


# -- conservation -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [2, pytest.param(60 if is_hunt() else 15, marks=pytest.mark.slow)])
@pytest.mark.parametrize("parameters", [BAI, LOADED])
def test_energy_and_angular_momentum_are_kept_on_a_free_hub(parameters, seconds):
    """A tip swing of over a meter on a free, turning hub, released with a shock that sets off axial waves."""
    model = GeometricallyExactBeam(parameters, 3)
    r = model.simulate(
        free_hub(), np.linspace(0, seconds, 10 * seconds + 1), initial_state=bent(model, 1.2, hub_speed=1.5), rtol=1e-4
    )
    assert np.max(np.abs(r.tip_displacement)) > 1.0
    assert np.ptp(r.energy) < 1e-8 * r.energy[0]
    assert np.ptp(r.angular_momentum) < 1e-12 * r.angular_momentum[0]


def test_damping_ratio_of_the_held_beam():
    """The first mode of the clamped beam decays as ``exp(-zeta w t)``."""
    model = GeometricallyExactBeam(replace(BAI, damping_ratio=0.02), 6)
    times = np.linspace(0, 20, 4001)
    tip = model.simulate(hold_angle(), times, initial_state=bent(model, 1e-3)).tip_displacement
    peaks = [k for k in range(1, tip.size - 1) if tip[k] >= tip[k - 1] and tip[k] > tip[k + 1] and times[k] > 8]
    decay = math.log(tip[peaks[0]] / tip[peaks[-1]]) / (len(peaks) - 1)
    assert decay == pytest.approx(2 * math.pi * 0.02 / math.sqrt(1 - 0.02**2), rel=1e-3)


# -- convergence ------------------------------------------------------------------------------------------------------


def test_collocation_has_order_eight():
    """Bending alone, whose frequencies the steps resolve: no order is lost to the stiff stretches."""
    dynamics = ExactBeamDynamics(strain_basis(BAI, 2))
    q, v = np.zeros(5), np.zeros(5)
    q[1:3], v[0] = (0.02, -0.02), 0.5
    q[3:] = GeometricallyExactBeam(BAI, 2).steady_state(0.5)[3:5]
    ends = [march(dynamics, free_hub(), np.linspace(0.0, 1.2, n + 1), (q, v)).q[-1, :3] for n in (12, 24, 768)]
    coarse, fine = (np.max(np.abs(end - ends[-1])) for end in ends[:2])
    assert coarse / fine > 2**7


@pytest.mark.slow
def test_modes_converge_spectrally():
    times = np.linspace(0, 4, 81)
    tips = [
        GeometricallyExactBeam(LOADED, n).simulate(sine_torque(200.0, 10.0, 10.0), times, rtol=1e-7).tip_displacement
        for n in (2, 3, 4, 8)
    ]
    errors = [np.max(np.abs(tip - tips[-1])) / np.max(np.abs(tips[-1])) for tip in tips[:-1]]
    assert errors[0] > 5 * errors[1] > 25 * errors[2]
    assert errors[2] < 2e-5


@pytest.mark.slow
def test_the_error_estimate_bounds_the_error():
    model, times = GeometricallyExactBeam(BAI, 5), np.linspace(0, 7, 351)
    loose = model.simulate(sine_torque(300.0, 6.0, 6.0), times, rtol=1e-4)
    tight = model.simulate(sine_torque(300.0, 6.0, 6.0), times, rtol=1e-8)
    error = np.max(np.abs(loose.tip_displacement - tight.tip_displacement))
    assert 0.0 < error <= loose.error_estimate <= 1e-4 * np.max(np.abs(tight.tip_displacement)) + 1e-10
    assert loose.n_steps < tight.n_steps


def test_interpolation_is_exact_for_degree_eleven():
    time = np.linspace(1.0, 3.0, 15)
    line = np.polynomial.Polynomial(np.arange(12) / 2.0**12)
    piece = Trajectory(time, line(time)[:, None], line.deriv()(time)[:, None])
    wanted = np.array([1.0, 1.01, 1.9, 2.97, 3.0])
    q, v = interpolate(piece, wanted)
    np.testing.assert_allclose(q[:, 0], line(wanted), rtol=1e-11)
    np.testing.assert_allclose(v[:, 0], line.deriv()(wanted), rtol=1e-10)
    # the distance of two of many neighbors has lost the digits that their instants have: the whole run tells the step
    time, wanted = np.linspace(30.0, 60.0, 100_001), np.linspace(30.0, 60.0, 513)
    q, v = interpolate(Trajectory(time, time[:, None], np.ones((time.size, 1))), wanted)
    np.testing.assert_allclose(q[:, 0], wanted, rtol=1e-14)
    assert v == pytest.approx(1.0, abs=1e-9)
