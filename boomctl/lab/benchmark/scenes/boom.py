"""Scenes of the spray boom: singular values, their peak, motion over time, reduction."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy import signal

from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.high_precision import exact_response, peak_in_many_digits, sigma_of
from boomctl.lab.benchmark.plain_boom import (
    PlainBoom,
    banded_sigma,
    control_boom,
    control_sigma,
    lsim,
    pymor_norm,
    varied,
)
from boomctl.lab.benchmark.scene import Scene, Setting, relative_error, settings, sized
from boomctl.lti.python_control import control
from boomctl.reduction.reduce import reduce
from boomctl.simulation.forced_response import forced_response
from boomctl.structure.model import SecondOrderModel

_FINITE, _DEGREES = (6, 10, 20, 50, 100, 190), (3, 4, 6, 8, 10, 12)  # elements, of others but the last; orders
_OMEGA = 2 * np.pi * np.geomspace(0.1, 10.0, 500)
_DURATION, _DT = 60.0, 0.01  # s, of the bumps and between samples
_BEGIN, _EVERY, _SHIFT, _BUMPS = 1.0, 6.0, 2.0, 5  # s: first and next bump of the left wheel, delay of the right one
_EDGES, _HEIGHT = np.array([0.0, 0.5, 1.5, 2.0]), 0.1  # s, m: corners of a bump, and its height
_EQUAL = 1e-8  # Error of the reference, below which errors count as equal.
_REDUCED = 100  # elements of the boom that is reduced
_MESHES, _DEGREE = (20, 50, 100), 10  # elements at which run times are compared, and order of the models reduced there
_PLAIN = "Other programs are given the same cubic elements by a plain NumPy code, which is timed with them."

_Solve = Callable[[Any], Any]


def _ours(
    solve: _Solve,
    call: str,
    finite: tuple[int, ...] = _FINITE,
    orders: tuple[int, ...] = _DEGREES,
    verified: bool = False,
) -> Iterator[Setting]:
    """Yield the settings of this package's meshes; ``solve`` takes the model to the answer, ``call`` is its code."""
    kind: dict[str, Any] = {"verified": verified, "ours": True}
    calls = [
        call.replace("model", f"bc.spray_boom(p, {mesh})") for mesh in ("elements={}", '"high-order", 4, order={}')
    ]

    def elements(n: int, p: BoomParameters, change: float) -> Any:
        return solve(spray_boom(varied(p, change), elements=n))

    def order(n: int, p: BoomParameters, change: float) -> Any:
        return solve(spray_boom(varied(p, change), "high-order", 4, order=n))

    yield from settings("finite elements", "{} elements", finite, elements, call=calls[0], **kind)
    yield from settings("high-order elements", "order {}", orders, order, call=calls[1], **kind)


def _others(method: str, sizes: tuple[int, ...], solve: _Solve, *modules: str) -> Iterator[Setting]:
    """Yield the settings of another program; ``solve`` takes the plain boom to the answer."""

    def elements(n: int, p: BoomParameters, change: float) -> Any:
        return solve(PlainBoom.of(p, n, change))

    return settings(method, "{} elements", sizes, elements, modules=modules)


