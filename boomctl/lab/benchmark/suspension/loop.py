"""Lines of the benchmark that race simulations: a sampled loop with limits, and the open loop on a fine mesh.

The loops are also solved in ways that share nothing with the simulation, and as python-control's users would solve them.
"""

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
from boomctl.lab.benchmark.report import Measured, Row, Tell, race
from boomctl.lab.benchmark.timing import Job, interleaved
from boomctl.lti.python_control import control
from boomctl.simulation.forced_response import forced_response
from boomctl.simulation.loop import simulate_loop
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import undamped_modes

_LOOP = "Sampled loop with limits, 60 s at 1 kHz, 20 modes; each error is to the exact solution of the loop it solves"
_OPEN = "Open loop, 60 s at 1 kHz, actuators -> tips; peer: scipy.signal.lsim"
_DURATION, _STEP = 60.0, 1e-3  # of a run, and of its samples [s]
_SPAN = 2.0  # on which python-control's integrators are timed [s]: the whole run would take them minutes
_MODES = 20  # of the plant: a size at which python-control's loops end within minutes
_LIMIT = 0.25  # of the forces [N]: so small that they meet it
_STROKES = ("stroke_left", "stroke_right")
_FORCES = ("suspension_left", "suspension_right")
_DEFAULT_TARGET, _BEST_TARGET, _OPEN_TARGET = 50.0, 15.0, 50.0  # ratios that this package promised itself
_OPEN_TRUE = 1e-10  # of its reference
_OPEN_ERROR = 1e-6  # of the open loop, with which ours is run
_TERMS = 22  # of the series of exp(X) with |X| <= 1/8: what follows is below 1e-40
_OTHERS = ("LSODA", "BDF", "Radau", "RK23", "DOP853")


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


def loop_scene(duration: float = _DURATION, parameters: BoomParameters | None = None) -> LoopScene:
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


def loop_lines(rounds: int, tell: Tell) -> list[Row]:
    """Race ``simulate_loop`` against ``input_output_response`` and ``forced_response`` against ``scipy.signal.lsim``.

    python-control's integrators know no samples: they solve the loop with a continuous controller, and the error of each
    is to the exact solution of the loop that it solves.  Sampled beforehand, the loop is ours but for the disturbance,
    which is then held: its error is to our loop's exact solution.
    """
    return [*_loop_rows(rounds, tell), _open_row(rounds, tell)]


def _loop_rows(rounds: int, tell: Tell) -> list[Row]:
    scene = loop_scene()
    short = scene.until(round(_SPAN / _STEP) + 1)
    answers: dict[str, Array] = {}

    def integrated(method: str) -> Callable[[object], None]:
        return lambda _: answers.update({method: continuous_loop(short, method)})

    jobs = {
        "ours": Job(lambda _: answers.update({"ours": ours_of(scene)})),
        **{method: Job(integrated(method)) for method in ("RK45", *_OTHERS)},
        "sampled": Job(lambda _: answers.update({"sampled": sampled_loop(short)})),
    }
    tell("sampled loop beside control.input_output_response")
    times = interleaved(jobs, rounds)
    tell("references of the loops")
    sampled, continuous = sampled_reference(scene), continuous_reference(short)
    error = _distance(answers["ours"], sampled)
    best = min(_OTHERS, key=lambda method: times[method])
    timed = f"timed on {_SPAN:g} s, x {_DURATION / _SPAN:g}"
    rows = []
    for method, what, target, true in (
        ("RK45", "default, RK45", _DEFAULT_TARGET, continuous),
        (best, f"its fastest other, {best}", _BEST_TARGET, continuous),
        ("sampled", "plant sampled beforehand, disturbance held", None, sampled[:, : len(short.time)]),
    ):
        theirs = Measured(times[method] * _DURATION / _SPAN, _distance(answers[method], true))
        met = None if target is None else theirs.seconds >= target * times["ours"] and error <= theirs.error
        wanted = "" if target is None else f">= {target:g}x, error"
        rows.append(race(_LOOP, f"control ({what}; {timed})", Measured(times["ours"], error), theirs, wanted, met))
    return rows


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


def _distance(found: Array, true: Array) -> float:
    return float(np.abs(found - true).max() / np.abs(true).max())


