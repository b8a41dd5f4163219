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

Motion = Callable[[], Array]
"""Returns the tip's displacement at all instants asked for, m."""


def scipy_motion(
    beam: AssumedModesBeam, manoeuvre: SpinUp | SineTorque, timepts: Array, method: str, tolerance: float
) -> Motion:
    """Return what makes a motion in one of ``solve_ivp``'s methods of a relative tolerance."""
    from scipy.integrate import solve_ivp

    spun = isinstance(manoeuvre, SpinUp)
    rate, tip = _spin_up_rate(beam, manoeuvre) if spun else _torque_rate(beam, manoeuvre)

    def motion() -> Array:
        span, start = (0.0, timepts[-1]), np.zeros(len(tip))
        return tip @ solve_ivp(rate, span, start, method, timepts, rtol=tolerance, atol=1e-2 * tolerance).y

    return motion


_Rate = Callable[[float, Array], Array]


def _spin_up_rate(beam: AssumedModesBeam, manoeuvre: SpinUp) -> tuple[_Rate, Array]:
    """Return the states' rates of a beam without axial modes, and the row that reads the tip off the states."""
    m = beam.integrals
    inverse = np.linalg.inv(m.M2)
    stiffness, softening, inertia = inverse @ m.K2, inverse @ (m.M2 - m.D), inverse @ m.V2
    n, w, duration = m.V2.size, manoeuvre.final_speed, manoeuvre.duration

    def rate(t: float, x: Array) -> Array:
        phase = 2.0 * np.pi * min(t / duration, 1.0)
        speed = w * (phase - np.sin(phase)) / (2.0 * np.pi)
        turning = w / duration * (1.0 - np.cos(phase))
        q = x[:n]
        return np.concatenate([x[n:], speed**2 * (softening @ q) - stiffness @ q - turning * inertia])

    return rate, np.append(m.tip2, np.zeros(n))


def _torque_rate(beam: AssumedModesBeam, manoeuvre: SineTorque) -> tuple[_Rate, Array]:
    return lambda t, x: beam.equations.state_derivative(x, float(manoeuvre.torque(t))), _tip(beam)


def _tip(beam: AssumedModesBeam) -> Array:
    """Return the row that reads the tip off hub angle and modes and their rates."""
    size = beam.equations.size
    tip = np.zeros(2 * size)
    tip[1:size] = beam.equations.tip.transverse
    return tip


@dataclass(frozen=True)
class Ode:
    """A motion from rest in CasADi: states, time [s], the states' rates, and the row that reads the tip off the states."""

    x: Any
    t: Any
    ode: Any
    tip: Array

    @classmethod
    def of(cls, beam: AssumedModesBeam, manoeuvre: SpinUp | SineTorque) -> "Ode":
        """Return the spin-up of a beam without axial modes, or the motion of any beam under a torque."""
        return _spin_up_ode(beam, manoeuvre) if isinstance(manoeuvre, SpinUp) else _torque_ode(beam, manoeuvre)

    def motion(self, timepts: Array, method: str, tolerance: float) -> Motion:
        """Return what makes the motion in one of CasADi's integrators of a relative tolerance."""
        import casadi as ca

        options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": 10000000}
        system = {"x": self.x, "t": self.t, "ode": self.ode}
        flow = ca.integrator("flow", method.lower(), system, 0.0, timepts[1:], options)
        return lambda: np.concatenate([[0.0], self.tip @ np.array(flow(x0=0.0)["xf"])])


def _spin_up_ode(beam: AssumedModesBeam, manoeuvre: SpinUp) -> Ode:
    import casadi as ca

    m = beam.integrals
    n, w, duration = m.V2.size, manoeuvre.final_speed, manoeuvre.duration
    x, t = ca.SX.sym("x", 2 * n), ca.SX.sym("t")
    phase = 2.0 * np.pi * ca.fmin(t / duration, 1.0)
    speed = w * (phase - ca.sin(phase)) / (2.0 * np.pi)
    turning = w / duration * (1.0 - ca.cos(phase))
    force = speed**2 * ca.mtimes(ca.DM(m.M2 - m.D), x[:n]) - ca.mtimes(ca.DM(m.K2), x[:n]) - turning * ca.DM(m.V2)
    return Ode(x, t, ca.vertcat(x[n:], ca.mtimes(ca.DM(np.linalg.inv(m.M2)), force)), np.append(m.tip2, np.zeros(n)))


def _torque_ode(beam: AssumedModesBeam, manoeuvre: SineTorque) -> Ode:
    """Return the motion under a torque, of the equations that CasADi derives from the energies."""
    import casadi as ca

    x, t = ca.SX.sym("x", 2 * beam.equations.size), ca.SX.sym("t")
    sine = manoeuvre.amplitude * ca.sin(2.0 * np.pi * t / manoeuvre.period)
    xdot, _ = beam.casadi_function()(x, ca.if_else(t <= manoeuvre.duration, sine, 0.0))
    return Ode(x, t, xdot, _tip(beam))
