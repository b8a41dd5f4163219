"""PD controller with notch at the hub, tuned for tip masses of 0, 0.1 and 0.2 kg, compared with LQG designed for 0.1 kg.

Both measure only the hub encoder. The objective is the gain from disturbance torque to hub and tip; the constraint limits the
gain from encoder noise to torque. The LQG controller has the order of the plant; under the same constraint it is not better
for 0.1 kg, and much worse at the ends of the range.
"""

from functools import cache
from itertools import product

import control
import numpy as np

import boomctl as bc
from boomctl.studies.machine import MachineResult
from boomctl.tuning import TuneResult

MASSES = (0.0, 0.1, 0.2)  # tip masses of the tuning [kg]
BETWEEN = np.linspace(0.0, 0.2, 9)  # tip masses of the comparison [kg]
NOISE_GAIN = 3e4  # limit on the gain from encoder noise to torque [N m/rad]: 2e-5 rad of noise give 0.6 N m
NOTCH = (2.0, 100.0)  # range of the notch frequency [rad/s]: from below the first bending mode to the third
LENGTH = bc.HubBeamParameters().length  # tip displacement per hub angle [m]
EFFORT = np.geomspace(1e-9, 1e-4, 6)  # grid of torque weights of the LQG
NOISE = np.geomspace(1e-11, 1e-7, 9)  # grid of encoder noise intensities of the LQG, relative to that of the torque


def beam(mass: float) -> control.StateSpace:
    """Return the linearized beam at rest with a tip mass and three modes."""
    return bc.hub_beam(bc.HubBeamParameters(tip_mass=mass, damping_ratio=0.005), "sfoam", 3).linearize(0.0, sensors=())


@cache
def plant(mass: float) -> control.StateSpace:
    """Return the generalized plant, from disturbance torque and encoder noise to hub angle, tip displacement and torque."""
    return bc.generalized_plant(
        beam(mass),
        disturbances={"disturbance_torque": 1.0},
        performance={"hub_angle": LENGTH, "tip_displacement": 1.0},
        effort={"torque": 1.0},
        noise={"hub_angle": 1.0},
        measurements=["hub_angle"],
        controls=["torque"],
    )


def norms(controller: control.StateSpace, mass: float) -> tuple[float, float]:
    """Return the H-infinity norms from disturbance torque to hub and tip [m/(N m)] and from noise to torque [N m/rad]."""
    loop = bc.lft(plant(mass), controller)
    ends = [("w_disturbance_torque", ["z_hub_angle", "z_tip_displacement"]), ("n_hub_angle", ["z_torque"])]
    found = [bc.hinf_norm(bc.synthesis.select_channels(loop, [start], end)).lower_bound for start, end in ends]
    return found[0], found[1]


def tuned() -> TuneResult:
    """Tune PD and notch: minimize the effect of the disturbance torque, with limited gain from noise to torque."""
    structure = bc.tunable.pid(integral=False) * bc.tunable.notch(*NOTCH)
    channels = [
        bc.tunable.objective("w_disturbance_torque", ["z_hub_angle", "z_tip_displacement"]),
        bc.tunable.constraint("n_hub_angle", "z_torque", NOISE_GAIN),
    ]
    return bc.tune([plant(mass) for mass in MASSES], 1, 1, structure, channels=channels, n_starts=12, time_limit=600.0)


@cache
def regulators() -> tuple[control.StateSpace, ...]:
    """Return LQG controllers for the middle mass that meet the noise limit, best disturbance rejection there first."""
    found = []
    for effort, noise in product(EFFORT, NOISE):
        K = bc.lqg(
            beam(MASSES[1]),
            None,
            effort,
            {"disturbance_torque": 1.0},
            {"hub_angle": noise},
            ["hub_angle"],
            ["torque"],
            output_weight={"hub_angle": LENGTH, "tip_displacement": 1.0},
        ).controller
        disturbed, noisy = norms(K, MASSES[1])
        if noisy <= NOISE_GAIN:
            found.append((disturbed, K))
    return tuple(K for _, K in sorted(found, key=lambda each: each[0]))


@cache
def worst(controller: control.StateSpace) -> float:
    """Return the largest norm at the compared masses; infinite if a loop is unstable."""
    return max(norms(controller, mass)[0] for mass in BETWEEN)


def design() -> bc.studies.MachineDesign:
    """Return the tuned PD controller with notch, and its comparison with LQG."""
    found, middle = tuned(), beam(MASSES[1])
    arc = LENGTH * middle.C[[middle.output_labels.index("hub_angle")]]  # hub angle as displacement at the tip [m]
    names = {
        "inputs": middle.input_labels,
        "outputs": [*middle.output_labels, "hub_arc"],
        "states": middle.state_labels,
    }
    judged = control.ss(
        middle.A, middle.B, np.vstack([middle.C, arc]), np.vstack([middle.D, 0.0 * middle.D[:1]]), **names
    )
    best, *others = regulators()
    even = min((best, *others), key=worst)
    said = "{:.4f} m/(N m) with 0.1 kg, at most {:.4f} with 0 to 0.2 kg"
    facts = {"PD and notch": found.certificate.summary, "proof in ball arithmetic": bc.prove(found).claim}
    for name, K in (("PD and notch", found.controller), ("LQG, best for 0.1 kg", best), ("LQG, best worst case", even)):
        facts[f"{name}, {K.nstates} states"] = said.format(norms(K, MASSES[1])[0], worst(K))
    return bc.studies.MachineDesign(
        "tuned_hub",
        "PD controller with notch, tuned for 0 to 0.2 kg",
        judged,
        found.controller,
        inputs="disturbance_torque",
        outputs=["hub_arc", "tip_displacement"],
        synthesis_info=facts,
        notes=(
            f"H-infinity norms from disturbance torque [N m] to hub angle times {LENGTH:g} m and tip displacement [m], at "
            f"{len(BETWEEN)} tip masses; singular values and margins with {MASSES[1]:g} kg. The gain from encoder noise "
            f"to torque is at most {NOISE_GAIN:g} N m/rad with 0.1 kg for each controller.",
        ),
    )


def main() -> MachineResult:
    """Evaluate the drive."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
