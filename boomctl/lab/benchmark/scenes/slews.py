"""Scenes of slews: least time, and least effort in a given time."""

from typing import Any

import numpy as np

from boomctl.lab.benchmark.peers.hub_beam import machine
from boomctl.lab.benchmark.peers.slews import Slew, opti_torque
from boomctl.lab.benchmark.references.slews import end_error, least_effort, least_time
from boomctl.lab.benchmark.scene import Scene, settings
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.torque import TorqueHistory

_ANGLE, _LIMIT, _MODES = np.pi / 2, 200.0, 3  # rad, N m: a quarter turn; of SFOAM
_DURATION, _GUESS = 3.0, 3.5  # s: of the slew of least effort (the least time is 2.91 s); from which others begin
_SAME = 1e-11  # error below which nothing is told apart: rounding of the references
_QUESTION = f"From the beam's parameters to the torque of least {{}} within {_LIMIT:g} N m; SFOAM, {_MODES} modes."
_MEASURE = (
    "The larger of the relative distance of the {0} from the least one and of the error of the end in a replay to rounding:"
    " hub angle [rad], hub speed [rad/s] or tip [m]. The least {0} is that of {1}."
)


def slew_of(change: float = 0.0, modes: int = _MODES, duration: float = _DURATION) -> Slew:
    """Return the slew of a machine that is a little changed."""
    return Slew(AssumedModesBeam(machine(change), "sfoam", modes), _ANGLE, _LIMIT, duration)


def slew_time() -> Scene:
    """Return the scene of least time."""

    def ours(rtol: float, problem: Any, change: float) -> TorqueHistory:
        return optimal_slew(slew_of(change).beam, _ANGLE, _LIMIT, tolerance=rtol).history

    def theirs(intervals: int, substeps: int, problem: Any, change: float) -> TorqueHistory:
        return opti_torque(slew_of(change, duration=_GUESS).on(intervals), substeps, fastest=True)

    def error(problem: Any, least: float, found: TorqueHistory) -> float:
        return max(abs(found.duration / least - 1.0), end_error(slew_of(), found), _SAME)

    call, meshes = f"bc.optimal_slew(beam, {_ANGLE:.4f}, {_LIMIT:g}, tolerance={{:.0e}})", (50, 100, 200, 400)
    return Scene(
        title="Slew of least time",
        question=_QUESTION.format("time"),
        measure=_MEASURE.format("time", "switching times, found from Opti's by extrapolated motions"),
        problem=lambda: None,
        reference=lambda problem: least_time(slew_of(duration=_GUESS), 200),
        error=error,
        methods=(
            *settings("optimal_slew", "tolerance {:.0e}", (1e-3, 1e-6, 1e-9), ours, verified=True, call=call),
            *settings("Opti, RK4", "{} intervals", [(n, 1) for n in meshes], theirs, modules=("casadi",)),
            *settings("Opti, 4 steps of RK4", "{} intervals", [(n, 4) for n in meshes], theirs, modules=("casadi",)),
        ),
        remarks=("Ours replays the torque by another integrator; torques held on a mesh take a little longer.",),
    )


def slew_effort() -> Scene:
    """Return the scene of least effort."""

    def ours(intervals: int, problem: Any, change: float) -> TorqueHistory:
        return optimal_slew(slew_of(change).beam, _ANGLE, _LIMIT, "effort", _DURATION, intervals=intervals).history

    def theirs(intervals: int, substeps: int, problem: Any, change: float) -> TorqueHistory:
        return opti_torque(slew_of(change).on(intervals), substeps)

    def error(problem: Any, least: float, found: TorqueHistory) -> float:
        return max(abs(found.effort / least - 1.0), end_error(slew_of(), found), _SAME)

    call = f'bc.optimal_slew(beam, {_ANGLE:.4f}, {_LIMIT:g}, "effort", {_DURATION:g}, intervals={{}})'
    meshes = (50, 100, 200, 400)
    return Scene(
        title=f"Slew of least effort in {_DURATION:g} s",
        question=_QUESTION.format("effort"),
        measure=_MEASURE.format("effort", "any torque, extrapolated from Opti's on fine meshes"),
        problem=lambda: None,
        reference=lambda problem: least_effort(slew_of(), 400),
        error=error,
        methods=(
            *settings("optimal_slew", "{} intervals", (30, 55, 110, 220, 420), ours, verified=True, call=call),
            *settings("Opti, RK4", "{} intervals", [(n, 1) for n in meshes], theirs, modules=("casadi",)),
            *settings("Opti, 4 steps of RK4", "{} intervals", [(n, 4) for n in meshes], theirs, modules=("casadi",)),
        ),
        remarks=("On one mesh all efforts are alike; ours is replayed by another integrator.",),
    )
