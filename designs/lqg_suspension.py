"""LQG suspension: separate controllers for the symmetric and the antisymmetric subsystem of the boom.

The regulator minimizes tip displacement, stroke and force. The Kalman filter models the platform motion as low-pass filtered
white noise, a force disturbance at the actuator, and the noise of stroke sensor and tip accelerometer.
"""

from dataclasses import dataclass

import boomctl as bc
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult, suspension_model

ORDER, OMEGA_RANGE = {"sym": 14, "anti": 12}, (0.0, 80.0)
SCALES = {"actuator": 0.03, "suspension": 150.0, "tip": 0.2, "stroke": 0.05, "tip_acceleration": 0.5}


@dataclass(frozen=True)
class Weights:
    """Weights of one subsystem, for signals divided by SCALES."""

    track: float  # corner frequency of the platform motion [rad/s]
    tip: float
    stroke: float
    effort: float
    stroke_noise: float
    acceleration_noise: float
    force_disturbance: float


WEIGHTS = {
    "sym": Weights(2.0, 1.0, 0.3, 3.0, 0.2, 10.0, 0.1),
    "anti": Weights(2.0, 1.0, 0.3, 3.0, 0.05, 10.0, 0.1),
}


def half_design(model, side):
    """Design the controller of a subsystem; return the synthesis result and the reduced plant."""
    w, scales = WEIGHTS[side], {f"{stem}_{side}": size for stem, size in SCALES.items()}
    push, tip = f"suspension_{side}", f"tip_{side}"
    stroke, acceleration = f"stroke_{side}", f"tip_acceleration_{side}"
    reduced = bc.reduce(bc.scale_signals(model, scales), order=ORDER[side], omega_range=OMEGA_RANGE)
    P = bc.generalized_plant(
        reduced.system,
        disturbances={f"actuator_{side}": bc.low_pass(1.0, w.track), push: w.force_disturbance},
        performance={tip: w.tip, stroke: w.stroke},
        measurements=[stroke, acceleration],
        controls=[push],
    )
    synthesis = bc.lqg(
        P,
        None,
        {push: w.effort**2},
        process_noise={f"w_actuator_{side}": 1.0, f"w_{push}": 1.0},
        measurement_noise={stroke: w.stroke_noise**2, acceleration: w.acceleration_noise**2},
        measurements=[stroke, acceleration],
        controls=[push],
        output_weight={f"z_{tip}": 1.0, f"z_{stroke}": 1.0},
    )
    return synthesis, reduced


def design() -> SuspensionDesign:
    """Design both controllers and join them into one for the machine."""
    model = suspension_model()
    controllers, facts = {}, {}
    for side, half in zip(("sym", "anti"), bc.split_symmetric(model), strict=True):
        synthesis, reduced = half_design(half, side)
        controllers[side] = synthesis.controller
        name = {"sym": "jolt", "anti": "yaw"}[side]
        facts[f"{name}: minimum cost"] = f"{synthesis.cost:.4g}, from the closed loop and from the Riccati equations"
        facts[f"{name}: proof in ball arithmetic"] = bc.prove(synthesis).claim
        share = reduced.error_norm / bc.sigma(reduced.full_system).peak
        facts[f"{name}: reduction"] = (
            f"to order {reduced.order}, error up to {OMEGA_RANGE[1]:g} rad/s at most {100 * share:.2g} % of its peak gain"
        )
    return SuspensionDesign(
        "lqg_suspension",
        "LQG suspension, symmetric and antisymmetric controllers",
        controller=bc.join_symmetric(model, controllers["sym"], controllers["anti"]),
        synthesis_info=facts,
    )


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
