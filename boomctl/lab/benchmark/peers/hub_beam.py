"""The hub-beam's equations in SciPy's and CasADi's integrators."""

from dataclasses import replace
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp
from boomctl.rotating_beam.parameters import HubBeamParameters


def machine(change: float = 0.0) -> HubBeamParameters:
    """Return the machine of Bai et al. (2009) with another length, on which everything depends."""
    p = HubBeamParameters()
    return replace(p, length=p.length * (1.0 + change))


def equations(beam: AssumedModesBeam, manoeuvre: SpinUp | SineTorque) -> tuple[dict[str, Any], Array]:
    """Return the differential equations in CasADi, from rest, and the row that reads the tip off the states [m].

    Parameters
    ----------
    beam : AssumedModesBeam
        Without axial modes where the motion is prescribed.
    manoeuvre : SpinUp or SineTorque
    """
    import casadi as ca

    t = ca.SX.sym("t")
    if isinstance(manoeuvre, SineTorque):
        size = beam.equations.size
        x = ca.SX.sym("x", 2 * size)
        sine = manoeuvre.amplitude * ca.sin(2.0 * np.pi * t / manoeuvre.period)
        rate, _ = beam.casadi_function()(x, ca.if_else(t <= manoeuvre.duration, sine, 0.0))
        return {"x": x, "t": t, "ode": rate}, np.concatenate([[0.0], beam.equations.tip.transverse, np.zeros(size)])
    m, w, duration = beam.integrals, manoeuvre.final_speed, manoeuvre.duration
    n = m.V2.size
    x = ca.SX.sym("x", 2 * n)
    phase = 2.0 * np.pi * ca.fmin(t / duration, 1.0)
    speed, turning = w * (phase - ca.sin(phase)) / (2.0 * np.pi), w / duration * (1.0 - ca.cos(phase))
    force = speed**2 * ca.mtimes(ca.DM(m.M2 - m.D), x[:n]) - ca.mtimes(ca.DM(m.K2), x[:n]) - turning * ca.DM(m.V2)
    rate = ca.vertcat(x[n:], ca.mtimes(ca.DM(np.linalg.inv(m.M2)), force))
    return {"x": x, "t": t, "ode": rate}, np.append(m.tip2, np.zeros(n))


def sundials(beam: AssumedModesBeam, manoeuvre: SpinUp | SineTorque, timepts: Array, method: str, rtol: float) -> Array:
    """Return the tip's displacement [m] by CasADi's IDAS or CVODES."""
    import casadi as ca

    system, tip = equations(beam, manoeuvre)
    options = {"reltol": rtol, "abstol": 1e-2 * rtol, "max_num_steps": 10_000_000}
    flow = ca.integrator("flow", method.lower(), system, 0.0, timepts[1:], options)
    return np.concatenate([[0.0], tip @ np.array(flow(x0=0.0)["xf"])])


def scipy_motion(
    beam: AssumedModesBeam, manoeuvre: SpinUp | SineTorque, timepts: Array, method: str, rtol: float
) -> Array:
    """Return the tip's displacement [m] by ``solve_ivp``, the equations compiled by CasADi to one function."""
    import casadi as ca
    from scipy.integrate import solve_ivp

    system, tip = equations(beam, manoeuvre)
    f = ca.Function("f", [system["t"], system["x"]], [system["ode"]])
    options = {"rtol": rtol, "atol": 1e-2 * rtol}
    span, start = (0.0, timepts[-1]), np.zeros(len(tip))
    return tip @ solve_ivp(lambda t, x: np.array(f(t, x)).ravel(), span, start, method, timepts, **options).y
