"""Slews of the hub-beam of least effort and of least time: the mesh or method against run time and distance from the best."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from boomctl.lab.benchmark.precision.scene import Extent, Scene, Setting
from boomctl.lab.benchmark.precision.scenes.hub_beam import machine
from boomctl.lab.benchmark.slew.peers import Effort, has_rockit, opti_programme, rockit_torque
from boomctl.lab.benchmark.slew.referee import Referee
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.optimal import optimal_slew, resolve
from boomctl.slew.torque import TorqueHistory

_ANGLE, _LIMIT = np.pi / 2, 200.0  # rad, N m: a quarter turn
_DURATION: dict[Extent, float] = {"quick": 3.2, "whole": 3.0}
"""Of the slew of least effort [s]; the least time is 2.91 s."""
_MODES: dict[Extent, int] = {"quick": 1, "whole": 3}
"""Modes of SFOAM."""
_REFERENCE: dict[Extent, int] = {"quick": 200, "whole": 400}
"""Intervals of the references: with half as many the least effort moves by 1e-8 (1 mode) and 2e-6 (3 modes)."""
_NEAR = 0.99  # of the angle: where what is kept ready for a second slew comes from
_SAME = 1e-11  # error below which none is told from another: the references' rounding

_OURS: dict[Extent, tuple[tuple[str, int], ...]] = {
    "quick": (("shooting", 55), ("shooting", 220)),
    "whole": (
        *(("shooting", intervals) for intervals in (30, 55, 110, 220, 420)),
        ("collocation", 110),
        ("collocation", 220),
        ("radau", 110),
    ),
}
"""Methods and numbers of intervals of ours: a few more than the others', so that no tie is broken by rounding."""
_OPTI: dict[Extent, tuple[tuple[bool, int, int], ...]] = {
    "quick": ((True, 50, 1), (True, 200, 1)),
    "whole": (
        *((True, intervals, 1) for intervals in (50, 100, 200, 400)),
        *((True, intervals, 4) for intervals in (50, 100, 200, 400)),
        (False, 100, 1),
        (False, 200, 1),
    ),
}
"""Whether the step is mapped, intervals, steps of RK4 on each."""
_ROCKIT: dict[Extent, tuple[int, ...]] = {"quick": (), "whole": (100, 200)}
"""Numbers of intervals of rockit, which takes seconds to build."""
_TOLERANCES: dict[Extent, tuple[float, ...]] = {"quick": (1e-4, 1e-8), "whole": (1e-3, 1e-6, 1e-9)}
"""Tolerances of the end of ours of least time."""


def _beam(extent: Extent, change: float) -> AssumedModesBeam:
    return AssumedModesBeam(machine(change), "sfoam", _MODES[extent])


def _effort(extent: Extent, intervals: int, change: float = 0.0) -> Effort:
    return Effort(_beam(extent, change), _ANGLE, _LIMIT, _DURATION[extent], intervals)


def _missing() -> tuple[str, ...]:
    return () if has_rockit() else ("rockit: not installed",)


def least_effort(extent: Extent) -> Scene:
    """Return the scene of least effort in a given time."""
    referee = Referee(_effort(extent, _REFERENCE[extent]))
    least, duration = referee.least_effort(), _DURATION[extent]

    def error(history: TorqueHistory) -> float:
        return max(abs(history.effort / least - 1.0), referee.miss(history), _SAME)

    def settings() -> Iterator[Setting]:
        for method, intervals in _OURS[extent]:
            yield _planned(extent, method, intervals)
        for mapped, intervals, substeps in _OPTI[extent]:
            yield _shot(extent, mapped, intervals, substeps, fastest=False)
        if has_rockit():
            for intervals in _ROCKIT[extent]:
                yield _rocket(extent, intervals, fastest=False)

    return Scene(
        key="slew-effort",
        title=f"Slew of least effort: a quarter turn in {duration:g} s, SFOAM, {_MODES[extent]} modes",
        question=f"From the beam's parameters to the torque of least effort within {_LIMIT:g} N m, held on equal intervals.",
        measure="The larger of the effort's distance from the least effort of any torque, relative, and the error of the end:"
        " of the hub's angle [rad], its speed [rad/s] or the tip [m], in a replay to rounding. The least effort is"
        " extrapolated from Opti's on fine meshes.",
        settings=tuple(settings()),
        error=error,
        missing=_missing(),
        remarks=(
            "Cold: beam, programme and solution. Hot: the programme is built and a slew through 0.99 of the angle solved"
            " beforehand; ours by resolve, Opti's with a parameter and a start from solution and multipliers.",
            "Where others are ahead: on the same mesh all efforts are alike, those of held torques, so that coarse meshes are"
            " compared by their cost alone. Ours ends a thousand times more exactly, is replayed, and in cold calls a second"
            " mesh says how far from the best it is: with one mode that is two thirds of the time, and mapped Opti, whose RK4"
            " is exact enough there, takes a quarter of it.",
            "Opti in a loop is the customary form, mapped the fastest one known; both, and rockit, use RK4.",
        ),
    )


