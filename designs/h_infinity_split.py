"""H-infinity suspension: separate controllers of the symmetric and the antisymmetric subsystem of the boom.

Each half has one disturbance (the platform's motion through a track filter), one control and two sensors. A force
disturbance at the control keeps the design off solutions that live on a spring cancelled by feedback; the effort weight
rises above a few rad/s, so that bending modes, which the uncertain mass moves about, are left alone.
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
    """Weights of one half; signals are divided by SCALES."""

    track: float  # corner of the platform's motion [rad/s]
    tip: float
    stroke: float
    effort: float
    roll_off: float  # from where on effort costs more and more [rad/s]
    stroke_noise: float
    acceleration_noise: float = 3.0
    force_disturbance: float = 0.05


WEIGHTS = {
    "sym": Weights(track=1.0, tip=3.0, stroke=1.0, effort=1.0, roll_off=3.0, stroke_noise=0.2),
    "anti": Weights(track=2.0, tip=1.0, stroke=2.0, effort=2.0, roll_off=5.0, stroke_noise=0.02),
}
FASTEST = 300.0  # where the effort weight ends [rad/s]


def effort_weight(w: Weights) -> control.StateSpace:
    """Return the weight of the control: flat, then rising with the second power."""
    return bc.shelf(w.effort, w.effort * (FASTEST / w.roll_off) ** 2, sqrt(FASTEST * w.roll_off), order=2)


def half_design(model, side):
    """Design the controller of a subsystem; return the synthesis and the reduction of the plant."""
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
    """Return both halves' controllers joined into one of the machine."""
    model = suspension_model()
    controllers, facts = {}, {}
    for side, half in zip(("sym", "anti"), bc.split_symmetric(model), strict=True):
        synthesis, reduced = half_design(half, side)
        controllers[side] = synthesis.controller
        name = HALVES[side]
        facts[f"{name}: verified gamma"] = synthesis.certificate.summary
        facts[f"{name}: proved in ball arithmetic"] = bc.prove(synthesis).claim
        share = reduced.error_norm / bc.sigma(reduced.full_system).peak
        facts[f"{name}: reduction"] = (
            f"to order {reduced.order}, error up to {OMEGA_RANGE[1]:g} rad/s at most {100 * share:.2g} % of the half's peak"
        )
    return SuspensionDesign(
        "h_infinity_split",
        "H-infinity suspension, symmetric and antisymmetric controllers",
        controller=bc.join_symmetric(model, controllers["sym"], controllers["anti"]),
        synthesis_info=facts,
        weights={f"effort, {name}": effort_weight(WEIGHTS[side]) for side, name in HALVES.items()},
    )


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
