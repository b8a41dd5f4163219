"""The boom on a minute of bumps: the motion of its tips over time."""

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import mpmath as mp
import numpy as np
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import splu

from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers.boom import MESHES, boom_peer, control_boom, our_mesh
from boomctl.lab.benchmark.peers.plain_boom import PlainBoom
from boomctl.lab.benchmark.promise import Who, exact, times_as_fast
from boomctl.lab.benchmark.references.high_precision import damped_eigenvalues, tip_transfer
from boomctl.lab.benchmark.scene import Extent, Scene, Setting
from boomctl.lti.python_control import control
from boomctl.simulation.forced_response import forced_response
from boomctl.structure.response.poles import damped_poles

DURATION, _STEP = 60.0, 0.01  # s, of the track and between its samples
_FIRST, _EVERY, _RAMP, _TOP = 1.0, 6.0, 0.5, 1.0  # s: the first bump, one wheel's next, its slopes, its top
_SHIFT, _HEIGHT = 2.0, 0.1  # s by which the right wheel's bumps come later; m
_BUMPS = 5  # of each wheel: the second half of the minute is left to the resonances
# pairs of exact poles that the reference is made of, and its digits: shooting from the tips loses thirty at the highest
_PAIRS: dict[Extent, tuple[int, int]] = {"quick": (20, 40), "whole": (40, 60)}
_BESIDE = (
    10.0  # times the share of the last pair, by which an answer may begin beside zero: what pairs left out are worth
)
_FAST = 1e3  # 1/s: decay from which on a pole found is one of those that pile up at twice the inverse of the damping
_CIRCLE = 4  # points of the circles around poles by which residues are found: their error is the 4th power of 1e-4
_RADIUS = 1e-4  # of these circles, relative to the pole

_OURS: dict[Extent, tuple[tuple[str, tuple[tuple[int, float], ...]], ...]] = {
    "quick": (("finite", ((6, 1e-2), (20, 1e-4))), ("high-order", ((6, 1e-3), (10, 1e-6)))),
    "whole": (
        ("finite", ((6, 1e-2), (10, 1e-2), (20, 1e-3), (50, 1e-4), (100, 1e-5), (200, 1e-6), (500, 1e-6))),
        (
            "high-order",
            ((4, 1e-2), (5, 1e-3), (6, 1e-4), (7, 1e-5), (8, 1e-6), (10, 1e-7), (12, 1e-8), (16, 1e-9), (20, 1e-10)),
        ),
        ("discrete-hermite", ((6, 1e-2), (10, 1e-3), (20, 1e-4), (50, 1e-5), (100, 1e-6))),
    ),
}
# solvers and their relative tolerances: a decade more would take minutes (choices)
_SOLVERS: dict[Extent, tuple[tuple[str, tuple[float, ...]], ...]] = {
    "quick": (("Radau", (1e-2,)),),
    "whole": (("Radau", (3e-2, 1e-2, 1e-3)), ("LSODA", (3e-2, 1e-2, 1e-3)), ("BDF", (1e-2,)), ("DOP853", (1e-2,))),
}
_STEPS: dict[Extent, tuple[int, ...]] = {"quick": (1,), "whole": (1, 2, 4, 10)}
_INTEGRATED, _MARCHED = 10, 20  # elements that ODE solvers are given, and the trapezoidal rule
_FINITE_100 = Who("finite elements", "elements 100, accuracy=1e-05")


def boom_time(extent: Extent) -> Scene:
    """Return the scene of the boom over time."""
    p = BoomParameters()
    time, wheels = track()
    true = cache(lambda: exact_motion(p, time, *_PAIRS[extent]))
    return Scene(
        key="boom-time",
        title=f"Motion of the boom's tips over {DURATION:g} s",
        question=f"From the boom's parameters and the motion of both actuators over {DURATION:g} s, {len(time)} samples,"
        " bumps with straight flanks, to the motion of both tips at every sample.",
        measure="Largest error of either tip at any sample over its largest motion, against the residues of the exact beam's"
        f" first {_PAIRS[extent][0]} pairs of poles in {_PAIRS[extent][1]} digits.",
        settings=(*_ours(p, time, wheels, extent), *_others(p, time, wheels, extent)),
        error=lambda found: float(np.abs(np.asarray(found) - true()).max() / np.abs(true()).max()),
        remarks=(
            "Ours takes as many modes as `accuracy` needs; the mesh and that accuracy are set together.",
            f"solve_ivp has {_INTEGRATED} elements, and steps of at most half a flank, so that it steps over none;"
            f" the trapezoidal rule has {_MARCHED} elements and sparse factors made once.",
        ),
        promises=(
            times_as_fast(_FINITE_100, Who("scipy.signal.lsim", "100 elements"), None, "cold"),
            exact(Who("high-order elements", "order 10, accuracy=1e-07"), 1e-6),
        ),
    )


