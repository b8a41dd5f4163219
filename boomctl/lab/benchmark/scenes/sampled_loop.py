"""Loops with a force limit, sampled a thousand times a second: of the boom, which is linear, and of the hub-beam.

python-control's integrators know no samples: they are given the loop with a continuous controller, and judged by the exact
solution of that.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers import beam_loop as of_beam
from boomctl.lab.benchmark.peers import boom_loop as of_boom
from boomctl.lab.benchmark.peers.hub_beam import machine
from boomctl.lab.benchmark.promise import Who, exact, times_as_fast
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, asked
from boomctl.lti.rounding import SUMMED
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam

_STEP = 1e-3  # s, of the samples
_TRUE = 1e-12  # tolerance of the references that are integrated
_MODES, _TIP_MASS = 5, 0.1  # of SFOAM; kg

_SPAN: dict[Extent, float] = {"quick": 0.25, "whole": 1.0}
"""How long the motion lasts [s]: run times are proportional to it, and the slowest takes some seconds for one."""

_CONTROL: dict[Extent, tuple[tuple[str, tuple[float, ...]], ...]] = {
    "quick": (("RK45", (1e-3,)),),
    "whole": (
        ("RK45", (1e-3, 1e-6, 1e-9)),
        ("DOP853", (1e-3, 1e-6, 1e-9)),
        ("LSODA", (1e-3, 1e-6, 1e-9)),
        ("BDF", (1e-3, 1e-5)),
        ("Radau", (1e-3, 1e-5)),
    ),
}
"""Methods of python-control's integrators, and their relative tolerances."""
_RESTARTED: dict[Extent, tuple[tuple[str, tuple[float, ...]], ...]] = {
    "quick": (("DOP853", (1e-6,)),),
    "whole": (("RK45", (1e-3, 1e-6, 1e-9)), ("DOP853", (1e-3, 1e-6, 1e-9)), ("LSODA", (1e-6,))),
}
"""Methods of solve_ivp, and their relative tolerances."""
_TOLERANCES: dict[Extent, tuple[float, ...]] = {
    "quick": (1e-3, 1e-8),
    "whole": (1e-2, 1e-4, 1e-6, 1e-8, 1e-10),
}
"""Relative tolerances of ours: from looser than anyone wants to rounding."""

_REMARKS = (
    "python-control's loop has a continuous controller, and its error is to the exact solution of that; all others have the"
    " sampled one.",
    "Run times grow in proportion to the time simulated, but for what building takes.",
)

_PEER = "control.input_output_response"

Answer = tuple[str, Array]
"""Which loop was solved, "sampled" or "continuous", and what moves in it."""


def _judge(sampled: Callable[[], Array], continuous: Callable[[], Array]) -> Callable[[Answer], float]:
    references = {"sampled": cache(sampled), "continuous": cache(continuous)}

    def error(answer: Answer) -> float:
        which, found = answer
        true = references[which]()
        # error below which none is told from another: rounding, of the references too
        return max(float(np.abs(found - true).max() / np.abs(true).max()), SUMMED)

    return error


def boom_loop(extent: Extent) -> Scene:
    """Return the scene of the boom's suspension, on its lowest 20 modes."""
    span = _SPAN[extent]

    def made(change: float) -> of_boom.LoopScene:
        p = BoomParameters()
        return of_boom.loop_scene(span, replace(p, spring_stiffness=p.spring_stiffness * (1.0 + change)))

    ready = made(0.0)
    call = "bc.simulate_loop(plant, controller, disturbance, t, sample_time=1e-3, force_limit=0.25)"
    settings = (
        _setting("simulate_loop", "exact", "sampled", made, of_boom.ours_of, call),
        *_each(_CONTROL[extent], f"{_PEER}, {{}}", "continuous", made, of_boom.continuous_loop),
        _setting("control, plant sampled beforehand", "disturbance held", "sampled", made, of_boom.sampled_loop),
        *_each(_RESTARTED[extent], "solve_ivp {}, restarted", "sampled", made, of_boom.restarted_loop),
    )
    return Scene(
        key="boom-loop",
        title=f"The boom's suspension with a force limit, {span:g} s sampled at 1 kHz",
        question="From the boom's parameters to the tips' motion over rough ground; 20 modes, a spring and damper law on the"
        f" strokes, {ready.limit:g} N at most.",
        measure="Largest error of the tips' displacements over the largest displacement, against the exact solution in"
        f" extended precision (sampled), or solve_ivp to {_TRUE:.0e} from sample to sample (continuous).",
        settings=settings,
        error=_judge(lambda: of_boom.sampled_reference(ready), lambda: of_boom.continuous_reference(ready, _TRUE)),
        remarks=(
            *_REMARKS,
            "Between samples the plant is linear: ours has no tolerance, it is exact to rounding.",
            "The modes of the plant are ours, computed in everybody's cold calls.",
        ),
        promises=(
            times_as_fast(Who("simulate_loop"), Who(f"{_PEER}, RK45", "rtol 1e-03"), 50.0),
            times_as_fast(Who("simulate_loop"), Who(_PEER), 15.0),
            exact(Who("simulate_loop"), 1e-10),
        ),
    )


