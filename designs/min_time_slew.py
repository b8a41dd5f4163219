"""The fastest rest-to-rest slew of a flexible beam, and what it gains over shaped commands.

A quarter turn of the paper's beam under 200 N m: the minimum-time torque, bang-bang with switching times sharpened on the
nonlinear model, against the rigid body's bound and classical input shapers.
"""

from dataclasses import dataclass

import numpy as np

from boomctl.hub_beam import HubBeam, HubBeamParameters
from boomctl.slew import compare_slews, optimal_slew

ANGLE, LIMIT = np.pi / 2, 200.0


@dataclass(frozen=True)
class MinTimeSlew:
    """Durations [s] of the optimum, the rigid bound and the ZV-shaped slew; number of switches; vibration left [m]."""

    duration: float
    rigid_duration: float
    shaped_duration: float
    switches: int
    vibration: float
    rigid_vibration: float
    optimality_gap: float


def main(modes: int = 2) -> MinTimeSlew:
    """Plan the slew, play it back, and compare."""
    h = HubBeam(HubBeamParameters(), "sfoam", modes)
    fastest = optimal_slew(h, angle=ANGLE, torque_limit=LIMIT)
    table = {line.name: line for line in compare_slews(h, ANGLE, LIMIT, {"fastest": fastest}).lines}
    return MinTimeSlew(
        duration=fastest.duration,
        rigid_duration=table["bang-bang"].duration,
        shaped_duration=table["bang-bang, ZV"].duration,
        switches=fastest.certificate.switches or 0,
        vibration=table["fastest"].vibration,
        rigid_vibration=table["bang-bang"].vibration,
        optimality_gap=fastest.certificate.optimality_gap,
    )


if __name__ == "__main__":
    print(main())
