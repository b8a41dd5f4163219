"""How cost grows: measured exponents beside those that the algorithms should have."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.analysis.sigma import sigma
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark import timing
from boomctl.lab.benchmark.precision.scene import Extent
from boomctl.lab.benchmark.precision.scenes.boom_time import track
from boomctl.lab.benchmark.report import Tell
from boomctl.reduction.reduce import reduce
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import spin_up
from boomctl.simulation.forced_response import forced_response
from boomctl.slew.optimal import optimal_slew

_FASTER = 0.25  # by which a measured exponent may exceed the expected one: caches, blocks, the fit itself (a choice)
_TURNS: dict[Extent, int] = {"quick": 1, "whole": 3}
_LONG = 1.0  # s from which on a first call is enough: what it pays for imports is nothing beside that (a choice)
_OMEGA = 2 * np.pi * np.geomspace(0.1, 10.0, 500)


@dataclass(frozen=True)
class Growth:
    """One thing that grows.

    Attributes
    ----------
    what : str
        What is computed, and what grows.
    sizes : tuple of float
    seconds : tuple of float
        Median processor time of each size [s].
    expected : float
        Exponent of the run time for large sizes.
    why : str
        Where it comes from.
    """

    what: str
    sizes: tuple[float, ...]
    seconds: tuple[float, ...]
    expected: float
    why: str

    @property
    def exponent(self) -> float:
        """The slope of the logarithms, by least squares over the upper half of the sizes, and two at least."""
        half = max(2, (len(self.sizes) + 1) // 2)
        return float(np.polyfit(np.log(self.sizes[-half:]), np.log(self.seconds[-half:]), 1)[0])

    @property
    def verdict(self) -> str:
        """What is to be said of it: "as expected", "slower" (it costs less) or "FASTER" (it costs more than expected)."""
        if self.exponent > self.expected + _FASTER:
            return "grows FASTER than expected"
        return "grows slower than expected" if self.exponent < self.expected - _FASTER else "as expected"


@dataclass(frozen=True)
class Task:
    """What is to be measured: ``work`` is given what ``made`` makes of a size, untimed."""

    what: str
    sizes: tuple[int, ...]
    made: Callable[[int], Any]
    work: Callable[[Any], object]
    expected: float
    why: str


def tasks(extent: Extent) -> tuple[Task, ...]:
    """Return all that is measured."""
    p, quick = BoomParameters(), extent == "quick"
    time, wheels = track()
    few = np.linspace(0.0, 60.0, 1501)

    def some(sizes: Sequence[int]) -> tuple[int, ...]:
        return (sizes[0], sizes[(len(sizes) - 3) // 2], sizes[-3]) if quick else tuple(sizes)

    def driven(seconds: int) -> tuple[Any, dict[str, Any]]:
        times = np.arange(round(seconds / time[1]) + 1) * time[1]
        return times, {name: np.resize(wheel, len(times)) for name, wheel in zip(ACTUATORS, wheels, strict=True)}

    model = spray_boom(p, "high-order", 4, order=10)
    return (
        Task(
            "sigma of the boom, finite elements, over elements",
            some((6, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)),
            lambda n: n,
            lambda n: sigma(spray_boom(p, elements=n), _OMEGA).sigma,
            1.0,
            "banded factors, a core whose size does not grow; beyond 5,000 elements a mixed form keeps digits and costs more",
        ),
        Task(
            "sigma of the boom, exact beam, over frequencies",
            some((500, 1000, 2000, 4000, 8000, 16_000, 32_000)),
            lambda n: 2 * np.pi * np.geomspace(0.1, 10.0, n),
            lambda omega: sigma(exact_frequency_response(p, omega, ACTUATORS, TIPS)).sigma,
            1.0,
            "each frequency for itself",
        ),
        Task(
            "sigma of the boom, order 10, over outputs (nozzles)",
            some((2, 4, 8, 16, 32, 64, 128)),
            lambda n: spray_boom(p, "high-order", 4, order=10, nozzles=np.linspace(-5.9, 5.9, n)),
            lambda boom: sigma(boom, _OMEGA, ACTUATORS, [o for o in boom.outputs if o.startswith("nozzle")]).sigma,
            1.0,
            "a row of the response for each",
        ),
        Task(
            "forced_response of the boom, order 10, over its duration",
            some((15, 30, 60, 120, 240, 480, 960)),
            driven,
            lambda given: forced_response(model, given[1], given[0], TIPS),
            1.0,
            "a step after the other, in blocks",
        ),
        Task(
            "reduce of the boom of 100 elements, over the order",
            some((4, 8, 12, 16, 24, 32, 48)),
            lambda n: n,
            lambda n: reduce(spray_boom(p, elements=100).select(ACTUATORS, TIPS), n),
            3.0,
            "a core of some times the order, balanced densely",
        ),
        Task(
            "spin-up of the hub-beam, SFOAM, over modes",
            some((1, 2, 5, 10, 20, 50, 100, 200)),
            lambda n: hub_beam(model="sfoam", modes=n),
            lambda beam: beam.simulate(spin_up(2.8, 30.0), few),
            3.0,
            "dense matrices of the modes; steps as short as the fastest mode is not damped out of",
        ),
        Task(
            "least-time slew of the hub-beam, one mode, over intervals",
            some((10, 20, 40, 80, 160)),
            lambda n: n,
            lambda n: optimal_slew(hub_beam(modes=1), 0.6, 200.0, intervals=n),
            1.0,
            "banded equations, and steps of the solver whose number does not grow",
        ),
    )


def growths(extent: Extent, tell: Tell) -> tuple[Growth, ...]:
    """Measure how everything grows."""
    found = []
    with timing.one_thread():
        for task in tasks(extent):
            tell(f"growth: {task.what}")
            given = {str(n): task.made(n) for n in task.sizes}
            runs = {name: (lambda value=value, task=task: task.work(value)) for name, value in given.items()}
            taken = {name: timing.process_time_of(run) for name, run in runs.items()}
            taken |= timing.in_turns({n: run for n, run in runs.items() if taken[n] < _LONG}, _TURNS[extent])
            seconds = tuple(max(taken[str(n)], 1e-9) for n in task.sizes)
            found.append(Growth(task.what, tuple(map(float, task.sizes)), seconds, task.expected, task.why))
    return tuple(found)
