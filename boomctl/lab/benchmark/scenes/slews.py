"""Scenes of slews: least time, and least effort in a given time."""

from collections.abc import Callable
from typing import Any

import numpy as np

from boomctl.lab.benchmark.peers.hub_beam import machine
from boomctl.lab.benchmark.peers.slews import Slew, opti_torque
from boomctl.lab.benchmark.references.slews import end_error, least_effort, least_time
from boomctl.lab.benchmark.scene import Scene, Setting, settings
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.torque import TorqueHistory

_ANGLE, _LIMIT, _MODES = np.pi / 2, 200.0, 3  # rad, N m: a quarter turn; of SFOAM
_DURATION, _GUESS = 3.0, 3.5  # s: of the slew of least effort (the least time is 2.91 s); from which others begin
_SAME = 1e-11  # error below which nothing is told apart: rounding of the references


def slew_of(change: float = 0.0, modes: int = _MODES, duration: float = _DURATION) -> Slew:
    """Return the slew of a machine that is a little changed."""
    return Slew(AssumedModesBeam(machine(change), "sfoam", modes), _ANGLE, _LIMIT, duration)


def _scene(
    title: str, what: str, least: str, reference: Callable[[Any], float], ours: tuple[Setting, ...], remark: str
) -> Scene:
    """Return the scene of a slew; ``what`` is least, ``least`` says how the least one is found."""

    def theirs(intervals: int, substeps: int, problem: Any, change: float) -> TorqueHistory:
        slew = slew_of(change, duration=_GUESS if what == "time" else _DURATION)
        return opti_torque(slew.on(intervals), substeps, fastest=what == "time")

    def error(problem: Any, least: float, found: TorqueHistory) -> float:
        reached = found.duration if what == "time" else found.effort
        return max(abs(reached / least - 1.0), end_error(slew_of(), found), _SAME)

    steps = {"Opti, RK4": 1, "Opti, 4 steps of RK4": 4}
    meshes = {method: [(n, count) for n in (50, 100, 200, 400)] for method, count in steps.items()}
    return Scene(
        title=title,
        question=f"From the beam's parameters to the torque of least {what} within {_LIMIT:g} N m; SFOAM, {_MODES} modes.",
        measure=(
            f"The larger of the relative distance of the {what} from the least one and of the error of the end in a replay"
            f" to rounding: hub angle [rad], hub speed [rad/s] or tip [m]. The least {what} is that of {least}."
        ),
        reference=reference,
        error=error,
        methods=(
            *ours,
            *(
                s
                for name, mesh in meshes.items()
                for s in settings(name, "{} intervals", mesh, theirs, modules=("casadi",))
            ),
        ),
        remarks=(remark,),
    )


def slew_time() -> Scene:
    """Return the scene of least time."""

    def ours(rtol: float, problem: Any, change: float) -> TorqueHistory:
        return optimal_slew(slew_of(change).beam, _ANGLE, _LIMIT, tolerance=rtol).history

    return _scene(
        "Slew of least time",
        "time",
        "switching times, found from Opti's by extrapolated motions",
        lambda problem: least_time(slew_of(duration=_GUESS), 200),
        tuple(settings("optimal_slew", "tolerance {:.0e}", (1e-3, 1e-6, 1e-9), ours, verified=True, ours=True)),
        "Ours replays the torque by another integrator; torques held on a mesh take a little longer.",
    )


def slew_effort() -> Scene:
    """Return the scene of least effort."""

    def ours(intervals: int, problem: Any, change: float) -> TorqueHistory:
        return optimal_slew(slew_of(change).beam, _ANGLE, _LIMIT, "effort", _DURATION, intervals=intervals).history

    return _scene(
        f"Slew of least effort in {_DURATION:g} s",
        "effort",
        "any torque, extrapolated from Opti's on fine meshes",
        lambda problem: least_effort(slew_of(), 400),
        tuple(settings("optimal_slew", "{} intervals", (30, 55, 110, 220, 420), ours, verified=True, ours=True)),
        "On one mesh all efforts are alike; ours is replayed by another integrator.",
    )
