"""Two controllers of order three, tuned at once for a box of springs and boom masses: no plant is reduced, none stays large.

The jolt decides on the spray: the H2 norm of tip and force is least, the middle of the box counting more than its corners.
The yaw has the high peak: it is brought down at every point of the box, as far as the force may follow the platform and as
the loop at the control keeps its distance. No pole of a controller is fast, so that elastic modes are left alone.
"""

from functools import cache, partial
from itertools import product
from typing import Any

import control
import numpy as np

import boomctl as bc
from boomctl.structure import AffineFamily, SecondOrderModel
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult, suspension_model
from boomctl.tuning import TuneResult

SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # of Table 2, over which is tuned
ORDER, STARTS, SECONDS = 3, 2, 600.0  # the time is far above what is taken: the starts decide, not the clock
MEASURED = ("stroke", "tip_acceleration")
CORNERS = 0.7  # what disturbances at the corners count, of those in the middle, for the jolt
FASTEST = {"sym": 50.0, "anti": 30.0}  # largest magnitude of a controller's poles [rad/s]
PEAK, FORCE, LOOP = (
    9.3,
    1800.0,
    2.0,
)  # of the yaw: tip [m/m] and force [N/m] over the platform, force over force: sizes alike
DECAY = 0.02  # slowest decay of the yaw [1/s]; an integrator would do as well, and never settle
NOISE = {"stroke": 0.005, "tip_acceleration": 0.5}  # of the jolt, beside 0.03 m of platform and 7.5 N of disturbance


def family(side: str) -> AffineFamily:
    """Return half of the boom over the box, in six elements."""
    half = {"sym": "jolt", "anti": "yaw"}[side]
    return bc.boom_family(
        spring_factor=SPRING, mass_factor=MASS, subsystem=half, elements=6, accelerometer_bandwidth_hz=20.0
    )


def plant(model: SecondOrderModel, side: str, **signals: Any) -> control.StateSpace:
    """Return a generalized plant with the sensors and the control of a half."""
    measured, push = [f"{stem}_{side}" for stem in MEASURED], f"suspension_{side}"
    return bc.generalized_plant(model, measurements=measured, controls=[push], **signals)


def jolt_plant(model: SecondOrderModel, share: float = 1.0) -> control.StateSpace:
    """Return the jolt with its weights; the force costs more above 15 rad/s."""
    return plant(
        model,
        "sym",
        disturbances={"actuator_sym": bc.low_pass(0.03 * share, 4.0), "suspension_sym": 7.5 * share},
        performance={"tip_sym": 15.0},
        effort={"suspension_sym": bc.shelf(4.0 / 150.0, 40.0 / 150.0, 15.0)},
        noise={f"{stem}_sym": size * share for stem, size in NOISE.items()},
    )


def yaw_plant(model: SecondOrderModel, force: float = FORCE) -> control.StateSpace:
    """Return the yaw in such units that its three channels come out alike."""
    return plant(
        model,
        "anti",
        disturbances={"actuator_anti": 1.0, "suspension_anti": force / LOOP},
        performance={"tip_anti": 1.0},
        effort={"suspension_anti": PEAK / force},
    )


@cache
def tuned_jolt(order: int = ORDER) -> TuneResult:
    """Return the jolt's controller: the H2 norm of all signals, the largest of five points of the box."""
    half = family("sym")
    corners = [half.at(np.array(point)) for point in product((-1.0, 1.0), repeat=2)]
    plants = [jolt_plant(half.at(np.zeros(2))), *(jolt_plant(model, CORNERS) for model in corners)]
    return tuned(plants, order, "sym", [bc.tunable.objective(norm="h2")])


def tuned_yaw(order: int = ORDER, decay: float | None = DECAY, force: float = FORCE) -> TuneResult:
    """Return the yaw's controller: peaks from platform to tip and force, and round the control, over the box."""
    ends = [("actuator_anti", "tip_anti"), ("actuator_anti", "suspension_anti"), ("suspension_anti", "suspension_anti")]
    channels = [bc.tunable.objective(f"w_{start}", f"z_{end}") for start, end in ends]
    return tuned(partial(yaw_plant, force=force), order, "anti", channels, family=family("anti"), min_decay_rate=decay)


def tuned(P: Any, order: int, side: str, channels: list, **options: Any) -> TuneResult:
    """Return a strictly proper controller of a half."""
    structure = bc.tunable.state_space(order, strictly_proper=True)
    fixed: dict[str, Any] = {
        "channels": channels,
        "n_starts": STARTS,
        "seed": 1,
        "fastest_pole": FASTEST[side],
        "time_limit": SECONDS,
    }
    return bc.tune(P, 2, 1, structure, **fixed, **options)


def suspension(order: int = ORDER, force: float = FORCE) -> SuspensionDesign:
    """Return both halves' controllers of an order joined into one of the machine."""
    halves = {"jolt": tuned_jolt(order), "yaw": tuned_yaw(order, force=force)}
    facts = {f"{name}: tuned": found.certificate.summary for name, found in halves.items()}
    facts |= {f"{name}: proved in ball arithmetic": bc.prove(found).claim for name, found in halves.items()}
    return SuspensionDesign(
        "tuned_suspension",
        f"Fixed-structure suspension, order {order} for each subsystem",
        controller=bc.join_symmetric(suspension_model(), *(found.controller for found in halves.values())),
        synthesis_info=facts,
    )


def design() -> SuspensionDesign:
    """Return the suspension that the folder is about."""
    return suspension()


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
