"""H-infinity suspension designed in discrete time, with a sample time of 20 ms and a delay of 10 ms.

Each subsystem of the symmetric boom is discretized exactly, with zero-order hold and delay of the force, and reduced in
discrete time.  The weights are similar to those of `h_infinity_split`; the effort weight increases up to a frequency below
the Nyquist frequency.  The controller is also reduced in discrete time.  Its closed loop is verified on the full-order plant
at the samples and between them.
"""

from math import sqrt

import control
import numpy as np

import boomctl as bc
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult, suspension_model

SAMPLE_TIME, DELAY = 0.02, 0.01  # [s]
ORDER, OMEGA_RANGE, LOST = 20, (0.0, 80.0), 0.02  # LOST: allowed relative increase of the norm by controller reduction
SCALES = {"actuator": 0.03, "suspension": 150.0, "tip": 0.2, "stroke": 0.05, "tip_acceleration": 0.5}
NAMES = {"sym": "jolt", "anti": "yaw"}
TRACK = {"sym": 1.0, "anti": 2.0}  # corner frequency of the platform motion [rad/s]
TIP, STROKE, EFFORT = {"sym": 2.0, "anti": 1.0}, {"sym": 1.0, "anti": 2.0}, {"sym": 1.0, "anti": 2.0}
ROLL_OFF, FASTEST = {"sym": 4.0, "anti": 5.0}, 120.0  # frequency range in which the effort weight increases [rad/s]
STROKE_NOISE, ACCELERATION_NOISE, FORCE = {"sym": 0.2, "anti": 0.02}, 3.0, 0.05


def effort_weight(side) -> control.StateSpace:
    """Return the effort weight: constant at low frequency, then increasing with the square of the frequency."""
    flat, corner = EFFORT[side], ROLL_OFF[side]
    return bc.shelf(flat, flat * (FASTEST / corner) ** 2, sqrt(FASTEST * corner), order=2)


def weighted(plant, side):
    """Return the generalized plant of a subsystem, in continuous or discrete time."""
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
    """Design the controller of a subsystem; return it with the verified closed-loop norms."""
    scales, name = {f"{stem}_{side}": size for stem, size in SCALES.items()}, NAMES[side]
    plant = bc.scale_signals(model, scales)
    sampled = bc.analysis.sample_plant(plant, SAMPLE_TIME, f"suspension_{side}", delay=DELAY)
    P = weighted(bc.reduce(sampled, order=ORDER, omega_range=OMEGA_RANGE), side)
    synthesis = bc.h_infinity(P, nmeas=2, ncon=1)
    smaller = bc.reduce_controller(P, synthesis, max_degradation=LOST)
    mesh = bc.hinf_norm(bc.lft(weighted(sampled, side), smaller))  # upper bound is infinite if the loop is unstable
    between = bc.analysis.sampled_data_norm(
        weighted(plant, side), smaller, f"w_actuator_{side}", [f"z_tip_{side}", f"z_stroke_{side}"], delay=DELAY
    )
    facts = {
        f"{name}: verified gamma": synthesis.certificate.summary,
        f"{name}: proof in ball arithmetic": bc.prove(synthesis).claim,
        f"{name}: reduced controller": f"{smaller.order} of {synthesis.controller.nstates} states, gamma {smaller.gamma:.4g}",
        f"{name}: full plant": f"stable at the samples, verified norm {mesh.lower_bound:.4g} with {sampled.nstates} states",
        f"{name}: between samples": f"L2 gain from the input of the shaping filter to weighted tip and stroke: "
        f"lower bound {between.lower_bound:.4g}, proved upper bound {between.upper_bound:.6g}",
    }
    if not np.isfinite(mesh.upper_bound):
        raise bc.exceptions.SynthesisError(
            f"{name}: the loop with the full-order plant is unstable, or its norm could not be certified"
        )
    return smaller.controller, facts


def design() -> SuspensionDesign:
    """Design both controllers and join them into one for the machine."""
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
            f"The sample time is {1e3 * SAMPLE_TIME:g} ms, and the forces act with a delay of {1e3 * DELAY:g} ms. Peak gains"
            " are those at the samples, with zero-order hold of the platform motion. The weights are plotted in continuous"
            " time; the synthesis uses their Tustin discretizations.",
        ),
    )


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