def _open_row(rounds: int, tell: Tell, elements: int = 100) -> Row:
    """Race the open loop; the reference leaves out no more than 1e-10: with all modes, the highest add rounding of 5e-7."""
    from scipy import signal

    tell(f"open loop of {elements} elements beside scipy.signal.lsim")
    time = np.linspace(0.0, _DURATION, round(_DURATION / _STEP) + 1)
    W = _rough_ground(time)

    def fresh() -> SecondOrderModel:
        return spray_boom(BoomParameters(), elements=elements).select(ACTUATORS, TIPS)

    system: control.StateSpace = fresh().to_statespace()
    matrices = (system.A, system.B, system.C, system.D)
    answers: dict[str, Array] = {}

    def ours(model: SecondOrderModel) -> None:
        found = forced_response(model, dict(zip(ACTUATORS, W, strict=True)), time, accuracy=_OPEN_ERROR)
        answers["ours"] = np.array([found[name] for name in TIPS])

    jobs = {
        "ours": Job(ours, fresh),
        "lsim": Job(lambda _: answers.update({"lsim": signal.lsim(matrices, W.T, time)[1].T})),
    }
    times = interleaved(jobs, rounds)
    true = forced_response(fresh(), dict(zip(ACTUATORS, W, strict=True)), time, accuracy=_OPEN_TRUE)
    reference = np.array([true[name] for name in TIPS])
    error, peer_error = (_distance(answers[name], reference) for name in ("ours", "lsim"))
    met = times["lsim"] >= _OPEN_TARGET * times["ours"] and error <= _OPEN_ERROR
    job = f"lsim: {elements} elements"
    target = f">= {_OPEN_TARGET:g}x, {_OPEN_ERROR:.0e}"
    return race(_OPEN, job, Measured(times["ours"], error), Measured(times["lsim"], peer_error), target, met)


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


def sampled_reference(scene: LoopScene) -> Array:
    """Return the outputs of the loop whose discrete controller samples at each time, in extended precision."""
    P, K = scene.plant, scene.controller
    h = float(scene.time[-1] - scene.time[0]) / (len(scene.time) - 1)
    Phi, held, ramp = extended_maps(P.A, P.B, h)
    found = K.sample(h, method="bilinear")
    x, state = np.zeros(P.nstates, dtype=np.longdouble), np.zeros(K.nstates, dtype=np.longdouble)
    forcing = held @ scene.W[:, :-1] + ramp @ np.diff(scene.W, axis=1)
    y = np.empty((len(scene.read), len(scene.time)))
    for k in range(len(scene.time)):
        everything = P.C @ x + P.D @ scene.W[:, k]
        y[:, k] = everything[scene.read].astype(float)
        heard = everything[scene.measured]
        u = np.clip(found.C @ state + found.D @ heard, -scene.limit, scene.limit)
        state = found.A @ state + found.B @ heard
        if k < len(scene.time) - 1:
            x = Phi @ x + held[:, scene.driven] @ u + forcing[:, k]
    return y


def continuous_reference(scene: LoopScene, tolerance: float = 1e-11) -> Array:
    """Return the outputs of the loop whose controller is continuous, integrated from sample to sample."""
    P, K = scene.plant, scene.controller
    n, h = P.nstates, float(scene.time[1] - scene.time[0])
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
    P = scene.plant
    h = float(scene.time[1] - scene.time[0])
    K = scene.controller.sample(h, method="bilinear")
    x, state = np.zeros(P.nstates), np.zeros(K.nstates)
    y = np.empty((len(scene.read), len(scene.time)))
    for k in range(len(scene.time)):
        start = scene.W[:, k]
        everything = P.C @ x + P.D @ start
        y[:, k] = everything[scene.read]
        heard = everything[scene.measured]
        u = np.clip(K.C @ state + K.D @ heard, -scene.limit, scene.limit)
        state = K.A @ state + K.B @ heard
        if k == len(scene.time) - 1:
            break
        slope, pushed = (scene.W[:, k + 1] - start) / h, P.B[:, scene.driven] @ u

        def rate(t: float, x: Array, start: Array = start, slope: Array = slope, pushed: Array = pushed) -> Array:
            return P.A @ x + P.B @ (start + slope * t) + pushed

        x = integrate.solve_ivp(rate, (0.0, h), x, method, rtol=tolerance, atol=1e-3 * tolerance).y[:, -1]
    return y


def continuous_loop(scene: LoopScene, method: str, tolerance: float | None = None) -> Array:
    """Return the tips of the loop whose controller is continuous, integrated by ``input_output_response``.

    Without a tolerance it has its own, 1e-3.
    """
    options: dict[str, Any] = {"solve_ivp_method": method}
    if tolerance is not None:
        options["solve_ivp_kwargs"] = {"rtol": tolerance, "atol": 1e-3 * tolerance}
    return _responded(scene, scene.plant, scene.controller, options)


def sampled_loop(scene: LoopScene) -> Array:
    """Return the tips of the loop whose plant and controller are both sampled, disturbances held in between."""
    step = float(scene.time[1] - scene.time[0])
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
