"""How cost grows with size: measured exponents beside those that the algorithms should have."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from boomctl.analysis.sigma import sigma
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.promise import Promise, Who, seconds
from boomctl.lab.benchmark.promise import growth as grows
from boomctl.lab.benchmark.scene import Extent, Scene, Setting
from boomctl.lab.benchmark.scenes.boom_time import track
from boomctl.reduction.reduce import reduce
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import spin_up
from boomctl.simulation.forced_response import forced_response
from boomctl.slew.optimal import optimal_slew

_FASTER = 0.25  # by which a measured exponent may exceed the expected one: caches, blocks, the fit itself (a choice)
_LINEAR = 1.15  # largest exponent of memory that counts as linear
_SHARE = 0.2  # of the seconds of a scene: few settings, and slopes of logarithms tell no per cents
_MODEL = "spray_boom, finite elements, over elements"
_FINE = "sigma of the boom at three frequencies, fine meshes, over elements"
_OMEGA = 2 * np.pi * np.geomspace(0.1, 10.0, 500)  # rad/s, the band of the papers' pictures


@dataclass(frozen=True)
class Task:
    """What grows: ``work`` is given what ``made`` makes of a size, untimed; ``why`` says where the exponent comes from."""

    what: str
    sizes: tuple[int, ...]
    work: Callable[[Any], object]
    expected: float
    why: str
    made: Callable[[int], Any] = lambda size: size
    promises: tuple[Promise, ...] = ()


def growth(name: str, extent: Extent) -> Scene:
    """Return the scene of one thing that grows."""
    task = tasks()[name]
    sizes = task.sizes
    if extent == "quick":
        sizes = (sizes[0], sizes[(len(sizes) - 3) // 2], sizes[-3])
    who = Who(task.what)
    return Scene(
        key=f"growth-{name}",
        title=f"How cost grows: {task.what}",
        question=f"Expected for large sizes: an exponent of {task.expected:g}; {task.why}.",
        settings=tuple(
            Setting(task.what, f"{n:,}", ours=True, hot=task.work, prepare=partial(task.made, n), size=n) for n in sizes
        ),
        promises=(grows(who, task.expected + _FASTER), *task.promises),
        shows="promises",
        share=_SHARE,
    )


def tasks() -> dict[str, Task]:
    """Return all that is measured, by its name."""
    p = BoomParameters()
    time, wheels = track()
    few = np.linspace(0.0, 60.0, 1501)

    def driven(seconds: int) -> tuple[Any, dict[str, Any]]:
        times = np.arange(round(seconds / time[1]) + 1) * time[1]
        return times, {name: np.resize(wheel, len(times)) for name, wheel in zip(ACTUATORS, wheels, strict=True)}

    model = spray_boom(p, "high-order", 4, order=10)
    return {
        "elements": Task(
            "sigma of the boom, finite elements, over elements",
            (6, 12, 25, 50, 100, 200, 400),
            lambda n: sigma(spray_boom(p, elements=n), _OMEGA).sigma,
            3.0,
            "all modes at once, found densely",
        ),
        "fine-meshes": Task(
            _FINE,
            (800, 1600, 3200, 6400, 12_800),
            lambda n: sigma(spray_boom(p, elements=n), _OMEGA[::200]).sigma,
            1.0,
            "beyond 700 elements a sparse factorisation a frequency",
            promises=(grows(Who(_FINE), _LINEAR, "memory"),),
        ),
        "frequencies": Task(
            "sigma of the boom, exact beam, over frequencies",
            (500, 1000, 2000, 4000, 8000, 16_000, 32_000),
            lambda omega: sigma(exact_frequency_response(p, omega, ACTUATORS, TIPS)).sigma,
            1.0,
            "each frequency for itself",
            made=lambda n: 2 * np.pi * np.geomspace(0.1, 10.0, n),
        ),
        "outputs": Task(
            "sigma of the boom, order 10, over outputs (nozzles)",
            (2, 4, 8, 16, 32, 64, 128),
            lambda boom: sigma(boom, _OMEGA, ACTUATORS, [o for o in boom.outputs if o.startswith("nozzle")]).sigma,
            1.0,
            "a row of the response for each",
            made=lambda n: spray_boom(p, "high-order", 4, order=10, nozzles=np.linspace(-5.9, 5.9, n)),
        ),
        "duration": Task(
            "forced_response of the boom, order 10, over its duration",
            (15, 30, 60, 120, 240, 480, 960),
            lambda given: forced_response(model, given[1], given[0], TIPS),
            1.0,
            "a step after the other, in blocks",
            made=driven,
        ),
        "models": Task(
            _MODEL,
            (6, 20, 100, 1000, 2000, 5000),
            lambda n: spray_boom(p, elements=n),
            1.0,
            "rows of elements that are alike",
            promises=(seconds(Who(_MODEL, "6"), 2e-3, "hot"), seconds(Who(_MODEL, "1,000"), 10e-3, "hot")),
        ),
        "order": Task(
            "reduce of the boom of 100 elements, over the order",
            (4, 8, 12, 16, 24, 32, 48),
            lambda n: reduce(spray_boom(p, elements=100).select(ACTUATORS, TIPS), n),
            3.0,
            "a core of some times the order, balanced densely",
        ),
        "modes": Task(
            "spin-up of the hub-beam, SFOAM, over modes",
            (1, 2, 5, 10, 20, 50, 100, 200),
            lambda beam: beam.simulate(spin_up(2.8, 30.0), few),
            3.0,
            "dense matrices of the modes; steps as short as the fastest mode is not damped out of",
            made=lambda n: hub_beam(model="sfoam", modes=n),
        ),
        "intervals": Task(
            "least-time slew of the hub-beam, one mode, over intervals",
            (10, 20, 40, 80, 160),
            lambda n: optimal_slew(hub_beam(modes=1), 0.6, 200.0, intervals=n),
            1.0,
            "banded equations, and steps of the solver whose number does not grow",
        ),
    }
