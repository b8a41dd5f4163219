"""H-infinity suspension: separate controllers for the symmetric and the antisymmetric subsystem of the boom.

Each subsystem has one disturbance (platform motion with a shaping filter), one control and two sensors. A force disturbance
at the control prevents controllers that cancel the spring stiffness. The effort weight increases above a few rad/s, so that
the controller does not act on the bending modes, whose frequencies depend on the uncertain mass.
"""

from dataclasses import dataclass
from math import sqrt

import control

import boomctl as bc
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult, suspension_model

MEASURED, ORDER, OMEGA_RANGE = ("stroke", "tip_acceleration"), {"sym": 14, "anti": 12}, (0.0, 80.0)
HALVES = {"sym": "jolt", "anti": "yaw"}
SCALES = {"actuator": 0.03, "suspension": 150.0, "tip": 0.2, "stroke": 0.05, "tip_acceleration": 0.5}


@dataclass(frozen=True)
class Weights:
    """Weights of one subsystem, for signals divided by SCALES."""

    track: float  # corner frequency of the platform motion [rad/s]
    tip: float
    stroke: float
    effort: float
    roll_off: float  # frequency above which the effort weight increases [rad/s]
    stroke_noise: float
    acceleration_noise: float = 3.0
    force_disturbance: float = 0.05


WEIGHTS = {
    "sym": Weights(track=1.0, tip=3.0, stroke=1.0, effort=1.0, roll_off=3.0, stroke_noise=0.2),
    "anti": Weights(track=2.0, tip=1.0, stroke=2.0, effort=2.0, roll_off=5.0, stroke_noise=0.02),
}
FASTEST = 300.0  # frequency above which the effort weight is constant again [rad/s]


def effort_weight(w: Weights) -> control.StateSpace:
    """Return the effort weight: constant at low frequency, then increasing with the square of the frequency."""
    return bc.shelf(w.effort, w.effort * (FASTEST / w.roll_off) ** 2, sqrt(FASTEST * w.roll_off), order=2)


def half_design(model, side):
    """Design the controller of a subsystem; return the results of synthesis and reduction."""
    w, scales = WEIGHTS[side], {f"{stem}_{side}": size for stem, size in SCALES.items()}
    push, tip, stroke, acceleration = (f"{stem}_{side}" for stem in ("suspension", "tip", *MEASURED))
    reduced = bc.reduce(bc.scale_signals(model, scales), order=ORDER[side], omega_range=OMEGA_RANGE)
    P = bc.generalized_plant(
        reduced.system,
        disturbances={f"actuator_{side}": bc.low_pass(1.0, w.track), push: w.force_disturbance},
        performance={tip: w.tip, stroke: w.stroke},
        effort={push: effort_weight(w)},
        noise={stroke: w.stroke_noise, acceleration: w.acceleration_noise},
        measurements=[stroke, acceleration],
        controls=[push],
    )
    synthesis = bc.h_infinity(P, nmeas=2, ncon=1)
    return synthesis, reduced


def design() -> SuspensionDesign:
    """Design both controllers and join them into one for the machine."""
    model = suspension_model()
    controllers, facts = {}, {}
    for side, half in zip(("sym", "anti"), bc.split_symmetric(model), strict=True):
        synthesis, reduced = half_design(half, side)
        controllers[side] = synthesis.controller
        name = HALVES[side]
        facts[f"{name}: verified gamma"] = synthesis.certificate.summary
        facts[f"{name}: proof in ball arithmetic"] = bc.prove(synthesis).claim
        share = reduced.error_norm / bc.sigma(reduced.full_system).peak
        facts[f"{name}: reduction"] = (
            f"to order {reduced.order}, error up to {OMEGA_RANGE[1]:g} rad/s at most {100 * share:.2g} % of its peak gain"
        )
    return SuspensionDesign(
        "h_infinity_split",
        "H-infinity suspension, symmetric and antisymmetric controllers",
        controller=bc.join_symmetric(model, controllers["sym"], controllers["anti"]),
        synthesis_info=facts,
        weights={f"effort, {name}": effort_weight(WEIGHTS[side]) for side, name in HALVES.items()},
    )


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
