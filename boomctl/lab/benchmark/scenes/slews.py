"""Slews of least effort and of least time: the mesh or method against run time and distance from the best."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from boomctl.lab.benchmark.peers.hub_beam import machine
from boomctl.lab.benchmark.peers.opti import Effort, opti_programme, rockit_torque
from boomctl.lab.benchmark.promise import Promise, Who, exact, number, times_as_fast
from boomctl.lab.benchmark.references.slews import Referee
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, missing, there
from boomctl.lti.python_control import control
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.slew.optimal import optimal_slew, resolve
from boomctl.slew.torque import TorqueHistory

_ANGLE, _LIMIT = np.pi / 2, 200.0  # rad, N m: a quarter turn
_DURATION: dict[Extent, float] = {"quick": 3.2, "whole": 3.0}
"""Of the slew of least effort [s]; the least time is 2.91 s."""
_MODES: dict[Extent, int] = {"quick": 1, "whole": 3}
"""Modes of SFOAM."""
_REFERENCE: dict[Extent, int] = {"quick": 200, "whole": 400}
"""Intervals of the references: with half as many the least effort moves by 1e-8 (1 mode) and 2e-6 (3 modes)."""
_INERTIA, _TIP_MASS = 241.0, 0.1  # kg m^2 of the rigid body, kg at the tip of nonlinear beams
_LINEAR: dict[Extent, tuple[int, ...]] = {"quick": (1,), "whole": (1, 2, 3)}  # modes of the linear hub-beam
_NONLINEAR: dict[Extent, tuple[tuple[str, int], ...]] = {
    "quick": (("sfoam", 1),),
    "whole": (("sfoam", 1), ("sfoam", 3), ("sfoam", 5), ("foam", 1), ("foam", 2)),
}
_REPLAY = 1e-10  # tolerance of the replay by which the end of nonlinear beams is judged
_ONE_MODE = 2.0  # of Opti's run time over ours with one mode, which this package promised itself
_MISS, _PROVED = "error of the end", "optimality proved, or the torque an extremal"
_NEAR = 0.99  # of the angle: where what is kept ready for a second slew comes from
_SAME = 1e-11  # error below which none is told from another: the references' rounding

_OURS: dict[Extent, tuple[int, ...]] = {"quick": (55, 220), "whole": (30, 55, 110, 220, 420)}
"""Numbers of intervals of ours: a few more than the others', so that no tie is broken by rounding."""
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


_FINE, _LOOP = Who("optimal_slew", "220 intervals"), Who("Opti, RK4 in a loop", "200 intervals")
_EFFORT_PROMISES: tuple[Promise, ...] = (
    times_as_fast(_FINE, _LOOP, 5.0, "cold"),
    number(_FINE, _MISS, 1e-7),
    number(_LOOP, _MISS, None),
    number(Who("optimal_slew", "30 intervals"), _MISS, 1e-3),  # where RK4 is unstable in the third mode
    times_as_fast(_FINE, Who("rockit", "200 intervals"), 1.0, "cold"),
)


@dataclass(frozen=True)
class _Plan:
    """Modes of SFOAM, and the duration of the slew of least effort [s]."""

    modes: int
    duration: float

    def beam(self, change: float) -> AssumedModesBeam:
        """Return the machine, a little changed."""
        return AssumedModesBeam(machine(change), "sfoam", self.modes)

    def effort(self, intervals: int, change: float = 0.0) -> Effort:
        """Return the programme of others on a mesh."""
        return Effort(self.beam(change), _ANGLE, _LIMIT, self.duration, intervals)


