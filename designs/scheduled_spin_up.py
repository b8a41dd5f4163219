"""A drive scheduled over the hub speed: LQG at seven speeds, the beam spun up to 5 rad/s with 0.1 kg unknown at its tip.

Each controller knows the beam as centrifugal forces stiffen it at its speed, where it weighs the tip's displacement more, for
a stiffer beam moves less; none knows of the mass. Between the speeds their matrices run in straight lines. The loop is proved
stable at every speed up to 6 rad/s with 0 to 0.1 kg, and while the speed changes, faster than the spin-up asks for.
"""

import numpy as np

from boomctl import HubBeamParameters, hub_beam, lqg, schedule
from boomctl.studies import SpinUpDesign
from boomctl.studies.spin_up import SpinUpResult

SPEEDS, MASSES = np.linspace(0.0, 6.0, 7), (0.0, 0.1)  # rad/s, kg
SENSORS = {"hub_angle": 1e-5, "hub_speed": 1e-4, "root_moment": 0.1}  # and the intensity of their noise
NOISE = {"hub_angle": 1e-5, "hub_speed": 1e-3, "root_moment": 0.05}  # of a sample, rad, rad/s, N m


def drive(modes: int = 3) -> SpinUpDesign:
    """Design the drive."""
    beam = hub_beam(HubBeamParameters(damping_ratio=0.005), "sfoam", modes)
    made = [
        lqg(
            beam.linearize(speed, sensors=()),
            None,
            1.0,
            {"disturbance_torque": 100.0, "tip_force": 0.1},
            SENSORS,
            list(SENSORS),
            ["torque"],
            output_weight={"hub_angle": 2e4, "hub_speed": 2e5, "tip_displacement": 2e4 * (1.0 + speed**2 / 4.0)},
        ).controller
        for speed in SPEEDS
    ]
    return SpinUpDesign(
        "scheduled_spin_up",
        "LQG scheduled over the hub speed",
        beam,
        schedule(made, SPEEDS, "hub_speed"),
        MASSES,
        final_speed=5.0,
        duration=15.0,
        gust=2.0,
        noise=NOISE,
        notes=(
            "The drive reads hub angle, hub speed and bending moment at the clamp, every 10 ms; angle and speed less those "
            "of Eq. (43), whose torque for a rigid beam without tip mass is fed forward.",
        ),
    )


def main(modes: int = 3) -> SpinUpResult:
    """Return what the drive is worth."""
    return drive(modes).evaluate()


if __name__ == "__main__":
    print(main())
