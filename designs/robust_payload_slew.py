"""Slew with one torque for several payloads, without residual vibration for any of them.

The minimum-effort torque for one payload causes residual vibration with another one. A torque that brings the beam to rest
with three payloads requires more than twice the effort in the same time; the residual vibration is also small for payloads
between them. The final hub angle is prescribed for the middle payload only; with the others it differs by about 0.045 rad.
"""

import numpy as np

from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.slew import optimal_slew
from boomctl.studies.slew import SlewDesign, SlewEvaluation

ANGLE, LIMIT, DURATION = np.pi / 2, 200.0, 4.5
NOMINAL, OTHERS, BETWEEN = 0.1, (0.0, 0.2), (0.03, 0.15)
ROBUST, PLAIN = "planned for 0, 0.1 and 0.2 kg", "planned for 0.1 kg only"


def design(modes: int = 2, intervals: int = 200) -> SlewDesign:
    """Plan one slew for three payloads and one for a single payload."""
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
        notes=(f"The robust slew requires {robust.cost / plain.cost:.2f} times the effort in the same time.",),
    )


def main(modes: int = 2, intervals: int = 200) -> SlewEvaluation:
    """Evaluate the slew."""
    return design(modes, intervals).evaluate()


if __name__ == "__main__":
    print(main())
