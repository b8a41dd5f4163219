"""A loop around the boom with force limits: solved by us, in ways that share nothing with that, and as others would."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import integrate

from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lti.python_control import control
from boomctl.simulation.loop import simulate_loop
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import undamped_modes

_STEP = 1e-3  # of the samples [s]
_MODES = 20  # of the plant: a size at which python-control's loops end within minutes
_LIMIT = 0.25  # of the forces [N]: so small that they meet it
_STROKES = ("stroke_left", "stroke_right")
_FORCES = ("suspension_left", "suspension_right")
_TERMS = 22  # of the series of exp(X) with |X| <= 1/8: what follows is below 1e-40


@dataclass(frozen=True)
class LoopScene:
    """A plant, a controller and signals, shared by all who simulate them.

    ``driven`` and ``measured`` are the places of the controls among the plant's inputs and of the measurements among
    its outputs, ``read`` those of the outputs compared; ``W`` are all inputs at all times.
    """

    plant: control.StateSpace
    controller: control.StateSpace
    time: Array
    W: Array
    limit: float
    driven: Array
    measured: Array
    read: Array

    def until(self, points: int) -> "LoopScene":
        """Return the beginning of the scene."""
        return replace(self, time=self.time[:points], W=self.W[:, :points])


def _rough_ground(time: Array) -> Array:
    """Return the motion of the two actuators [m]: sines from 0.1 to 5 Hz, equal in velocity, of fixed phases."""
    freq_hz = np.arange(0.1, 5.0, 0.1)
    phases = 2.0 * np.pi * np.modf(np.outer([0.618034, 0.414214], np.arange(1, len(freq_hz) + 1) ** 2))[0]
    lines = [(1.5e-3 / freq_hz) @ np.sin(2 * np.pi * np.outer(freq_hz, time) + phase[:, None]) for phase in phases]
    return np.array(lines) - np.array(lines)[:, :1]


def loop_scene(duration: float, parameters: BoomParameters | None = None) -> LoopScene:
    """Return the loop that is raced: the boom's lowest 20 modes, springs and dampers on its strokes, 0.25 N at most."""
    model = spray_boom(BoomParameters() if parameters is None else parameters, elements=20)
    _, shapes = undamped_modes(model.structure, _MODES)
    labels = tuple(f"mode{k}" for k in range(_MODES))
    plant = SecondOrderModel.of(
        model.structure.projected(shapes, labels), model.ports.congruent(shapes)
    ).to_statespace()
    corner, stiffness = 60.0, 300.0
    eye = np.eye(2)
    law = control.ss(
        -corner * eye, corner * eye, stiffness * eye, -stiffness * eye, inputs=list(_STROKES), outputs=list(_FORCES)
    )
    time = np.linspace(0.0, duration, round(duration / _STEP) + 1)
    W = np.zeros((plant.ninputs, len(time)))
    W[[plant.input_labels.index(name) for name in ACTUATORS]] = _rough_ground(time)
    places = [
        np.array([labels.index(name) for name in names])
        for labels, names in (
            (plant.input_labels, _FORCES),
            (plant.output_labels, _STROKES),
            (plant.output_labels, TIPS),
        )
    ]
    return LoopScene(plant, law, time, W, _LIMIT, *places)


def ours_of(scene: LoopScene) -> Array:
    """Return the tips in a loop, by ``simulate_loop``."""
    disturbance = {name: scene.W[scene.plant.input_labels.index(name)] for name in ACTUATORS}
    found = simulate_loop(
        scene.plant,
        scene.controller,
        disturbance,
        scene.time,
        sample_time=_STEP,
        force_limit=scene.limit,
        anti_windup=False,  # the peers have none
    )
    return np.array([found[name] for name in TIPS])


def extended_maps(A: Array, B: Array, h: float) -> tuple[Array, Array, Array]:
    """Return ``exp(A h)``, ``int exp(A s) ds B`` and ``int exp(A (h - s)) s ds B / h`` in extended precision."""
    n, m = B.shape
    big = np.zeros((n + 2 * m, n + 2 * m), dtype=np.longdouble)
    big[:n, :n], big[:n, n : n + m] = A * np.longdouble(h), B * np.longdouble(h)
    big[n : n + m, n + m :] = np.eye(m)
    halvings = max(0, int(np.ceil(np.log2(float(np.abs(big).sum(axis=1).max())))) + 3)
    small = big / np.longdouble(2.0) ** halvings
    total = np.eye(len(big), dtype=np.longdouble)
    term = total.copy()
    for k in range(1, _TERMS):
        term = term @ small / np.longdouble(k)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total[:n, :n], total[:n, n : n + m], total[:n, n + m :]


def _sampled(scene: LoopScene, x: Array, advance: Callable[[int, Array, Array], Array]) -> Array:
    """Return the outputs of the loop whose controller samples at each time, from states ``x`` of the plant.

    ``advance`` takes the place of a time, the states there and the controls from there on to the states at the next.
    """
    P, K = scene.plant, scene.controller.sample(_step(scene), method="bilinear")
    state = np.zeros(K.nstates, dtype=x.dtype)
    y = np.empty((len(scene.read), len(scene.time)))
    for k in range(len(scene.time)):
        everything = P.C @ x + P.D @ scene.W[:, k]
        y[:, k] = everything[scene.read].astype(float)
        heard = everything[scene.measured]
        u = np.clip(K.C @ state + K.D @ heard, -scene.limit, scene.limit)
        state = K.A @ state + K.B @ heard
        if k < len(scene.time) - 1:
            x = advance(k, x, u)
    return y


