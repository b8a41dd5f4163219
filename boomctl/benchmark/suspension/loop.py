"""Lines of the benchmark that race simulations: a sampled loop with limits, and the open loop on a fine mesh."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.benchmark.report import Row
from boomctl.benchmark.suspension.loop_peers import continuous_loop, sampled_loop
from boomctl.benchmark.suspension.loop_reference import LoopScene, continuous_reference, sampled_reference
from boomctl.benchmark.timing import Job, interleaved
from boomctl.boom import BoomParameters, spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.simulation import forced_response, simulate_loop
from boomctl.structure import SecondOrderModel
from boomctl.structure.response.poles import undamped_modes

if TYPE_CHECKING:
    import control

_LOOP = "Sampled loop with limits, 60 s at 1 kHz, 20 modes; each error is to the exact solution of the loop it solves"
_OPEN = "Open loop, 60 s at 1 kHz, actuators -> tips; peer: scipy.signal.lsim"
_DURATION, _STEP, _SPAN = 60.0, 1e-3, 2.0
_MODES, _LIMIT = 20, 0.25
_STROKES = ("stroke_left", "stroke_right")
_FORCES = ("suspension_left", "suspension_right")
_DEFAULT_TARGET, _BEST_TARGET, _OPEN_TARGET, _OPEN_ERROR = 50.0, 15.0, 50.0, 1e-6
_OTHERS = ("LSODA", "BDF", "Radau", "RK23", "DOP853")


def _rough_ground(time: Array) -> Array:
    """Return the motion of the two actuators [m]: sines from 0.1 to 5 Hz, equal in velocity, of fixed phases."""
    freq_hz = np.arange(0.1, 5.0, 0.1)
    phases = 2.0 * np.pi * np.modf(np.outer([0.618034, 0.414214], np.arange(1, len(freq_hz) + 1) ** 2))[0]
    lines = [(1.5e-3 / freq_hz) @ np.sin(2 * np.pi * np.outer(freq_hz, time) + phase[:, None]) for phase in phases]
    return np.array(lines) - np.array(lines)[:, :1]


def loop_scene(duration: float = _DURATION) -> LoopScene:
    """Return the loop that is raced: the boom's lowest 20 modes, springs and dampers on its strokes, 0.25 N at most."""
    import control

    model = spray_boom(BoomParameters(), elements=20)
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


def loop_lines(rounds: int = 3, tell: Callable[[str], None] = lambda text: None) -> list[Row]:
    """Race ``simulate_loop`` against ``input_output_response`` and ``forced_response`` against ``scipy.signal.lsim``.

    python-control's integrators know no samples: they solve the loop with a continuous controller, and the error of each
    is to the exact solution of the loop that it solves.  Sampled beforehand, the loop is ours but for the disturbance,
    which is then held: its error is to our loop's exact solution.
    """
    return [*_loop_rows(rounds, tell), _open_row(rounds, tell)]


def _loop_rows(rounds: int, tell: Callable[[str], None]) -> list[Row]:
    scene = loop_scene()
    short = scene.until(round(_SPAN / _STEP) + 1)
    answers: dict[str, Array] = {}

    def integrated(method: str) -> Callable[[object], None]:
        return lambda _: answers.update({method: continuous_loop(short, method)})

    jobs = {
        "ours": Job(lambda _: answers.update({"ours": _ours(scene)})),
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
        peer_error, peer_time = _distance(answers[method], true), times[method] * _DURATION / _SPAN
        met = None if target is None else peer_time >= target * times["ours"] and error <= peer_error
        wanted = "" if target is None else f">= {target:g}x, error"
        rows.append(Row(_LOOP, f"control ({what}; {timed})", times["ours"], peer_time, wanted, error, peer_error, met))
    return rows


def _ours(scene: LoopScene) -> Array:
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


def _open_row(rounds: int, tell: Callable[[str], None], elements: int = 100) -> Row:
    """Race the open loop; the reference is the response of all modes of the mesh, none left out."""
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
    true = forced_response(fresh(), dict(zip(ACTUATORS, W, strict=True)), time, accuracy=1e-13)
    reference = np.array([true[name] for name in TIPS])
    error, peer_error = (_distance(answers[name], reference) for name in ("ours", "lsim"))
    met = times["lsim"] >= _OPEN_TARGET * times["ours"] and error <= _OPEN_ERROR
    job = f"lsim: {elements} elements"
    target = f">= {_OPEN_TARGET:g}x, {_OPEN_ERROR:.0e}"
    return Row(_OPEN, job, times["ours"], times["lsim"], target, error, peer_error, met)