def least_effort(extent: Extent) -> Scene:
    """Return the scene of least effort in a given time."""
    plan = _Plan(_MODES[extent], _DURATION[extent])
    referee = Referee(plan.effort(_REFERENCE[extent]))
    least = cache(referee.least_effort)

    def error(history: TorqueHistory) -> float:
        return max(abs(history.effort / least() - 1.0), referee.miss(history), _SAME)

    return Scene(
        key="slew-effort",
        title=f"Slew of least effort: a quarter turn in {plan.duration:g} s, SFOAM, {plan.modes} modes",
        question=f"From the beam's parameters to the torque of least effort within {_LIMIT:g} N m, held on equal intervals.",
        measure="The larger of the effort's distance from the least effort of any torque, relative, and the error of the end:"
        " of the hub's angle [rad], its speed [rad/s] or the tip [m], in a replay to rounding. The least effort is"
        " extrapolated from Opti's on fine meshes.",
        settings=(*(_planned(plan, n) for n in _OURS[extent]), *_peers(plan, extent, fastest=False)),
        error=error,
        missing=missing(rockit="rockit"),
        remarks=(
            "Cold: beam, programme and solution; ours has none, and keeps functions of beams with as many modes. Hot: Opti's"
            " programme is built and a slew through 0.99 of the angle solved beforehand; it starts from solution and"
            " multipliers. Ours by resolve, which plans once more.",
            "On the same mesh all efforts are alike, those of held torques, so that coarse meshes are compared by their cost"
            " alone; ours ends a thousand times more exactly, and is replayed by another integrator: 40 % of the time.",
            "Opti in a loop is the customary form, mapped the fastest one known; both, and rockit, use RK4.",
        ),
        promises=_EFFORT_PROMISES,
        found=lambda history: {_MISS: referee.miss(history)},
    )


def fastest(key: str, extent: Extent) -> Scene:
    """Return the scene of least time; that of one mode, where building and first calls are most of the time, ends so."""
    modes = 1 if key.endswith("one-mode") else _MODES[extent]
    plan = _Plan(modes, _DURATION["quick"])
    referee = Referee(plan.effort(_REFERENCE["quick"]))  # where to start from is all that the mesh decides
    least = cache(referee.least_time)

    def error(history: TorqueHistory) -> float:
        return max(abs(history.duration / least() - 1.0), referee.miss(history), _SAME)

    def switched(tolerance: float) -> Setting:
        return Setting(
            "optimal_slew, switching times",
            f"tolerance {tolerance:.0e}",
            ours=True,
            cold=lambda change: optimal_slew(plan.beam(change), _ANGLE, _LIMIT, tolerance=tolerance).history,
            call=f"bc.optimal_slew(beam, {_ANGLE:.4f}, {_LIMIT:g}, tolerance={tolerance:.0e})",
        )

    return Scene(
        key=key,
        title=f"Fastest slew: a quarter turn, SFOAM, {modes} modes",
        question=f"From the beam's parameters to the torque of least time within {_LIMIT:g} N m.",
        measure="The larger of the duration's distance from the least time, relative, and the error of the end: of the hub's"
        " angle [rad], its speed [rad/s] or the tip [m], in a replay to rounding. The least time is that of switching times"
        " found from Opti's by extrapolated motions.",
        settings=(*map(switched, _TOLERANCES[extent]), *_peers(plan, extent, fastest=True)),
        error=error,
        missing=missing(rockit="rockit"),
        remarks=(
            "Ours has the durations of arcs as unknowns and certifies that the torque is an extremal; torques that are held"
            " on a mesh take a little longer.",
            "Ours keeps nothing for a second slew; Opti is given a solution for 0.99 of the angle.",
        ),
        promises=(
            exact(Who("optimal_slew", "tolerance 1e-08" if extent == "quick" else "tolerance 1e-06"), 1e-6),
            times_as_fast(Who("optimal_slew", error=1e-6), Who("Opti, RK4 mapped", "200 intervals"), _ONE_MODE, "cold"),
        )
        if modes == 1
        else (exact(Who("optimal_slew", "tolerance 1e-06"), 1e-6),),
        shows="front" if key == "slew-time" else "promises",
    )


