"""The hub-beam under a sampled controller: by us, and by python-control's and SciPy's integrators on the same equations."""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.references.extrapolation import extrapolated_step
from boomctl.lti.python_control import control
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.simulation.loop import simulate_loop

_STEP = 1e-3  # of the samples [s]
_GAINS = -150.0, -250.0  # N m/rad, N m s/rad: of hub angle and speed, a choice that settles in some seconds
_ANGLE, _LIMIT = 0.5, 60.0  # rad, N m: the torque meets its limit as the hub sets out


def ours(beam: AssumedModesBeam, time: Array, rtol: float = 1e-8) -> Array:
    """Return the tip's displacement by ``simulate_loop``."""
    law = control.ss([], [], [], [_GAINS], _STEP, inputs=["hub_angle", "hub_speed"], outputs=["torque"])
    wanted = {"hub_angle": np.full(time.size, _ANGLE)}
    options: dict[str, Any] = {"force_limit": _LIMIT, "reference": wanted, "rtol": rtol, "atol": 1e-2 * rtol}
    found = simulate_loop(beam, law, None, time, sample_time=_STEP, **options)
    return found["tip_displacement"]


def restarted(beam: AssumedModesBeam, time: Array, tolerance: float, method: str = "DOP853") -> Array:
    """Return the same by ``solve_ivp``, restarted at each sample."""
    from scipy.integrate import solve_ivp

    size, row = beam.equations.size, beam.equations.tip.transverse
    x, found = np.zeros(2 * size), np.zeros(time.size)
    for k, (start, end) in enumerate(pairwise(time)):
        torque = float(np.clip(_GAINS[0] * (x[0] - _ANGLE) + _GAINS[1] * x[size], -_LIMIT, _LIMIT))

        def derivative(t: float, x: Array, torque: float = torque) -> Array:
            return beam.equations.state_derivative(x, torque)

        options = {"rtol": max(tolerance, 3e-14), "atol": 1e-2 * tolerance}
        x = solve_ivp(derivative, (start, end), x, method, **options).y[:, -1]
        found[k + 1] = row @ x[1:size]
    return found


def sampled_reference(beam: AssumedModesBeam, time: Array) -> Array:
    """Return the tip's displacement to rounding: the equations derived from the energies, extrapolated between samples."""
    import casadi as ca

    f, size, row = beam.casadi_function(), beam.equations.size, beam.equations.tip.transverse
    x, u = ca.SX.sym("x", 2 * size), ca.SX.sym("u")
    step = ca.Function("step", [x, u], [extrapolated_step(lambda a, _: f(a, u)[0], x, 0.0, float(time[1] - time[0]))])
    state, found = np.zeros(2 * size), np.zeros(time.size)
    for k in range(1, time.size):
        asked = _GAINS[0] * (state[0] - _ANGLE) + _GAINS[1] * state[size]
        state = np.array(step(state, min(max(asked, -_LIMIT), _LIMIT))).ravel()
        found[k] = row @ state[1:size]
    return found


def continuous_loop(beam: AssumedModesBeam) -> control.NonlinearIOSystem:
    """Return the loop whose controller is continuous, interconnected."""
    plant = beam.to_nlsys()
    law = control.ss([], [], [], [_GAINS], inputs=["error", "hub_speed"], outputs=["asked"], name="law")
    compared = control.summing_junction(["hub_angle", "-wanted"], "error", name="compared")

    def clipped(t: float, x: Array, u: Array, params: dict[str, Any]) -> Array:
        return np.clip(u, -_LIMIT, _LIMIT)

    limit = control.nlsys(None, clipped, inputs=["asked"], outputs=["torque"], name="limit")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # outputs that no one reads
        return control.interconnect([plant, law, compared, limit], inputs=["wanted"], outputs=["tip_displacement"])


def response(loop: control.NonlinearIOSystem, time: Array, method: str, tolerance: float) -> Array:
    """Return the tip's displacement in that loop, by ``input_output_response``."""
    options = {"rtol": tolerance, "atol": 1e-2 * tolerance}
    found = control.input_output_response(
        loop, time, np.full(time.size, _ANGLE), solve_ivp_method=method, solve_ivp_kwargs=options
    )
    return np.asarray(found.outputs).ravel()


def responded(beam: AssumedModesBeam, time: Array, method: str, tolerance: float) -> Array:
    """Return the tip's displacement in the loop whose controller is continuous, building included."""
    return response(continuous_loop(beam), time, method, tolerance)
