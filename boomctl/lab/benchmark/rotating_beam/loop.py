"""The hub-beam under a sampled controller, beside python-control's and SciPy's integrators on the same equations."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.report import Measured, Row, Tell, race
from boomctl.lab.benchmark.rotating_beam.extrapolation import extrapolated_step
from boomctl.lab.benchmark.timing import Job, interleaved
from boomctl.lti.python_control import control
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.simulation.loop import simulate_loop

_SECTION = "Under feedback 20 s at 1 kHz, SFOAM, 5 modes, building included"
_DURATION, _STEP = 20.0, 1e-3  # of a run, and of its samples [s]
_SPAN = 1.0  # on which the peers are timed and errors measured [s]: the whole run would take them minutes
_WANTED = 1e-8  # error of the tip over its largest displacement: what ours has by default
_LADDER = tuple(10.0**-k for k in range(7, 12))  # tolerances of a peer, of which the loosest exact enough is timed
_REFERENCE = 1e-12  # tolerance of the references
_GAINS = -150.0, -250.0  # N m/rad, N m s/rad: of hub angle and speed, a choice that settles in some seconds
_ANGLE, _LIMIT = 0.5, 60.0  # rad, N m: the torque meets its limit as the hub sets out
_TIP_MASS = 0.1  # kg
_CONTROL_RATIO = 50.0  # this package promised itself
_METHODS, _MORE = ("RK45", "LSODA"), ("DOP853", "BDF", "Radau")


def loop_rows(full: bool, tell: Tell) -> list[Row]:
    """Race a loop with a torque limit against ``input_output_response`` and against restarts at each sample.

    python-control's integrators know no samples: they solve the loop with a continuous controller, and their error is to
    the exact solution of that.
    """
    tell("under feedback")
    beam = AssumedModesBeam(HubBeamParameters(tip_mass=_TIP_MASS), "sfoam", 5)
    whole, short = (np.linspace(0.0, end, round(end / _STEP) + 1) for end in (_DURATION, _SPAN))
    sampled, continuous = restarted(beam, short, _REFERENCE), responded(beam, short, "DOP853", _REFERENCE)
    peers: dict[str, tuple[Callable[[float], Array], Array]] = {
        "solve_ivp DOP853, restarted": (partial(restarted, beam, short), sampled)
    }
    for method in (*_METHODS, *_MORE) if full else _METHODS:
        peers[f"control {method}"] = (partial(responded, beam, short, method), continuous)
    entries, errors = {"ours": Job(lambda _: ours(beam, whole))}, {}
    for name, (peer, true) in peers.items():
        tolerance = _LADDER[0]
        for tolerance in _LADDER:
            errors[name] = _distance(peer(tolerance), true)
            if errors[name] <= _WANTED:
                break
        entries[name] = Job(lambda _, peer=peer, tolerance=tolerance: peer(tolerance))
    times = interleaved(entries, 5 if full else 3)
    error = _distance(ours(beam, short), sampled)
    rows = []
    fastest = min((name for name in peers if name.startswith("control")), key=lambda name: times[name])
    for name in peers:
        theirs = Measured(times[name] * _DURATION / _SPAN, errors[name])
        promised = name == fastest
        met = theirs.seconds >= _CONTROL_RATIO * times["ours"] and error <= theirs.error if promised else None
        target = f">= {_CONTROL_RATIO:g}x, error" if promised else ""
        job = f"peer: {name} ({_SPAN:g} s, x {_DURATION / _SPAN:g})"
        rows.append(race(_SECTION, job, Measured(times["ours"], error), theirs, target, met))
    return rows


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


def _distance(found: Array, true: Array) -> float:
    return float(np.abs(found - true).max() / np.abs(true).max())
