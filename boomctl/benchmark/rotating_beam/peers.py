"""The hub-beam's equations in SciPy's and CasADi's integrators."""

from collections.abc import Callable

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp

SPIN_UP = SpinUp(2.8, 30.0)  # rad/s, s: of Bai et al. (2009), Fig. 5, near the critical speed of TLAM
TORQUE = SineTorque(200.0, 10.0, 10.0)  # N m, s, s: of Fig. 8
INSTANTS = np.linspace(0.0, 60.0, 601)  # of the output [s]; the paper's figures end at 60 s

Motion = Callable[[], Array]
"""Returns the tip's displacement at all `INSTANTS`, m."""


def scipy_spin_up(beam: AssumedModesBeam, method: str) -> Callable[[float], Motion]:
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
            span, start = (0.0, INSTANTS[-1]), np.zeros(2 * n)
            solution = solve_ivp(derivative, span, start, method, INSTANTS, rtol=tolerance, atol=1e-2 * tolerance)
            return m.tip2 @ solution.y[:n]

        return motion

    return build


def casadi_spin_up(beam: AssumedModesBeam, method: str) -> Callable[[float], Motion]:
    """Return what makes a spin-up in one of CasADi's integrators of a relative tolerance."""
    import casadi as ca

    m = beam.integrals
    n, w, duration = m.V2.size, SPIN_UP.final_speed, SPIN_UP.duration
    x, t = ca.SX.sym("x", 2 * n), ca.SX.sym("t")
    phase = 2.0 * np.pi * ca.fmin(t / duration, 1.0)
    speed = w * (phase - ca.sin(phase)) / (2.0 * np.pi)
    turning = w / duration * (1.0 - ca.cos(phase))
    force = speed**2 * ca.mtimes(ca.DM(m.M2 - m.D), x[:n]) - ca.mtimes(ca.DM(m.K2), x[:n]) - turning * ca.DM(m.V2)
    ode = ca.vertcat(x[n:], ca.mtimes(ca.DM(np.linalg.inv(m.M2)), force))

    def build(tolerance: float) -> Motion:
        options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": 1000000}
        flow = ca.integrator("flow", method, {"x": x, "t": t, "ode": ode}, 0.0, INSTANTS[1:], options)

        def motion() -> Array:
            states = np.array(flow(x0=np.zeros(2 * n))["xf"])
            return np.concatenate([[0.0], m.tip2 @ states[:n]])

        return motion

    return build


def scipy_torque(beam: AssumedModesBeam, manoeuvre: SineTorque) -> Callable[[float], Motion]:
    """Return what makes a torque-driven motion in ``solve_ivp``'s DOP853 of a relative tolerance."""
    from scipy.integrate import solve_ivp

    size = beam.equations.size

    def derivative(t: float, x: Array) -> Array:
        return beam.equations.state_derivative(x, float(manoeuvre.torque(t)))

    def build(tolerance: float) -> Motion:
        def motion() -> Array:
            span, start = (0.0, INSTANTS[-1]), np.zeros(2 * size)
            solution = solve_ivp(derivative, span, start, "DOP853", INSTANTS, rtol=tolerance, atol=1e-2 * tolerance)
            return beam.equations.tip.transverse @ solution.y[1:size]

        return motion

    return build


def casadi_torque(beam: AssumedModesBeam, manoeuvre: SineTorque) -> Callable[[float], Motion]:
    """Return what makes a torque-driven motion in CasADi's IDAS of a relative tolerance."""
    import casadi as ca

    size = beam.equations.size
    x, t = ca.SX.sym("x", 2 * size), ca.SX.sym("t")
    sine = manoeuvre.amplitude * ca.sin(2.0 * np.pi * t / manoeuvre.period)
    xdot, _ = beam.casadi_function()(x, ca.if_else(t <= manoeuvre.duration, sine, 0.0))

    def build(tolerance: float) -> Motion:
        options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": 10000000}
        flow = ca.integrator("flow", "idas", {"x": x, "t": t, "ode": xdot}, 0.0, INSTANTS[1:], options)

        def motion() -> Array:
            states = np.array(flow(x0=np.zeros(2 * size))["xf"])
            return np.concatenate([[0.0], beam.equations.tip.transverse @ states[1:size]])

        return motion

    return build
