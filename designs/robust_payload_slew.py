"""One torque for several payloads: a slew that leaves no vibration whichever of them hangs at the tip.

The least-effort torque for one payload leaves the beam swinging with another one. Asking the same torque to bring the beam
to rest with all payloads at once costs more than twice the effort in the same time; in between, the vibration stays small
too. The hub's angle is prescribed for the middle payload only: the others come to rest some 0.045 rad beside it.
"""

import numpy as np

from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.slew import optimal_slew
from boomctl.studies.slew import SlewDesign, SlewEvaluation

ANGLE, LIMIT, DURATION = np.pi / 2, 200.0, 4.5
NOMINAL, OTHERS, BETWEEN = 0.1, (0.0, 0.2), (0.03, 0.15)
ROBUST, PLAIN = "planned for 0, 0.1 and 0.2 kg", "planned for 0.1 kg alone"


def design(modes: int = 2, intervals: int = 200) -> SlewDesign:
    """Plan for three payloads, and for one."""
    beam = hub_beam(HubBeamParameters(tip_mass=NOMINAL), "sfoam", modes)
    robust, plain = (
        optimal_slew(beam, ANGLE, LIMIT, "effort", DURATION, tip_masses=masses, intervals=intervals)
        for masses in (OTHERS, ())
    )
    return SlewDesign(
        "robust_payload_slew",
        "Slew with one torque for three payloads",
        beam,
        {ROBUST: robust, PLAIN: plain},
        reference_slew=PLAIN,
        tip_masses=tuple(sorted((NOMINAL, *OTHERS, *BETWEEN))),
        notes=(f"Robustness costs {robust.cost / plain.cost:.2f} times the effort in the same time.",),
    )


def main(modes: int = 2, intervals: int = 200) -> SlewEvaluation:
    """Return what the slew is worth."""
    return design(modes, intervals).evaluate()


if __name__ == "__main__":
    print(main())
