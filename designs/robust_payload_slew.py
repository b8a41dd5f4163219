"""One torque for several payloads: a slew that leaves no vibration whichever of them hangs at the tip.

The least-effort torque for one payload leaves the beam swinging with another one. Asking the same torque to bring the beam
to rest with all payloads at once costs some effort and nothing else; in between, the vibration stays small too.
"""

from dataclasses import dataclass

import numpy as np

from boomctl.hub_beam import HubBeamParameters, hub_beam, torque
from boomctl.slew import SlewResult, optimal_slew

ANGLE, LIMIT, DURATION = np.pi / 2, 200.0, 4.5
NOMINAL, OTHERS, BETWEEN = 0.1, (0.0, 0.2), (0.05, 0.15)


@dataclass(frozen=True)
class RobustSlew:
    """Largest tip swing after the slew [m] over planned and intermediate payloads, without and with them in the plan."""

    nominal_swing: float
    robust_swing: float
    robust_swing_between: float
    effort_ratio: float


def swing(slew: SlewResult, masses: tuple[float, ...], modes: int) -> float:
    """Largest tip displacement [m] in the 6 s after the slew, over payloads."""
    after = slew.duration + np.linspace(0.0, 6.0, 121)
    drive = torque(slew.history, slew.history.breakpoints)
    worst = 0.0
    for mass in masses:
        beam = hub_beam(HubBeamParameters(tip_mass=mass), model="sfoam", modes=modes)
        worst = max(worst, float(np.abs(beam.simulate(drive, after).tip_displacement).max()))
    return worst


def main(modes: int = 2, intervals: int = 100) -> RobustSlew:
    """Plan for one payload, and for three, and play both back with all of them."""
    h = hub_beam(HubBeamParameters(tip_mass=NOMINAL), model="sfoam", modes=modes)
    plain, robust = (
        optimal_slew(h, ANGLE, LIMIT, "effort", DURATION, tip_masses=masses, method="shooting", intervals=intervals)
        for masses in ((), OTHERS)
    )
    return RobustSlew(
        nominal_swing=swing(plain, OTHERS, modes),
        robust_swing=swing(robust, OTHERS, modes),
        robust_swing_between=swing(robust, BETWEEN, modes),
        effort_ratio=robust.cost / plain.cost,
    )


if __name__ == "__main__":
    print(main())