def corners() -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return where each wheel's slope changes [s], and by how much [m/s], left and right."""
    starts = _FIRST + _EVERY * np.arange(_BUMPS)
    within = np.array([0.0, _RAMP, _RAMP + _TOP, 2 * _RAMP + _TOP])
    places = (starts[:, None] + within).ravel()
    slopes = np.tile(np.array([1.0, -1.0, -1.0, 1.0]) * _HEIGHT / _RAMP, _BUMPS)
    return (places, slopes), (places + _SHIFT, slopes)


def track() -> tuple[Array, Array]:
    """Return the samples [s], and the motion of both actuators there [m], shape (2, samples)."""
    time = np.arange(round(DURATION / _STEP) + 1) * _STEP
    wheels = [
        sum(slope * np.maximum(time - at, 0.0) for at, slope in zip(*corner, strict=True)) for corner in corners()
    ]
    return time, np.array(wheels)


def exact_motion(p: BoomParameters, time: Array, pairs: int, digits: int) -> Array:
    """Return the motion of both tips of the exact beam [m], shape (2, samples), by residues."""
    (left_at, slopes), (right_at, _) = corners()
    ramps = _ramp_responses(p, pairs, digits)
    found = np.zeros((2, len(time)))
    for at, own, other in ((left_at, 0, 1), (right_at, 1, 0)):
        for start, slope in zip(at, slopes, strict=True):
            since = time - start
            later = since > 0.5 * _STEP
            alike, opposite = (ramp(since[later]) for ramp in ramps)
            found[own, later] += slope * 0.5 * (alike + opposite)
            found[other, later] += slope * 0.5 * (alike - opposite)
    return found


def _ramp_responses(p: BoomParameters, pairs: int, digits: int) -> list[Callable[[Array], Array]]:
    """Return how the halves answer to a ramp: ``G(0) t + G'(0)`` and the residues of ``G(s)/s^2``.

    Raises
    ------
    RuntimeError
        An answer does not begin at zero: poles are missing.
    """
    starts = damped_poles(spray_boom(p, "high-order", 8, order=16).structure, pairs)
    poles = damped_eigenvalues(p, starts[-starts.real < _FAST], digits)
    with mp.workdps(digits):
        turns = [mp.expjpi(mp.mpf(2 * k + 1) / _CIRCLE) for k in range(_CIRCLE)]

        def around(at: complex, radius: float) -> list[list[Any]]:
            """Return the coefficients before ``(s - at)^-1``, ``1`` and ``(s - at)`` of both halves, by a circle."""
            values = [tip_transfer(p, mp.mpc(at) + radius * turn) for turn in turns]
            return [
                [
                    sum(value[parity] / (radius * turn) ** k for value, turn in zip(values, turns, strict=True))
                    / _CIRCLE
                    for k in (-1, 0, 1)
                ]
                for parity in (0, 1)
            ]

        at_rest = around(0.0, _RADIUS)
        about = [around(complex(pole), _RADIUS * abs(complex(pole))) for pole in poles]
        squares = [mp.mpc(complex(s)) ** 2 for s in poles]
        weights: tuple[Array, ...] = tuple(
            np.array([complex(2 * both[h][0] / square) for square, both in zip(squares, about, strict=True)])
            for h in (0, 1)
        )
        rest = [(float(found[1].real), float(found[2].real)) for found in at_rest]
    for (_, slope), weight in zip(rest, weights, strict=True):
        off = abs(slope + float(np.real(weight).sum()))
        if off > _BESIDE * np.abs(weight[-2:]).max():  # the last pair is of the other half
            raise RuntimeError(f"the exact response to a ramp begins at {off:.1e}, not at zero: poles are missing")

    def ramp(rest: tuple[float, float], weight: Array, t: Array) -> Array:
        return rest[0] * t + rest[1] + np.real(weight[:, None] * np.exp(np.outer(poles, t))).sum(axis=0)

    return [partial(ramp, *half) for half in zip(rest, weights, strict=True)]