def _step(scene: LoopScene) -> float:
    return float(scene.time[-1] - scene.time[0]) / (len(scene.time) - 1)


def sampled_reference(scene: LoopScene) -> Array:
    """Return the outputs of the loop whose discrete controller samples at each time, in extended precision."""
    P = scene.plant
    Phi, held, ramp = extended_maps(P.A, P.B, _step(scene))
    forcing = held @ scene.W[:, :-1] + ramp @ np.diff(scene.W, axis=1)
    driven = held[:, scene.driven]
    rest = np.zeros(P.nstates, dtype=np.longdouble)
    return _sampled(scene, rest, lambda k, x, u: Phi @ x + driven @ u + forcing[:, k])


def continuous_reference(scene: LoopScene, tolerance: float = 1e-11) -> Array:
    """Return the outputs of the loop whose controller is continuous, integrated from sample to sample."""
    P, K = scene.plant, scene.controller
    n, h = P.nstates, _step(scene)
    slopes = np.diff(scene.W, axis=1) / h
    Bu = P.B[:, scene.driven]
    z = np.zeros(n + K.nstates)
    y = np.empty((len(scene.read), len(scene.time)))
    for k in range(len(scene.time)):
        start, slope = scene.W[:, k], slopes[:, min(k, len(slopes.T) - 1)]
        y[:, k] = P.C[scene.read] @ z[:n] + P.D[scene.read] @ start

        def rate(t: float, z: Array, start: Array = start, slope: Array = slope) -> Array:
            w = start + slope * t
            heard = P.C[scene.measured] @ z[:n] + P.D[scene.measured] @ w
            u = np.clip(K.C @ z[n:] + K.D @ heard, -scene.limit, scene.limit)
            return np.concatenate([P.A @ z[:n] + P.B @ w + Bu @ u, K.A @ z[n:] + K.B @ heard])

        if k < len(scene.time) - 1:
            z = integrate.solve_ivp(rate, (0.0, h), z, "DOP853", rtol=tolerance, atol=1e-14).y[:, -1]
    return y


def restarted_loop(scene: LoopScene, method: str, tolerance: float) -> Array:
    """Return the outputs of the loop whose controller samples at each time, by ``solve_ivp``, restarted at each sample."""
    P, h = scene.plant, _step(scene)

    def advance(k: int, x: Array, u: Array) -> Array:
        start, pushed = scene.W[:, k], P.B[:, scene.driven] @ u
        slope = (scene.W[:, k + 1] - start) / h

        def rate(t: float, x: Array) -> Array:
            return P.A @ x + P.B @ (start + slope * t) + pushed

        return integrate.solve_ivp(rate, (0.0, h), x, method, rtol=tolerance, atol=1e-3 * tolerance).y[:, -1]

    return _sampled(scene, np.zeros(P.nstates), advance)


def continuous_loop(scene: LoopScene, method: str, tolerance: float) -> Array:
    """Return the tips of the loop whose controller is continuous, integrated by ``input_output_response``."""
    options = {"solve_ivp_method": method, "solve_ivp_kwargs": {"rtol": tolerance, "atol": 1e-3 * tolerance}}
    return _responded(scene, scene.plant, scene.controller, options)


def sampled_loop(scene: LoopScene) -> Array:
    """Return the tips of the loop whose plant and controller are both sampled, disturbances held in between."""
    step = _step(scene)
    return _responded(scene, scene.plant.sample(step, "zoh"), scene.controller.sample(step, "bilinear"), {})


def _responded(scene: LoopScene, plant: control.StateSpace, law: control.StateSpace, options: dict[str, Any]) -> Array:
    """Return the tips of plant, controller and force limit, interconnected."""
    inputs, outputs = list(scene.plant.input_labels), list(scene.plant.output_labels)
    driven, measured = [inputs[i] for i in scene.driven], [outputs[i] for i in scene.measured]
    asked = [f"asked_{name}" for name in driven]
    law = control.ss(law.A, law.B, law.C, law.D, plant.dt, inputs=measured, outputs=asked, name="law")
    plant = control.ss(plant.A, plant.B, plant.C, plant.D, plant.dt, inputs=inputs, outputs=outputs, name="plant")

    def clipped(t: float, x: Array, u: Array, params: dict[str, Any]) -> Array:
        return np.clip(u, -scene.limit, scene.limit)

    limits = control.nlsys(None, clipped, inputs=asked, outputs=driven, dt=plant.dt, name="limits")
    ends: dict[str, Any] = {
        "inplist": list(ACTUATORS),
        "inputs": list(ACTUATORS),
        "outlist": list(TIPS),
        "outputs": list(TIPS),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # outputs that no one reads
        loop = control.interconnect([plant, law, limits], **ends)
    rows = scene.W[[inputs.index(name) for name in ACTUATORS]]
    return np.asarray(control.input_output_response(loop, scene.time, rows, **options).outputs)