def fastest(extent: Extent) -> Scene:
    """Return the scene of least time."""
    referee = Referee(_effort(extent, _REFERENCE["quick"]))  # where to start from is all that the mesh decides
    least = referee.least_time()

    def error(history: TorqueHistory) -> float:
        return max(abs(history.duration / least - 1.0), referee.miss(history), _SAME)

    def settings() -> Iterator[Setting]:
        for tolerance in _TOLERANCES[extent]:
            yield Setting(
                "optimal_slew, switching times",
                f"tolerance {tolerance:.0e}",
                ours=True,
                cold=lambda change, tolerance=tolerance: (
                    optimal_slew(_beam(extent, change), _ANGLE, _LIMIT, tolerance=tolerance).history
                ),
                call=f"bc.optimal_slew(beam, {_ANGLE:.4f}, {_LIMIT:g}, tolerance={tolerance:.0e})",
            )
        for mapped, intervals, substeps in _OPTI[extent]:
            if mapped:
                yield _shot(extent, mapped, intervals, substeps, fastest=True)
        if has_rockit():
            for intervals in _ROCKIT[extent]:
                yield _rocket(extent, intervals, fastest=True)

    return Scene(
        key="slew-time",
        title=f"Fastest slew: a quarter turn, SFOAM, {_MODES[extent]} modes",
        question=f"From the beam's parameters to the torque of least time within {_LIMIT:g} N m.",
        measure="The larger of the duration's distance from the least time, relative, and the error of the end: of the hub's"
        " angle [rad], its speed [rad/s] or the tip [m], in a replay to rounding. The least time is that of switching times"
        " found from Opti's by extrapolated motions.",
        settings=tuple(settings()),
        error=error,
        missing=_missing(),
        remarks=(
            "Ours has the durations of arcs as unknowns and certifies that the torque is an extremal; torques that are held"
            " on a mesh take a little longer.",
            "Ours keeps nothing for a second slew; Opti is given a solution for 0.99 of the angle.",
        ),
    )


def _planned(extent: Extent, method: str, intervals: int) -> Setting:
    def plan(change: float, angle: float = _ANGLE) -> Any:
        options = {"method": method, "intervals": intervals}
        return optimal_slew(_beam(extent, change), angle, _LIMIT, "effort", _DURATION[extent], **options)

    options = f'method="{method}", intervals={intervals}'
    return Setting(
        f"optimal_slew, {method}",
        f"{intervals} intervals",
        ours=True,
        cold=lambda change: plan(change).history,
        hot=lambda near: resolve(near, angle=_ANGLE).history,
        prepare=lambda: plan(0.0, _NEAR * _ANGLE),
        call=f'bc.optimal_slew(beam, {_ANGLE:.4f}, {_LIMIT:g}, "effort", {_DURATION[extent]:g}, {options})',
    )


def _shot(extent: Extent, mapped: bool, intervals: int, substeps: int, fastest: bool) -> Setting:
    def programme(change: float = 0.0) -> Any:
        effort = _effort(extent, intervals, change)
        return opti_programme(replace(effort, duration=3.5) if fastest else effort, substeps, mapped, fastest)

    def cold(change: float) -> TorqueHistory:
        built = programme(change)
        return built.torque(built.solve(_ANGLE))

    def prepare() -> Any:
        built = programme()
        return built, built.solve(_NEAR * _ANGLE)

    hot: Callable[[Any], TorqueHistory] = lambda ready: ready[0].torque(ready[0].solve(_ANGLE, ready[1]))  # noqa: E731
    steps = "" if substeps == 1 else f", {substeps} steps each"
    name = f"Opti, RK4 {'mapped' if mapped else 'in a loop'}"
    return Setting(name + steps, f"{intervals} intervals", ours=False, cold=cold, hot=hot, prepare=prepare)


def _rocket(extent: Extent, intervals: int, fastest: bool) -> Setting:
    def cold(change: float) -> TorqueHistory:
        effort = _effort(extent, intervals, change)
        return rockit_torque(replace(effort, duration=3.5) if fastest else effort, fastest=fastest)

    return Setting("rockit, RK4", f"{intervals} intervals", ours=False, cold=cold)
