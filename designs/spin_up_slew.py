"""Minimum-time spin-up of a flexible beam, compared with the smooth profile of the paper.

The beam ends in steady rotation without residual vibration. The duration of the paper's profile, Eq. (43), is chosen such
that a rigid body would need the same peak torque. The profile takes longer and causes residual vibration, and on the flexible
beam its torque differs from that of the rigid body.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from boomctl.maneuvers import spin_up
from boomctl.plotting.canvas import figure_of, panels, picture
from boomctl.report import Section
from boomctl.rotating_beam import HubBeam, HubBeamParameters, SimulationResult, hub_beam
from boomctl.slew import SlewResult, optimal_slew
from boomctl.studies.evaluation import table_of
from boomctl.studies.slew import SlewDesign, SlewEvaluation

SPEED, LIMIT = 1.0, 200.0
# the largest acceleration of the profile is 2 w / T
PROFILE = spin_up(SPEED, 2.0 * HubBeamParameters().rigid_body_inertia * SPEED / LIMIT)
HEADS = {
    "name": "",
    "duration": "duration [s]",
    "peak_torque": "peak torque [N\u00a0m]",
    "vibration": "vibration [m]",
    "speed_error": "speed error [rad/s]",
}


@dataclass(frozen=True)
class SpinUp:
    """Spin-up by a torque or by a prescribed hub motion: largest torque, and errors after the end."""

    name: str
    duration: float
    peak_torque: float
    vibration: float
    speed_error: float
    motion: SimulationResult


def spin_ups(h: HubBeam, slew: SlewResult) -> Iterator[SpinUp]:
    """Simulate the spin-up with the planned torque and with the prescribed profile of the hub."""
    last = max(PROFILE.duration, slew.duration) + 1.5 / float(h.eigenfrequencies_hz().min())
    time = np.unique([*np.linspace(0.0, last, 1201), PROFILE.duration, slew.duration])
    for name, moved in (("minimum time", slew.torque_profile), ("profile, Eq. (43)", PROFILE)):
        run, late = h.simulate(moved, time), time >= moved.duration
        yield SpinUp(
            name,
            moved.duration,
            peak_torque=float(np.abs(run.torque).max()),
            vibration=float(np.abs(run.tip_displacement[late]).max()),
            speed_error=float(np.abs(run.hub_speed[late] - SPEED).max()),
            motion=run,
        )


def drawn(pair: tuple[SpinUp, ...], ax: Any = None) -> Any:
    """Plot torque, hub speed and tip displacement of the spin-ups over time."""
    labels = ("torque [N m]", "hub speed [rad/s]", "tip displacement [m]")
    levels = ((-LIMIT, LIMIT), (SPEED,), ())
    with panels(ax, labels, (7.0, 5.8)) as axes:
        for axis, label, marked in zip(axes, labels, levels, strict=True):
            for level in marked:
                axis.axhline(level, color="0.45", linewidth=2.4, alpha=0.5, linestyle="--")
            axis.set(ylabel=label, xlim=(0.0, pair[0].motion.time[-1]))
        for each in pair:
            run = each.motion
            for axis, values in zip(axes, (run.torque, run.hub_speed, run.tip_displacement), strict=True):
                (line,) = axis.plot(run.time, values, label=each.name)
                axis.axvline(each.duration, color=line.get_color(), linewidth=0.8, linestyle=":")
        axes[1].legend(loc="lower right")
        axes[2].set_xlabel("time [s]")
    return axes


def design(modes: int = 2) -> SlewDesign:
    """Plan the spin-up and compare it with the profile."""
    beam = hub_beam(HubBeamParameters(), "sfoam", modes)
    planned = optimal_slew(beam, angle=None, torque_limit=LIMIT, final_speed=SPEED)
    pair = tuple(spin_ups(beam, planned))
    rows = [{key: getattr(each, key) for key in HEADS} for each in pair]
    words = (
        f"The beam ends in steady rotation at {SPEED:g} rad/s with a free hub. The profile of Bai et al. (2009), Eq. (43),"
        " prescribes the hub motion during and after the spin-up, like an ideal speed controller without torque limit;"
        f" with its duration a rigid body would need a peak torque of {LIMIT:g} N m. Vibration and speed error are the"
        " largest values after the end of the spin-up."
    )
    caption = (
        "Torque, hub speed and tip displacement. Dashed: torque limit and final speed; dotted: end of each spin-up."
    )
    shown = picture("spin_up", figure_of(partial(drawn, pair)), caption, "png")
    return SlewDesign(
        "spin_up_slew",
        "Minimum-time spin-up to 1 rad/s",
        beam,
        {"minimum time": planned},
        reference_slew="smooth torque",
        results={"spin_ups": rows},
        sections=(Section("Comparison of the spin-ups", (words,), (table_of(rows, HEADS),), (shown,)),),
    )


def main(modes: int = 2) -> SlewEvaluation:
    """Evaluate the spin-up."""
    return design(modes).evaluate()


if __name__ == "__main__":
    print(main())
