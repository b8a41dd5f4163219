"""Spinning a flexible beam up to a speed: the fastest torque, against the smooth profile of the paper.

The beam ends in steady rotation without vibration. The paper's profile, Eq. (43), is given the time in which a rigid body
would need the same peak torque for it; it then takes longer, leaves a vibration, and on the flexible beam its torque is not
that of the rigid body.
"""

from boomctl.rotating_beam import HubBeamParameters, hub_beam, spin_up
from boomctl.slew import optimal_slew
from boomctl.studies.slew import SlewDesign, SlewEvaluation

SPEED, LIMIT = 1.0, 200.0


def design(modes: int = 2) -> SlewDesign:
    """Plan the spin-up."""
    q = HubBeamParameters()
    beam = hub_beam(q, "sfoam", modes)
    return SlewDesign(
        "spin_up_slew",
        "Spun up to 1 rad/s in the least time",
        beam,
        {"minimum time": optimal_slew(beam, angle=None, torque_limit=LIMIT, final_speed=SPEED)},
        rival="smooth torque",
        profile=spin_up(SPEED, 2.0 * q.rigid_inertia * SPEED / LIMIT),  # its largest acceleration is 2 w / T
        notes=(f"The profile set beside it has the duration in which a rigid body would need {LIMIT:g} N m for it.",),
    )


def main(modes: int = 2) -> SlewEvaluation:
    """Return what the spin-up is worth."""
    return design(modes).evaluate()


if __name__ == "__main__":
    print(main())