def boom_sigma() -> Scene:
    """Return the scene of singular values."""

    def chosen(accuracy: float, p: BoomParameters, change: float) -> Array:
        return sigma(spray_boom(varied(p, change), accuracy=accuracy, max_frequency_hz=10.0), _OMEGA).sigma

    def exact(p: BoomParameters, change: float) -> Array:
        return sigma(exact_frequency_response(varied(p, change), _OMEGA, ACTUATORS, TIPS)).sigma

    by_accuracy = "bc.sigma(bc.spray_boom(p, accuracy={:g}, max_frequency_hz=10), omega)"
    of_exact = "bc.sigma(bc.exact_frequency_response(p, omega, actuators, tips))"
    return Scene(
        title="Singular values of the boom",
        question="From the boom's parameters to the singular values, actuators to tips, at 500 frequencies, 0.1 to 10 Hz.",
        measure="Largest relative error of a singular value, against the exact beam in 50 digits.",
        problem=BoomParameters,
        reference=lambda p: sigma_of(exact_response(p, _OMEGA)[:2, :2]),
        error=lambda p, true, answer: float(np.abs(np.asarray(answer) / true - 1.0).max()),
        methods=(
            *_ours(lambda model: sigma(model, _OMEGA).sigma, "bc.sigma(model, omega)", orders=_DEGREES[1:]),
            *settings("accuracy=", "{:g}", (1e-2, 1e-3, 1e-6), chosen, ours=True, call=by_accuracy),
            *settings("exact beam", "no mesh", [()], exact, ours=True, call=of_exact),
            *_others("python-control", _FINITE[:-1], lambda boom: control_sigma(control_boom(boom), _OMEGA)),
            *_others("SciPy, banded solver", (*_FINITE[:-1], 200, 500), lambda boom: banded_sigma(boom, _OMEGA)),
            *sized(
                _ours(lambda model: sigma(model, _OMEGA).sigma, "", _MESHES, ()),
                _others("python-control", _MESHES, lambda boom: control_sigma(control_boom(boom), _OMEGA)),
            ),
        ),
        remarks=(_PLAIN,),
    )


def boom_peak() -> Scene:
    """Return the scene of the largest singular value."""

    def peak(model: SecondOrderModel) -> float:
        result = hinf_norm(model.between())
        if not result.verified:
            raise RuntimeError(f"not certified: {result.method}")
        return result.value

    def by_control(boom: PlainBoom) -> float:
        return float(control.linfnorm(control_boom(boom))[0])

    return Scene(
        title="Largest singular value of the boom",
        question="From the boom's parameters to the H-infinity norm, actuators to tips.",
        measure="Relative error, against the exact beam in 50 digits.",
        problem=BoomParameters,
        reference=peak_in_many_digits,
        error=lambda p, true, answer: abs(answer / true - 1.0),
        methods=(
            *_ours(peak, "bc.hinf_norm(model.between()).value", verified=True),
            *_others("control.linfnorm", _FINITE[:-1], by_control, "slycot"),
            *_others("pyMOR, hinf_norm", _FINITE[:4], pymor_norm, "pymor", "slycot"),
            *sized(_ours(peak, "", _MESHES, ()), _others("control.linfnorm", _MESHES, by_control, "slycot")),
        ),
        remarks=(_PLAIN, "Ours proves that no frequency has a larger singular value; the others do not."),
    )


def wheels() -> tuple[Array, Array]:
    """Return samples [s] and the motion of both actuators [m] over bumps with straight flanks, shape (2, samples)."""
    time = np.arange(round(_DURATION / _DT) + 1) * _DT
    corners = (_BEGIN + _EVERY * np.arange(_BUMPS)[:, None] + _EDGES).ravel()
    heights = np.tile([0.0, _HEIGHT, _HEIGHT, 0.0], _BUMPS)
    return time, np.array([np.interp(time, corners + shift, heights) for shift in (0.0, _SHIFT)])


def exact_motion(p: BoomParameters, time: Array, motion: Array) -> Array:
    """Return the motion of both tips [m] by SciPy on a fine mesh, exact for inputs that are straight between samples."""
    system = spray_boom(p, "high-order", 8, order=8).to_statespace(ACTUATORS, TIPS)
    return signal.lsim((system.A, system.B, system.C, system.D), motion.T, time)[1].T


