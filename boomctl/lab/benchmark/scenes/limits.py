"""How far hot paths are from the limit of the arithmetic or of memory traffic on this machine.

For each path the work that its method cannot do without is counted, in floating-point operations, in complex exponentials,
and in bytes that have to be read or written; the machine's rates of each are measured on arrays that suit it.  The limit is
the longest of the times that these take, arithmetic and exponentials added.  What lies above it is the cost of small
matrices, of Python, of checks and certificates.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from statistics import median
from timeit import repeat

import numpy as np

from boomctl.analysis.model_norm import SplitModel
from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_boom, exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.diagram import Diagram
from boomctl.lab.benchmark.peers.boom_loop import loop_scene, ours_of
from boomctl.lab.benchmark.promise import Promise, Who
from boomctl.lab.benchmark.scene import Extent, Scene, Setting
from boomctl.lab.benchmark.scenes.boom_time import track
from boomctl.lab.benchmark.timing import processor_time
from boomctl.reduction.core import structure_core
from boomctl.reduction.reduce import reduce
from boomctl.simulation.forced_response import forced_response
from boomctl.threads import one_blas_thread

_OMEGA = 2 * np.pi * np.geomspace(0.1, 10.0, 500)
_DENSE = 600  # rows of the product by which arithmetic is measured: large enough for its full rate, some 50 ms
_STREAM = 4_000_000  # numbers copied to measure memory traffic: 32 MB, beyond caches
_ROW = 4096  # complex numbers whose exponentials are timed: they stay in the second-level cache
_TURNS = 9  # of each rate: the median of so many lies within a few per cent (a choice)
_CALLS = 5  # of a turn, so that it lasts some milliseconds
_FINE = 100  # elements of the fine mesh
_LOOP_S: dict[Extent, float] = {"quick": 5.0, "whole": 60.0}  # of the sampled loop
_REDUCED, _CORE_ELEMENTS = 10, 100  # order, and elements of what is reduced to it
_COMPLEX = 8  # operations of a complex multiplication and addition
_MODES = 12  # n^3 operations of all modes of two symmetric matrices, Golub & Van Loan (2013), section 8.7
_RECIPROCAL = 8  # operations of the reciprocal of a complex number
_SCHUR = 25  # n^3 operations of a real Schur form, Golub & Van Loan (2013), section 7.5


@dataclass(frozen=True)
class Work:
    """Operations, bytes to and from memory, complex exponentials: those that a method needs, or that are done in a second."""

    operations: float
    bytes: float
    exponentials: float = 0.0

    def seconds(self, rates: "Work") -> float:
        """Return the least time that it takes where so much is done in a second [s]."""
        computed = self.operations / rates.operations + self.exponentials / rates.exponentials
        return max(computed, self.bytes / rates.bytes)

    def bound(self, rates: "Work") -> str:
        """Return what limits it."""
        arithmetic, traffic = self.operations / rates.operations, self.bytes / rates.bytes
        functions = self.exponentials / rates.exponentials
        if traffic > arithmetic + functions:
            return "memory traffic"
        return "exponentials" if functions > arithmetic else "arithmetic"


def machine_rates() -> Work:
    """Measure what this machine does in a second on one thread."""
    A = np.random.default_rng(0).standard_normal((_DENSE, _DENSE))
    source, target = np.ones(_STREAM), np.empty(_STREAM)
    z, into = 1j * np.linspace(0.0, 3.0, _ROW) - 0.1, np.empty(_ROW, complex)

    def taken(run: Callable[[], object]) -> float:
        turns = repeat(run, timer=processor_time, repeat=_TURNS, number=_CALLS)
        return max(median(turns) / _CALLS, 1e-9)

    with one_blas_thread:
        products, copies = taken(lambda: A @ A), taken(lambda: np.copyto(target, source))
        return Work(2.0 * _DENSE**3 / products, 16.0 * _STREAM / copies, _ROW / taken(lambda: np.exp(z, out=into)))


def limits(extent: Extent) -> Scene:
    """Return the scene of the five hottest paths."""
    paths = (_exact_sigma(), _fine_sigma(), _forced_response(), _sampled_loop(_LOOP_S[extent]), _reduction())
    rates = cache(machine_rates)

    def told(what: str, work: Work) -> Promise:
        who = Who(what)

        def read(diagram: Diagram) -> float | None:
            seconds = who.fastest(diagram, "hot")
            return None if seconds is None else seconds / work.seconds(rates())

        return Promise(f"{what}: times the limit of {work.bound(rates())}", read)

    return Scene(
        key="limits",
        title="Distance from the limit of arithmetic and memory",
        question="For each of the hottest paths, what its method cannot do without is counted; the limit is the time that it"
        f" takes at the rates of this machine, on one thread: {rates().operations / 1e9:.3g}·10⁹ operations in a second in"
        f" matrix products, {rates().bytes / 1e9:.3g} GB/s copied, {rates().exponentials / 1e6:.3g}·10⁶ complex exponentials"
        " in a second.",
        settings=tuple(
            Setting(what, counted, ours=True, hot=lambda _, run=run: run()) for what, counted, _, run in paths
        ),
        remarks=(
            "What lies above the limit: matrices too small for the full rate, NumPy's calls and temporary arrays, checks and"
            " certificates.",
        ),
        promises=tuple(told(what, work) for what, _, work, _ in paths),
        shows="promises",
    )


_Path = tuple[str, str, Work, Callable[[], object]]


def _exact_sigma() -> _Path:
    p, points = BoomParameters(), len(_OMEGA)
    prepared = exact_boom(p).prepared(ACTUATORS, TIPS)
    kinds, operations = len(prepared.kinds), 0.0
    parts = [part for batch in prepared.arrangement.batches for part in batch.parts]
    for part in parts:
        numbers = len(part.places) + part.n * part.inputs
        combined = 4 * numbers * (3 + 6 * kinds)  # real numbers times complex ones
        solved = _COMPLEX * (part.n**3 / 6 + part.inputs * part.n**2)  # a symmetric matrix
        operations += points * (combined + solved)
    exponentials = 4.0 * points * kinds  # cosh, sinh, cos and sin of a complex number by two, roots by as much again
    traffic = 16.0 * points * (2 + 4)
    return (
        f"sigma of the exact boom, {points} frequencies",
        f"{len(parts)} symmetric solves of {max(part.n for part in parts)} unknowns and {4 * kinds} complex functions a"
        " frequency",
        Work(operations, traffic, exponentials),
        lambda: sigma(exact_frequency_response(p, _OMEGA, ACTUATORS, TIPS)).sigma,
    )


def _fine_sigma() -> _Path:
    model, points = spray_boom(elements=_FINE), len(_OMEGA)
    operations, traffic, sizes = 0.0, 0.0, []
    for part in SplitModel.of(model.select(ACTUATORS, TIPS)).parts:
        n, pairs = part.n, len(part.inputs) * len(part.outputs)
        sizes.append(n)
        # all modes of two symmetric matrices; real and imaginary part of a sum over them for each pair and frequency
        operations += _MODES * n**3 + points * n * (4.0 * pairs + _RECIPROCAL)
        traffic += 8.0 * n**2 * 4
    return (
        f"sigma of {_FINE} finite elements, {points} frequencies",
        f"all modes of {' and '.join(map(str, sizes))} coordinates, a sum over them a frequency",
        Work(operations, traffic),
        lambda: sigma(spray_boom(elements=_FINE), _OMEGA).sigma,
    )


def _forced_response() -> _Path:
    time, wheels = track()
    model = spray_boom(None, "high-order", 4, order=10)
    signals: dict[str, Array] = dict(zip(ACTUATORS, wheels, strict=True))
    states = 2 * forced_response(model, signals, time, TIPS).modes
    # two multiplications and additions of a pair of poles, two of the signal at both ends of a step, one read
    operations = len(time) * states * 2.0 * (2 + 2 + 1)
    return (
        f"forced_response, {len(time)} samples, two inputs and outputs",
        f"{states} states in pairs of poles, a step a sample",
        Work(operations, 8.0 * 4 * len(time)),
        lambda: forced_response(model, signals, time, TIPS),
    )


def _sampled_loop(seconds: float) -> _Path:
    scene = loop_scene(seconds)
    states, moved, controls = len(scene.plant.A), len(ACTUATORS), len(scene.driven)
    read = len(scene.read) + len(scene.measured)
    a_step = states * 2.0 * (2 + 2 * moved + controls + read)
    return (
        f"sampled loop with limits, {len(scene.time)} samples, {states} states",
        "pairs of poles, controls, disturbances and outputs, a step a sample",
        Work(len(scene.time) * a_step, 8.0 * len(scene.time) * (moved + controls + read)),
        lambda: ours_of(scene),
    )


def _reduction() -> _Path:
    model = spray_boom(elements=_CORE_ELEMENTS).select(ACTUATORS, TIPS)
    core = structure_core(model, 14 + _REDUCED)
    if core is None:
        raise RuntimeError("the boom has no core")
    n, r = model.n, len(core.stable.A)
    operations = 2.0 * _SCHUR * r**3 + 20.0 * r**3 + 4.0 * n * r**2
    return (
        f"reduce of {_CORE_ELEMENTS} elements to order {_REDUCED}",
        f"a core of {r} states: two Lyapunov equations, singular values, projection; no verification",
        Work(operations, 8.0 * 4 * n * r),
        lambda: reduce(spray_boom(elements=_CORE_ELEMENTS).select(ACTUATORS, TIPS), _REDUCED),
    )
