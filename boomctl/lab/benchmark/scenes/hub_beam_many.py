"""Many motions at once: torques on one hub-beam, and machines that differ and follow one slew."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import cycle
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.hub_beam import machine, until
from boomctl.lab.benchmark.peers.integrators import TORQUE, Ode
from boomctl.lab.benchmark.promise import Who, exact, times_as_fast
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, asked
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.tracking.monte_carlo import TrackingStudy
from boomctl.slew.tracking.tracked import TrackedSlew

_END: dict[Extent, float] = {"quick": 5.0, "whole": 60.0}  # s, of the motion
_TORQUES: dict[Extent, int] = {"quick": 2, "whole": 16}  # at once (a choice)
_LADDER: dict[Extent, tuple[float, ...]] = {"quick": (1e-6,), "whole": (1e-4, 1e-6, 1e-8)}  # relative, of IDAS
_RTOL, _ATOL, _TRUE = 1e-6, 1e-13, 1e-10  # of ours [m], and what all are judged by
_IDAS_RATIO = 1.5  # of its run time over ours, which this package promised itself

_RUNS: dict[Extent, int] = {"quick": 16, "whole": 256}  # machines of a study
_FEW: dict[Extent, int] = {"quick": 2, "whole": 8}  # of them that are simulated one by one
_RATIO = 10.0  # of the run time of a machine by itself over its share: this package promised itself; 19 were measured
_FOLLOW_RTOL, _FOLLOW_ATOL = 1e-6, 1e-8  # of both
_EXACT = 1e-11  # rtol of the reference
_NOISE = {"hub_angle": 2e-5, "hub_speed": 2e-4, "root_moment": 0.2}  # rad, rad/s, N m: of the sensors
_ANGLE, _PLANNED, _LIMIT = np.pi / 2, 140.0, 200.0  # rad, N m, N m


def many_torques(extent: Extent) -> Scene:
    """Return the scene of many torques on SFOAM with five modes."""
    torques = [replace(TORQUE, amplitude=float(each)) for each in np.linspace(20.0, 200.0, _TORQUES[extent])]
    times = until(_END[extent])

    def beam(change: float = 0.0) -> AssumedModesBeam:
        return AssumedModesBeam(machine(change), "sfoam", 5)

    def together(made: AssumedModesBeam, rtol: float = _RTOL) -> Array:
        return np.array([each.tip_displacement for each in made.simulate_many(torques, times, rtol=rtol, atol=_ATOL)])

    def alone(made: AssumedModesBeam) -> Array:
        found = (made.simulate(each, times, rtol=_RTOL, atol=_ATOL) for each in torques)
        return np.array([each.tip_displacement for each in found])

    def peer(tolerance: float) -> Setting:
        return Setting(
            "CasADi IDAS, one by one",
            f"rtol {tolerance:.0e}",
            ours=False,
            hot=lambda runs: np.array([run() for run in runs]),
            prepare=lambda: [Ode.of(beam(), each).motion(times, "idas", tolerance) for each in torques],
        )

    def own(name: str, run: Callable[[AssumedModesBeam], Array]) -> Setting:
        return asked(name, f"rtol {_RTOL:.0e}", beam, run, ours=True)

    true = cache(lambda: together(beam(), _TRUE))
    ours = Who("simulate_many", error=_RTOL)
    return Scene(
        key="hub-beam-many",
        title=f"{len(torques)} torques on the hub-beam, {_END[extent]:g} s",
        question="From the beam's parameters to the tip's displacement under each torque; SFOAM, 5 modes.",
        measure=f"Largest error of any displacement over the largest under its torque, against ours to {_TRUE:.0e}.",
        settings=(own("simulate_many", together), own("simulate, one by one", alone), *map(peer, _LADDER[extent])),
        error=lambda found: _distance(found, true()),
        promises=(
            times_as_fast(ours, Who("CasADi IDAS", error=_RTOL), _IDAS_RATIO),
            exact(Who("simulate_many"), _RTOL),
        ),
        shows="promises",
    )


def followers(extent: Extent) -> Scene:
    """Return the scene of many machines that follow a slew, stepped together and one by one."""
    runs, few = _RUNS[extent], _FEW[extent]

    @cache
    def tracked() -> TrackedSlew:
        beam = AssumedModesBeam(HubBeamParameters(), "sfoam", 2)
        options: dict[str, Any] = {"torque_limit": _LIMIT, "measurements": list(_NOISE), "noise": _NOISE, "settle": 4.0}
        return optimal_slew(beam, _ANGLE, _PLANNED).track(**options)

    def together() -> TrackingStudy:
        given = {"stiffness": 0.1, "tip_mass": (0.0, 0.05), "friction": (0.0, 2.0)}
        return tracked().monte_carlo(runs, **given, rtol=_FOLLOW_RTOL, atol=_FOLLOW_ATOL)

    study = cache(together)

    def alone(rtol: float, first: int = 0) -> Array:
        return np.array([one(tracked(), study(), i, rtol) for i in range(first, first + few)])

    true, firsts = cache(lambda: alone(_EXACT)), cycle(range(0, runs, few))
    rtol = f"rtol {_FOLLOW_RTOL:.0e}"
    return Scene(
        key="hub-beam-followers",
        title=f"{runs} machines follow a slew (LQG, SFOAM, 2 modes, 7 s at 200 Hz)",
        question="From a tracked slew to the tip's displacement of machines that differ in stiffness, tip mass and friction.",
        measure=f"Largest error of the first {few} displacements over the largest, against simulations to {_EXACT:.0e}.",
        settings=(
            Setting("monte_carlo", rtol, True, hot=lambda _: together()["tip_displacement"][:few], prepare=study),
            Setting(_ALONE, rtol, True, hot=lambda _: alone(_FOLLOW_RTOL, next(firsts)), prepare=study),
        ),
        error=lambda found: _distance(found, true()),
        remarks=(
            f"One by one: {few} of them, others each time, so that what is kept of a machine serves none.",
            "Nine tenths of our time are CasADi's arithmetic. One machine by itself takes half of what it took when ten times"
            " its share was promised: it is eight or nine.",
        ),
        promises=(
            times_as_fast(Who("monte_carlo"), Who(_ALONE), _RATIO * few / runs),
            exact(Who("monte_carlo"), _FOLLOW_RTOL),
        ),
        shows="promises",
    )


_ALONE = "simulate, one by one"


def one(tracked: TrackedSlew, study: TrackingStudy, run: int, rtol: float) -> Array:
    """Return the tip's displacement in one run of a study, by `simulate`."""
    drawn = {name: float(row[run]) for name, row in study.drawn.items()}
    true = tracked.machine.with_tip_mass(drawn["tip_mass"]).with_stiffness(drawn["stiffness"])
    seed = int(study.seeds[run])
    found = tracked.simulate(true, friction=drawn["friction"], seed=seed, rtol=rtol, atol=1e-2 * rtol)
    return found["tip_displacement"]


def _distance(found: Array, true: Array) -> float:
    """Return the largest error of any motion over its largest value."""
    return float((np.abs(found - true).max(axis=1) / np.abs(true).max(axis=1)).max())