def _ours(p: BoomParameters, time: Array, wheels: Array, extent: Extent) -> Iterator[Setting]:
    signals: dict[str, Array] = dict(zip(ACTUATORS, wheels, strict=True))

    def answer(accuracy: float, model: Any) -> Array:
        found = forced_response(model, signals, time, TIPS, accuracy=accuracy)
        return np.array([found[name] for name in TIPS])

    for kind, settings in _OURS[extent]:
        for size, accuracy in settings:
            call = f"bc.forced_response({{}}, wheels, time, tips, accuracy={accuracy:g})"
            label = f"{{}} {{}}, accuracy={accuracy:g}"
            yield our_mesh(p, kind, size, partial(answer, accuracy), call, label)


def _others(p: BoomParameters, time: Array, wheels: Array, extent: Extent) -> Iterator[Setting]:
    peer = partial(boom_peer, p)
    for n in MESHES[extent]:
        yield peer(
            "control.forced_response",
            f"{n} elements",
            n,
            control_boom,
            lambda system: np.asarray(control.forced_response(system, time, wheels).outputs),
        )
    for n in MESHES[extent]:
        yield peer(
            "scipy.signal.lsim",
            f"{n} elements",
            n,
            lambda boom: signal.StateSpace(*boom.statespace()),
            lambda system: signal.lsim(system, wheels.T, time)[1].T,
        )
    for method, tolerances in _SOLVERS[extent]:
        for tolerance in tolerances:
            yield peer(
                f"solve_ivp, {method}",
                f"rtol {tolerance:g}",
                _INTEGRATED,
                PlainBoom.statespace,
                partial(_integrated, time, wheels, method, tolerance),
            )
    for parts in _STEPS[extent]:
        yield peer(
            "SciPy sparse, trapezoidal rule",
            f"{1e3 * _STEP / parts:g} ms",
            _MARCHED,
            lambda boom: boom,
            partial(_marched, time, wheels, parts),
        )


def _integrated(time: Array, wheels: Array, method: str, tolerance: float, matrices: tuple[Array, ...]) -> Array:
    A, B, C, _ = matrices
    implicit: dict[str, Any] = {} if method == "DOP853" else {"jac": lambda t, x: A}
    found = solve_ivp(
        lambda t, x: A @ x + B @ np.array([np.interp(t, time, wheel) for wheel in wheels]),
        (0.0, time[-1]),
        np.zeros(len(A)),
        method,
        time,
        rtol=tolerance,
        atol=1e-4 * tolerance,
        max_step=0.5 * _RAMP,
        **implicit,
    )
    if not found.success:
        raise RuntimeError(found.message)
    return C @ found.y


def _marched(time: Array, wheels: Array, parts: int, boom: PlainBoom) -> Array:
    """Return the motion by the trapezoidal rule on ``M q' = v - C q + G d``, ``v' = -K q + F d``, one solve a step."""
    h = time[1] / parts
    fine = np.arange(parts * (len(time) - 1) + 1) * h
    d = np.array([np.interp(fine, time, wheel) for wheel in wheels])
    loads, rates = boom.F @ d, boom.G @ d
    factors = splu((boom.M + 0.5 * h * boom.C + 0.25 * h * h * boom.K).tocsc())
    back = (boom.M - 0.5 * h * boom.C - 0.25 * h * h * boom.K).tocsr()
    q, v = np.zeros(len(boom.F)), np.zeros(len(boom.F))
    found, tips = np.zeros((2, len(time))), [0, len(q) - 2]
    for k in range(1, len(fine)):
        force = 0.5 * h * (loads[:, k - 1] + loads[:, k])
        right = back @ q + h * v + 0.5 * h * (rates[:, k - 1] + rates[:, k]) + 0.5 * h * force
        following = factors.solve(right)
        v += force - 0.5 * h * (boom.K @ (q + following))
        q = following
        if k % parts == 0:
            found[:, k // parts] = q[tips]
    return found