def beam_loop(extent: Extent) -> Scene:
    """Return the scene of the hub-beam that is turned to an angle."""
    time = np.linspace(0.0, _SPAN[extent], round(_SPAN[extent] / _STEP) + 1)

    def made(change: float) -> AssumedModesBeam:
        return AssumedModesBeam(replace(machine(change), tip_mass=_TIP_MASS), "sfoam", _MODES)

    def ours(rtol: float) -> Setting:
        options = f"sample_time=1e-3, force_limit=60.0, reference=wanted, rtol={rtol:.0e}"
        call = f"bc.simulate_loop(beam, pd, None, t, {options})"
        run = partial(of_beam.ours, time=time, rtol=rtol)
        return _setting("simulate_loop", f"rtol {rtol:.0e}", "sampled", made, run, call)

    def joined(change: float) -> Any:
        return of_beam.continuous_loop(made(change))

    settings = (
        *map(ours, _TOLERANCES[extent]),
        *_each(_CONTROL[extent], f"{_PEER}, {{}}", "continuous", joined, partial(of_beam.response, time=time)),
        *_each(_RESTARTED[extent], "solve_ivp {}, restarted", "sampled", made, partial(of_beam.restarted, time=time)),
    )
    beam = made(0.0)
    return Scene(
        key="beam-loop",
        title=f"The hub-beam turned by a controller with a torque limit, {time[-1]:g} s sampled at 1 kHz",
        question=f"From the beam's parameters to the tip's displacement; SFOAM, {_MODES} modes, {_TIP_MASS:g} kg at the tip,"
        " proportional-derivative feedback of the hub's angle.",
        measure="Largest error of the displacement over the largest displacement, against extrapolation of order 16 from"
        f" sample to sample, or DOP853 to {_TRUE:.0e} (continuous controller); errors below {SUMMED:.0e} count as that.",
        settings=settings,
        error=_judge(
            lambda: of_beam.sampled_reference(beam, time), lambda: of_beam.responded(beam, time, "DOP853", _TRUE)
        ),
        remarks=(
            *_REMARKS,
            "solve_ivp's and python-control's derivative of the state is ours.",
            "Half of our time is building CasADi's functions, which does not grow with the motion; the step of a machine is"
            " kept for the next loop around it.",
        ),
        promises=(
            times_as_fast(Who("simulate_loop", "rtol 1e-08"), Who(_PEER, error=1e-8), 50.0),
            exact(Who("simulate_loop", "rtol 1e-08"), 1e-10),
        ),
    )


def _setting(
    name: str, label: str, which: str, made: Callable[[float], Any], run: Callable[[Any], Array], call: str = ""
) -> Setting:
    """Return the setting of who solves one of the two loops; ours, where it says what a user writes."""
    return asked(name, label, made, lambda loop: (which, run(loop)), ours=bool(call), call=call)


def _each(
    methods: tuple[tuple[str, tuple[float, ...]], ...],
    name: str,
    which: str,
    made: Callable[[float], Any],
    run: Callable[..., Array],
) -> Iterator[Setting]:
    """Return the settings of some methods of an integrator, each at some relative tolerances; ``run`` has them by name."""
    for method, tolerances in methods:
        for tolerance in tolerances:
            ask = partial(run, method=method, tolerance=tolerance)
            yield _setting(name.format(method), f"rtol {tolerance:.0e}", which, made, ask)
