"""The hub-beam's equations in SciPy's and CasADi's integrators."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp

SPIN_UP = SpinUp(2.8, 30.0)  # rad/s, s: of Bai et al. (2009), Fig. 5, near the critical speed of TLAM
TORQUE = SineTorque(200.0, 10.0, 10.0)  # N m, s, s: of Fig. 8
INSTANTS = np.linspace(0.0, 60.0, 601)  # of the output [s]; the paper's figures end at 60 s

Motion = Callable[[], Array]
"""Returns the tip's displacement at all instants asked for, m."""


def scipy_spin_up(beam: AssumedModesBeam, method: str, timepts: Array = INSTANTS) -> Callable[[float], Motion]:
    """Return what makes a spin-up in one of ``solve_ivp``'s methods of a relative tolerance."""
    from scipy.integrate import solve_ivp

    m = beam.integrals
    inverse = np.linalg.inv(m.M2)
    stiffness, softening, inertia = inverse @ m.K2, inverse @ (m.M2 - m.D), inverse @ m.V2
    n, w, duration = m.V2.size, SPIN_UP.final_speed, SPIN_UP.duration

    def derivative(t: float, x: Array) -> Array:
        phase = 2.0 * np.pi * min(t / duration, 1.0)
        speed = w * (phase - np.sin(phase)) / (2.0 * np.pi)
        turning = w / duration * (1.0 - np.cos(phase))
        q = x[:n]
        return np.concatenate([x[n:], speed**2 * (softening @ q) - stiffness @ q - turning * inertia])

    def build(tolerance: float) -> Motion:
        def motion() -> Array:
            span, start = (0.0, timepts[-1]), np.zeros(2 * n)
            solution = solve_ivp(derivative, span, start, method, timepts, rtol=tolerance, atol=1e-2 * tolerance)
            return m.tip2 @ solution.y[:n]

        return motion

    return build


@dataclass(frozen=True)
class Ode:
    """A motion from rest in CasADi: states, time [s], the states' rates, and the row that reads the tip off the states."""

    x: Any
    t: Any
    ode: Any
    tip: Array


def spin_up_ode(beam: AssumedModesBeam) -> Ode:
    """Return the spin-up of a beam without axial modes."""
    import casadi as ca

    m = beam.integrals
    n, w, duration = m.V2.size, SPIN_UP.final_speed, SPIN_UP.duration
    x, t = ca.SX.sym("x", 2 * n), ca.SX.sym("t")
    phase = 2.0 * np.pi * ca.fmin(t / duration, 1.0)
    speed = w * (phase - ca.sin(phase)) / (2.0 * np.pi)
    turning = w / duration * (1.0 - ca.cos(phase))
    force = speed**2 * ca.mtimes(ca.DM(m.M2 - m.D), x[:n]) - ca.mtimes(ca.DM(m.K2), x[:n]) - turning * ca.DM(m.V2)
    return Ode(x, t, ca.vertcat(x[n:], ca.mtimes(ca.DM(np.linalg.inv(m.M2)), force)), np.append(m.tip2, np.zeros(n)))


def torque_ode(beam: AssumedModesBeam, manoeuvre: SineTorque) -> Ode:
    """Return the motion under a torque, of the equations that CasADi derives from the energies."""
    import casadi as ca

    size = beam.equations.size
    x, t = ca.SX.sym("x", 2 * size), ca.SX.sym("t")
    sine = manoeuvre.amplitude * ca.sin(2.0 * np.pi * t / manoeuvre.period)
    xdot, _ = beam.casadi_function()(x, ca.if_else(t <= manoeuvre.duration, sine, 0.0))
    tip = np.zeros(2 * size)
    tip[1:size] = beam.equations.tip.transverse
    return Ode(x, t, xdot, tip)


def casadi_motion(equations: Ode, method: str, timepts: Array = INSTANTS) -> Callable[[float], Motion]:
    """Return what makes a motion in one of CasADi's integrators of a relative tolerance."""
    import casadi as ca

    system = {"x": equations.x, "t": equations.t, "ode": equations.ode}

    def build(tolerance: float) -> Motion:
        options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": 10000000}
        flow = ca.integrator("flow", method, system, 0.0, timepts[1:], options)

        def motion() -> Array:
            return np.concatenate([[0.0], equations.tip @ np.array(flow(x0=0.0)["xf"])])

        return motion

    return build


def casadi_spin_up(beam: AssumedModesBeam, method: str, timepts: Array = INSTANTS) -> Callable[[float], Motion]:
    """Return what makes a spin-up in one of CasADi's integrators of a relative tolerance."""
    return casadi_motion(spin_up_ode(beam), method, timepts)


def scipy_torque(
    beam: AssumedModesBeam, manoeuvre: SineTorque, method: str = "DOP853", timepts: Array = INSTANTS
) -> Callable[[float], Motion]:
    """Return what makes a torque-driven motion in one of ``solve_ivp``'s methods of a relative tolerance."""
    from scipy.integrate import solve_ivp

    size = beam.equations.size

    def derivative(t: float, x: Array) -> Array:
        return beam.equations.state_derivative(x, float(manoeuvre.torque(t)))

    def build(tolerance: float) -> Motion:
        def motion() -> Array:
            span, start = (0.0, timepts[-1]), np.zeros(2 * size)
            solution = solve_ivp(derivative, span, start, method, timepts, rtol=tolerance, atol=1e-2 * tolerance)
            return beam.equations.tip.transverse @ solution.y[1:size]

        return motion

    return build


def casadi_torque(
    beam: AssumedModesBeam, manoeuvre: SineTorque, method: str = "idas", timepts: Array = INSTANTS
) -> Callable[[float], Motion]:
    """Return what makes a torque-driven motion in one of CasADi's integrators of a relative tolerance."""
    return casadi_motion(torque_ode(beam, manoeuvre), method, timepts)