def boom_time() -> Scene:
    """Return the scene of motion over time."""
    time, motion = wheels()

    def ours(accuracy: float) -> _Solve:
        def solve(model: SecondOrderModel) -> Array:
            result = forced_response(model, time, dict(zip(ACTUATORS, motion, strict=True)), TIPS, rtol=accuracy)
            return np.array([result[name] for name in TIPS])

        return solve

    def by_control(boom: PlainBoom) -> Array:
        return np.asarray(control.forced_response(control_boom(boom), time, motion).outputs)

    call = "bc.forced_response(model, time, motion, tips"
    sizes: tuple[tuple[float, tuple[int, ...], tuple[int, ...]], ...]
    sizes = ((1e-2, (6,), (4,)), (1e-3, (20,), (6,)), (1e-4, (50,), ()), (1e-6, (100, 190), (8,)), (1e-8, (), (10, 12)))
    return Scene(
        title="Forced response of the boom's tips, 60 s",
        question="From the boom's parameters and 6,001 samples of the actuators' motion over bumps to that of both tips.",
        measure=f"Largest error over the largest motion, against 8 high-order elements; at least {_EQUAL:g}.",
        problem=BoomParameters,
        reference=lambda p: exact_motion(p, time, motion),
        error=relative_error(_EQUAL),
        methods=(
            *(s for rtol, n, k in sizes for s in _ours(ours(rtol), f"{call}, rtol={rtol:g})", n, k)),
            *_others("control.forced_response", _FINITE[:-1], by_control),
            *_others("scipy.signal.lsim", _FINITE[:-1], lambda boom: lsim(boom, time, motion)),
            *sized(
                _ours(ours(1e-4), "", _MESHES, ()),
                _others("scipy.signal.lsim", _MESHES, lambda boom: lsim(boom, time, motion)),
            ),
        ),
        remarks=(_PLAIN, "Mesh and accuracy of ours are set together: a fine mesh is given a tight accuracy."),
    )


def boom_reduction() -> Scene:
    """Return the scene of reduction."""

    def full(p: BoomParameters, change: float, elements: int = _REDUCED) -> SecondOrderModel:
        return spray_boom(varied(p, change), elements=elements).select(ACTUATORS, TIPS)

    def ours(elements: int, order: int, p: BoomParameters, change: float) -> Any:
        return reduce(full(p, change, elements), order).system

    def theirs(elements: int, order: int, p: BoomParameters, change: float) -> control.StateSpace:
        return control.balred(full(p, change, elements).to_statespace(), order)

    call = "bc.reduce(bc.spray_boom(p, elements={}).select(actuators, tips), {})"
    orders = [(_REDUCED, order) for order in (4, 6, 8, 10, 14, 20, 30)]
    meshes = [(elements, _DEGREE) for elements in _MESHES]
    return Scene(
        title=f"Reduction of a boom of {_REDUCED} elements",
        question=f"From the boom's parameters, by {_REDUCED} finite elements, to a small system, actuators to tips.",
        measure="Largest singular value of the difference over that of the full model, resonances to 100 Hz included.",
        problem=BoomParameters,
        reference=lambda p: resonance_grid(full(p, 0.0)),
        error=lambda p, true, answer: difference(answer, *true),
        methods=(
            *settings("reduce, balanced", "order {1}", orders, ours, verified=True, ours=True, call=call),
            *settings("control.balred", "order {1}", orders, theirs, modules=("slycot",)),
            *sized(
                settings("reduce, balanced", "{} elements", meshes, ours, verified=True, ours=True),
                settings("control.balred", "{} elements", meshes, theirs, modules=("slycot",)),
            ),
        ),
        remarks=("Others are given the dense first-order matrices of our model, which are timed with them.",),
    )


def resonance_grid(model: SecondOrderModel) -> tuple[Array, Array]:
    """Return frequencies [rad/s] that contain the resonances below 100 Hz, and the response there."""
    poles = model.to_statespace().poles()
    poles = poles[(poles.imag > 0.0) & (poles.imag < 200.0 * np.pi)]
    near = poles.imag[:, None] + np.abs(poles.real)[:, None] * np.linspace(-3.0, 3.0, 13)
    omega = np.union1d(2 * np.pi * np.geomspace(0.01, 100.0, 2000), near[near > 0.0])
    return omega, np.moveaxis(np.asarray(model.frequency_response(omega).frdata), 2, 0)


def difference(reduced: Any, omega: Array, response: Array) -> float:
    """Return the largest singular value of the difference from a response, over that of the response."""
    result = np.moveaxis(np.asarray(control.frequency_response(control.ss(reduced), omega).frdata), 2, 0)
    return float(np.linalg.norm(result - response, 2, (1, 2)).max() / np.linalg.norm(response, 2, (1, 2)).max())