def certified(extent: Extent) -> Scene:
    """Return the scene of least time whose certificate is judged: linear plants with exact solutions, and nonlinear beams."""
    rigid = control.ss([[0, 1], [0, 0]], [[0], [1 / _INERTIA]], [[1, 0]], 0)
    masses = control.ss(
        [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, 0, 0], [1, -1, 0, 0]], [[0], [0], [1], [0]], [[1, 0, 0, 0]], 0
    )
    exactly: dict[str, Callable[[], float]] = {
        "rigid body": lambda: 2.0 * np.sqrt(_ANGLE * _INERTIA / _LIMIT),
        "two masses and a spring": _two_masses,
    }
    plants: list[tuple[str, Any, float, float, float]] = [
        ("rigid body", rigid, _ANGLE, _LIMIT, 1e-10),
        ("two masses and a spring", masses, 1.0, 1.0, 1e-8),
    ]
    for modes in _LINEAR[extent]:
        beam = AssumedModesBeam(HubBeamParameters(), "sfoam", modes).linearize()
        plants.append((f"linear hub-beam, modes: {modes}", beam, _ANGLE, _LIMIT, 1e-6))
    for model, modes in _NONLINEAR[extent]:
        beam = AssumedModesBeam(HubBeamParameters(tip_mass=_TIP_MASS), model, modes)
        plants.append((f"{model}, modes: {modes}", beam, _ANGLE, _LIMIT, 1e-6))

    def error(answer: tuple[str, Any]) -> float:
        name, slew = answer
        if name in exactly:
            return abs(slew.duration / exactly[name]() - 1.0)
        if name.startswith("linear"):
            return max(abs(slew.certificate.optimality_gap), abs(slew.end_error))
        beam, end = next(plant[1] for plant in plants if plant[0] == name), np.array([slew.duration])
        found = beam.simulate_torque(slew.history, end, slew.history.breakpoints, rtol=_REPLAY, atol=1e-3 * _REPLAY)
        rest = (found.hub_angle[0] - _ANGLE, found.hub_speed[0], found.tip_displacement[0])
        return max(abs(slew.certificate.optimality_gap), *(abs(float(each)) for each in rest))

    def solved(name: str, plant: Any, angle: float, limit: float, change: float) -> tuple[str, Any]:
        return name, optimal_slew(plant, angle * (1.0 + change), limit)

    return Scene(
        key="slew-certified",
        title="Fastest slews, certified",
        question="From a plant to the torque of least time, certificate and replay included.",
        measure="Of the duration against the exact one (rigid body; two masses: switching equations in 40 digits);"
        " otherwise the larger of the proved distance from the least time and of the error of the end in a replay.",
        settings=tuple(
            Setting(name, "as by default", ours=True, cold=partial(solved, name, *rest)) for name, *rest, _ in plants
        ),
        error=error,
        promises=tuple(
            promise
            for name, *_, wanted in plants
            for promise in (exact(Who(name), wanted), number(Who(name), _PROVED, 1.0, least=True))
        ),
        found=lambda answer: {_PROVED: float(answer[1].certificate.optimality in ("proved", "extremal"))},
        shows="promises",
    )


def _two_masses() -> float:
    """Return the least time of the two-mass move: its switching equations about the middle, in 40 digits."""
    import mpmath as mp

    with mp.workdps(40):
        w = mp.sqrt(2)

        def equations(half: object, b: object) -> tuple[object, object]:
            turn = half**2 - 2 * b**2 - 2  # pyright: ignore
            swing = mp.cos(w * half) - 2 * mp.cos(w * b) + 1
            return turn, swing

        return float(2 * mp.findroot(equations, (mp.mpf("2.1"), mp.mpf("1.1")))[0])


def _planned(made: _Plan, intervals: int) -> Setting:
    def plan(change: float, angle: float = _ANGLE) -> Any:
        return optimal_slew(made.beam(change), angle, _LIMIT, "effort", made.duration, intervals=intervals)

    return Setting(
        "optimal_slew",
        f"{intervals} intervals",
        ours=True,
        cold=lambda change: plan(change).history,
        hot=lambda near: resolve(near, angle=_ANGLE).history,
        prepare=lambda: plan(0.0, _NEAR * _ANGLE),
        call=f'bc.optimal_slew(beam, {_ANGLE:.4f}, {_LIMIT:g}, "effort", {made.duration:g}, intervals={intervals})',
    )


def _peers(plan: _Plan, extent: Extent, fastest: bool) -> Iterator[Setting]:
    for mapped, intervals, substeps in _OPTI[extent]:
        if mapped or not fastest:
            yield _shot(plan, mapped, intervals, substeps, fastest)
    if there("rockit"):
        for intervals in _ROCKIT[extent]:
            yield _rocket(plan, intervals, fastest)


def _shot(plan: _Plan, mapped: bool, intervals: int, substeps: int, fastest: bool) -> Setting:
    def programme(change: float = 0.0) -> Any:
        effort = plan.effort(intervals, change)
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


def _rocket(plan: _Plan, intervals: int, fastest: bool) -> Setting:
    def cold(change: float) -> TorqueHistory:
        effort = plan.effort(intervals, change)
        return rockit_torque(replace(effort, duration=3.5) if fastest else effort, fastest=fastest)

    return Setting("rockit, RK4", f"{intervals} intervals", ours=False, cold=cold)
