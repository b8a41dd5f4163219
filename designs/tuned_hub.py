"""PD and a notch at the hub, tuned at once for 0 to 0.2 kg at the tip, beside the LQG that is made for the middle, 0.1 kg.

Both read the encoder of the hub alone. What a disturbance torque does to hub and tip is to be small, and torque from the
encoder's noise is limited. The LQG knows all modes and has a state for each; with the same limit it is no better for 0.1 kg,
and far worse at the ends.
"""

from functools import cache
from itertools import product

import control
import numpy as np

import boomctl as bc
from boomctl.studies.machine import MachineResult
from boomctl.tuning import TuneResult

MASSES = (0.0, 0.1, 0.2)  # at the tip, that are tuned for [kg]
BETWEEN = np.linspace(0.0, 0.2, 9)  # those at which both are compared [kg]
NOISE_GAIN = 3e4  # torque over encoder noise, at any frequency [N m/rad]: an encoder of 2e-5 rad moves 0.6 N m
NOTCH = (2.0, 100.0)  # where the notch may be [rad/s]: from below the first bending mode to the third
LENGTH = bc.HubBeamParameters().length  # what an angle of the hub moves the tip by [m]
EFFORT = np.geomspace(1e-9, 1e-4, 6)  # weights of the torque tried for the LQG
NOISE = np.geomspace(1e-11, 1e-7, 9)  # intensities of the encoder's noise tried for it, over that of the torque


def beam(mass: float) -> control.StateSpace:
    """Return the beam at rest with a mass at its tip, three modes."""
    return bc.hub_beam(bc.HubBeamParameters(tip_mass=mass, damping_ratio=0.005), "sfoam", 3).linearize(0.0, sensors=())


@cache
def plant(mass: float) -> control.StateSpace:
    """Return the generalized plant: disturbance torque and encoder noise to what hub and tip do, and to the torque."""
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
    """Return the norm from disturbance torque to hub and tip [m/N m], and from noise to torque [N m/rad]."""
    loop = bc.lft(plant(mass), controller)
    ends = [("w_disturbance_torque", ["z_hub_angle", "z_tip_displacement"]), ("n_hub_angle", ["z_torque"])]
    found = [bc.hinf_norm(bc.synthesis.select_channels(loop, [start], end)).lower_bound for start, end in ends]
    return found[0], found[1]


def tuned() -> TuneResult:
    """Return PD and notch: the disturbance least, torque from noise within its limit."""
    structure = bc.tunable.pid(integral=False) * bc.tunable.notch(*NOTCH)
    channels = [
        bc.tunable.objective("w_disturbance_torque", ["z_hub_angle", "z_tip_displacement"]),
        bc.tunable.constraint("n_hub_angle", "z_torque", NOISE_GAIN),
    ]
    return bc.tune([plant(mass) for mass in MASSES], 1, 1, structure, channels=channels, n_starts=12, time_limit=600.0)


@cache
def regulators() -> tuple[control.StateSpace, ...]:
    """Return LQGs for the middle mass that keep the limit of noise, the one best against the disturbance there first."""
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
    """Return the largest norm at the masses compared; infinite where a loop is unstable."""
    return max(norms(controller, mass)[0] for mass in BETWEEN)


def design() -> bc.studies.MachineDesign:
    """Return the hub with PD and notch, and what LQG does beside it."""
    found, middle = tuned(), beam(MASSES[1])
    arc = LENGTH * middle.C[[middle.output_labels.index("hub_angle")]]  # what the hub does, where the tip does [m]
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
    facts = {"PD and notch": found.certificate.summary, "proved in ball arithmetic": bc.prove(found).claim}
    for name, K in (("PD and notch", found.controller), ("best LQG for 0.1 kg", best), ("most even LQG", even)):
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
            f"Norms from disturbance torque [N m] to hub and tip together [m], the hub's angle times {LENGTH:g} m, at "
            f"{len(BETWEEN)} masses; singular values and margins with {MASSES[1]:g} kg. For each controller torque over "
            f"encoder noise is at most {NOISE_GAIN:g} N m/rad, at 0.1 kg.",
        ),
    )


def main() -> MachineResult:
    """Return what the drive is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
