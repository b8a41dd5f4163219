"""python-control systems and the CasADi function: the same model as the simulator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from boomctl.maneuvers import sine_torque
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from tests.rotating_beam.strategies import ALL_MODELS

SHORT = HubBeamParameters(length=2.0, hub_inertia=5.0, tip_mass=0.05, damping_ratio=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("model", [*ALL_MODELS, "geometrically-exact"])
def test_nlsys_equals_the_simulator(model):
    """The state equations, by an independent Runge-Kutta method at a tight tolerance."""
    beam, t = hub_beam(SHORT, model, 1), np.linspace(0.0, 0.2, 6)
    maneuver = sine_torque(40.0, 0.16, 0.16)
    result, system = beam.simulate(maneuver, t, rtol=1e-9, atol=1e-12), beam.to_nlsys()
    other = solve_ivp(
        lambda t, x: system.dynamics(t, x, [float(maneuver.torque(t))]),
        (0.0, 0.2), np.zeros(system.nstates), "DOP853", t, rtol=1e-10, atol=1e-13, max_step=0.1,
    )  # fmt: skip
    angle, _, tip = np.array([system.output(t, x, [0.0]) for t, x in zip(t, other.y.T, strict=True)]).T
    assert np.abs(tip).max() > 1e-3
    np.testing.assert_allclose(result.tip_displacement, tip, rtol=0, atol=1e-8 * np.abs(tip).max())
    np.testing.assert_allclose(result.hub_angle, angle, rtol=0, atol=1e-8 * np.abs(angle).max())
    assert tuple(system.state_labels) == beam.state_labels


@pytest.mark.parametrize("model", ALL_MODELS)
@pytest.mark.parametrize("speed", [0.0, 1.7])
def test_linear_model_is_the_jacobian_of_the_nonlinear_one(model, speed):
    """By automatic differentiation of the derived equations at the steady rotation that the linear model is about."""
    import casadi as ca

    beam = hub_beam(HubBeamParameters(tip_mass=0.2, damping_ratio=0.01), model, 2)
    linear = beam.linearize(speed)
    size = beam.equations.size
    point = np.zeros(2 * size)
    point[1:size], point[size] = beam._steady_coordinates(speed), speed
    function = beam.to_casadi()
    x, u = ca.SX.sym("x", 2 * size), ca.SX.sym("u")
    xdot, y = function(x, u)
    jacobians = ca.Function("j", [x, u], [ca.jacobian(each, of) for each in (xdot, y) for of in (x, u)])(point, 0.0)
    np.testing.assert_allclose(np.array(function(point, 0.0)[0]).ravel()[size:], 0.0, atol=1e-9)
    for name, exact in zip("ABCD", jacobians, strict=True):
        given, exact = getattr(linear, name), np.array(exact)
        np.testing.assert_allclose(given, exact, rtol=0, atol=1e-11 * max(1.0, np.abs(exact).max()), err_msg=name)
    assert linear.input_labels == ["torque"]
    assert linear.output_labels == ["hub_angle", "hub_speed", "tip_displacement"]


@pytest.mark.parametrize(
    ("model", "speed"), [("sfoam", 0.0), ("tlam", 0.0), ("foam", 1.1), ("geometrically-exact", 1.1)]
)
def test_linear_model_equals_the_numerical_jacobian_of_nlsys(model, speed):
    beam = hub_beam(HubBeamParameters(tip_mass=0.4, tip_mass_position=5.0), model, 3)
    exact, system = beam.linearize(speed), beam.to_nlsys()
    numerical = system.linearize(beam.steady_state(speed), [0.0], eps=1e-7)
    scale = np.abs(exact.A).max(axis=1, keepdims=True)
    np.testing.assert_allclose(numerical.A / scale, exact.A / scale, atol=1e-6)
    np.testing.assert_allclose(numerical.B, exact.B, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(numerical.C, exact.C, rtol=1e-6, atol=1e-6)
    assert exact.input_labels == system.input_labels == ["torque"]
    assert exact.output_labels == system.output_labels == ["hub_angle", "hub_speed", "tip_displacement"]
    assert exact.state_labels == system.state_labels == list(beam.state_labels)


def test_linear_models_have_the_frequencies_of_a_free_hub():
    """With a very heavy hub they are those of the clamped beam."""
    beam = hub_beam(HubBeamParameters(hub_inertia=1e9), "foam", 3)
    poles = np.linalg.eigvals(beam.linearize(1.0).A)
    found = np.sort(poles.imag[poles.imag > 1.0]) / (2.0 * np.pi)
    np.testing.assert_allclose(found, beam.eigenfrequencies_hz(1.0, coupled=True), rtol=1e-5)
