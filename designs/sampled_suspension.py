"""H-infinity suspension for a slow computer: designed and proved in discrete time, every 20 ms, forces 10 ms late.

Each half of the symmetric boom is sampled exactly, its force held and late, and reduced in discrete time.  The weights are
nearly those of `h_infinity_split`; effort costs more and more up to below half the sampling rate.  The controller is made
smaller in discrete time too, and its loop verified on the whole mesh, at the samples and between them.
"""

from math import sqrt

import control
import numpy as np

import boomctl as bc
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult, suspension_model

SAMPLE_TIME, DELAY = 0.02, 0.01  # [s]
ORDER, OMEGA_RANGE, LOST = 20, (0.0, 80.0), 0.02  # of the plant; share of the norm that a smaller controller may cost
SCALES = {"actuator": 0.03, "suspension": 150.0, "tip": 0.2, "stroke": 0.05, "tip_acceleration": 0.5}
NAMES = {"sym": "jolt", "anti": "yaw"}
TRACK = {"sym": 1.0, "anti": 2.0}  # corner of the platform's motion [rad/s]
TIP, STROKE, EFFORT = {"sym": 2.0, "anti": 1.0}, {"sym": 1.0, "anti": 2.0}, {"sym": 1.0, "anti": 2.0}
ROLL_OFF, FASTEST = {"sym": 4.0, "anti": 5.0}, 120.0  # where effort begins to cost more, and where that ends [rad/s]
STROKE_NOISE, ACCELERATION_NOISE, FORCE = {"sym": 0.2, "anti": 0.02}, 3.0, 0.05


def effort_weight(side) -> control.StateSpace:
    """Return the weight of the control: flat, then rising with the second power."""
    flat, corner = EFFORT[side], ROLL_OFF[side]
    return bc.shelf(flat, flat * (FASTEST / corner) ** 2, sqrt(FASTEST * corner), order=2)


def weighted(plant, side):
    """Return the generalized plant of a half, in continuous or discrete time."""
    push, tip, stroke, acceleration = (f"{stem}_{side}" for stem in ("suspension", "tip", "stroke", "tip_acceleration"))
    return bc.generalized_plant(
        plant,
        disturbances={f"actuator_{side}": bc.low_pass(1.0, TRACK[side]), push: FORCE},
        performance={tip: TIP[side], stroke: STROKE[side]},
        effort={push: effort_weight(side)},
        noise={stroke: STROKE_NOISE[side], acceleration: ACCELERATION_NOISE},
        measurements=[stroke, acceleration],
        controls=[push],
    )


def half_design(model, side):
    """Design the controller of a subsystem; return it with the verified norms of its loops."""
    scales, name = {f"{stem}_{side}": size for stem, size in SCALES.items()}, NAMES[side]
    plant = bc.scale_signals(model, scales)
    sampled = bc.analysis.sample_plant(plant, SAMPLE_TIME, f"suspension_{side}", delay=DELAY)
    P = weighted(bc.reduce(sampled, order=ORDER, omega_range=OMEGA_RANGE), side)
    synthesis = bc.h_infinity(P, nmeas=2, ncon=1)
    smaller = bc.reduce_controller(P, synthesis, max_degradation=LOST)
    mesh = bc.hinf_norm(bc.lft(weighted(sampled, side), smaller))  # certified: infinite if the loop is not stable
    between = bc.analysis.sampled_data_norm(
        weighted(plant, side), smaller, f"w_actuator_{side}", [f"z_tip_{side}", f"z_stroke_{side}"], delay=DELAY
    )
    facts = {
        f"{name}: verified gamma": synthesis.certificate.summary,
        f"{name}: proved in ball arithmetic": bc.prove(synthesis).claim,
        f"{name}: smaller controller": f"{smaller.order} of {synthesis.controller.nstates} states, gamma {smaller.gamma:.4g}",
        f"{name}: whole mesh": f"stable at the samples, verified norm {mesh.lower_bound:.4g} with {sampled.nstates} states",
        f"{name}: between samples": f"from the track behind its filter to weighted tip and stroke a gain of "
        f"{between.lower_bound:.4g} is reached, at most {between.upper_bound:.6g} is proved",
    }
    if not np.isfinite(mesh.upper_bound):
        raise bc.exceptions.SynthesisError(
            f"{name}: the loop is not stable on the whole mesh, or its norm could not be certified"
        )
    return smaller.controller, facts


def design() -> SuspensionDesign:
    """Return both halves' controllers joined into one of the machine."""
    model, controllers, facts = suspension_model(), {}, {}
    for side, half in zip(NAMES, bc.split_symmetric(model), strict=True):
        controllers[side], found = half_design(half, side)
        facts |= found
    return SuspensionDesign(
        "sampled_suspension",
        "H-infinity suspension in discrete time, 20 ms",
        controller=bc.join_symmetric(model, controllers["sym"], controllers["anti"]),
        delay=DELAY,
        synthesis_info=facts,
        weights={f"effort, {NAMES[side]}": effort_weight(side) for side in NAMES},
        notes=(
            f"The controller runs every {1e3 * SAMPLE_TIME:g} ms and its forces act {1e3 * DELAY:g} ms after a sample. Peaks"
            " are those at the samples, for a platform that is held from one sample to the next. The weights drawn below"
            " stand for their Tustin discretisations.",
        ),
    )


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
