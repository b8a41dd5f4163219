"""Spinning a flexible beam up to a speed: the fastest torque, against the smooth profile of the paper.

The beam ends in steady rotation without vibration. The paper's profile is given the same peak torque; it then takes longer
and leaves a vibration.
"""

from dataclasses import dataclass

import numpy as np

from boomctl.hub_beam import HubBeamParameters, hub_beam, spin_up, torque
from boomctl.slew import optimal_slew

SPEED, LIMIT = 1.0, 200.0


@dataclass(frozen=True)
class SpinUpSlew:
    """Durations [s], and largest tip displacement afterwards [m], of the optimum and of the smooth profile."""

    duration: float
    rigid_duration: float
    vibration: float
    smooth_duration: float
    smooth_vibration: float


def main(modes: int = 2) -> SpinUpSlew:
    """Plan the spin-up and play both back."""
    q = HubBeamParameters()
    h = hub_beam(q, model="sfoam", modes=modes)
    slew = optimal_slew(h, angle=None, torque_limit=LIMIT, final_speed=SPEED)
    after = slew.duration + np.linspace(0.0, 6.0, 121)
    played = h.simulate(torque(slew.history, slew.history.breakpoints), after)
    smooth = 2.0 * q.rigid_inertia * SPEED / LIMIT  # the profile's largest acceleration is 2 w / T
    profile = h.simulate(spin_up(SPEED, smooth), smooth + np.linspace(0.0, 6.0, 121))
    return SpinUpSlew(
        duration=slew.duration,
        rigid_duration=q.rigid_inertia * SPEED / LIMIT,
        vibration=float(np.abs(played.tip_displacement).max()),
        smooth_duration=smooth,
        smooth_vibration=float(np.abs(profile.tip_displacement).max()),
    )


if __name__ == "__main__":
    print(main())
