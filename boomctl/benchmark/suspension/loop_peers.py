"""The benchmark's loop as python-control's users would simulate it."""

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.benchmark.suspension.loop_reference import LoopScene
from boomctl.boom.model import ACTUATORS, TIPS

if TYPE_CHECKING:
    import control


def continuous_loop(scene: LoopScene, method: str) -> Array:
    """Return the tips of the loop whose controller is continuous, integrated by ``input_output_response``."""
    return _responded(scene, scene.plant, scene.controller, {"solve_ivp_method": method})


def sampled_loop(scene: LoopScene) -> Array:
    """Return the tips of the loop whose plant and controller are both sampled, disturbances held in between."""
    step = float(scene.time[1] - scene.time[0])
    return _responded(scene, scene.plant.sample(step, "zoh"), scene.controller.sample(step, "bilinear"), {})


def _responded(
    scene: LoopScene, plant: "control.StateSpace", law: "control.StateSpace", options: dict[str, Any]
) -> Array:
    """Return the tips of plant, controller and force limit, interconnected."""
    import control

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
