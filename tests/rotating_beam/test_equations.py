"""Equations of motion: equal to Lagrange's equations derived from the energies, and true to their own derivatives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.rotating_beam import hub_beam
from boomctl.rotating_beam.modal.energy import equations_of_motion
from tests.profiles import examples
from tests.rotating_beam.strategies import ALL_MODELS, parameters


def random_motion(beam, seed, deflection=0.05):
    """Coordinates, rates and accelerations of which the beam's are `deflection` times its length."""
    size = beam.equations.size
    y, rate, acceleration = np.random.default_rng(seed).normal(size=(3, 1, size))
    y[:, 1:] *= deflection * beam.parameters.length
    return y, rate, acceleration


def derived_residual(beam):
    """Left-hand sides of Lagrange's equations as a CasADi function of coordinates, rates and accelerations."""
    import casadi as ca

    *motion, residual = equations_of_motion(beam._lagrangian)
    return ca.Function("residual", motion, [residual])


@pytest.mark.parametrize("model", ALL_MODELS)
@examples(8)
@given(p=parameters(damped=True), seed=st.integers(0, 2**20), modes=st.integers(1, 3))
def test_closed_form_equals_the_one_derived_from_the_energies(model, p, seed, modes):
    beam = hub_beam(p, model, modes)
    y, rate, acceleration = random_motion(beam, seed)
    derived = np.array(derived_residual(beam)(y[0], rate[0], acceleration[0])).ravel()
    closed = beam.equations.residual(y, rate, acceleration)[0]
    np.testing.assert_allclose(closed, derived, rtol=0, atol=1e-12 * np.abs(derived).max())
    torque = 3.0
    x = np.concatenate([1e-3 * y[0], rate[0]])
    xdot, _ = beam.to_casadi()(x, torque)
    closed = beam.equations.state_derivative(x, torque)
    np.testing.assert_allclose(closed, np.array(xdot).ravel(), rtol=0, atol=1e-10 * np.abs(closed).max())


@pytest.mark.parametrize("model", ALL_MODELS)
@examples(8)
@given(p=parameters(damped=True), seed=st.integers(0, 2**20))
def test_tangents_are_the_derivatives_of_the_derived_residual(model, p, seed):
    import casadi as ca

    beam = hub_beam(p, model, 2)
    motion = random_motion(beam, seed)
    symbols = [ca.SX.sym(name, beam.equations.size) for name in ("y", "rate", "acceleration")]
    residual = derived_residual(beam)(*symbols)
    tangents = beam.equations.tangents(*motion)
    for name, symbol in zip(("stiffness", "damping", "mass"), symbols, strict=True):
        derived = np.array(ca.Function(name, symbols, [ca.jacobian(residual, symbol)])(*(each[0] for each in motion)))
        closed = getattr(tangents, name)[0]
        np.testing.assert_allclose(closed, derived, rtol=0, atol=1e-11 * np.abs(derived).max(), err_msg=name)


@examples(10)
@given(p=parameters(), seed=st.integers(0, 2**20))
def test_mass_matrix_margin_sign(p, seed):
    beam = hub_beam(p, "foam", 3)
    y, _, _ = random_motion(beam, seed, deflection=1.0)
    inertia = beam.equations.inertia(y)
    mass = np.block([[inertia.hub[:, None], inertia.coupling], [inertia.coupling.T, inertia.beam]])
    definite = np.linalg.eigvalsh(mass / np.sqrt(np.outer(np.abs(np.diag(mass)), np.abs(np.diag(mass))))).min() > 0.0
    assert (inertia.margin()[0] > 0.0) == definite
