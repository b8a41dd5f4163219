"""Fixed-structure suspension: two controllers of order three, tuned over a box of spring stiffness and boom mass.

No model reduction is required. The jolt determines the spray distribution: the H2 norm of tip displacement and force is
minimized, with a larger weight on the center of the box than on its corners. The yaw has the high peak: the peaks from
platform to tip, from platform to force and of the loop at the control are minimized over the box. The magnitude of the
controller poles is limited, so that the controllers do not act on the elastic modes.
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

SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # ranges of the factors on the values of Table 2
ORDER, STARTS, SECONDS = 3, 2, 600.0  # time limit not reached, so that the result does not depend on it
MEASURED = ("stroke", "tip_acceleration")
CORNERS = 0.7  # weight of the corners in the H2 norm of the jolt, relative to the center
FASTEST = {"sym": 50.0, "anti": 30.0}  # largest magnitude of a controller's poles [rad/s]
# channel scales of the yaw: platform to tip, platform to force [N/m], force to force
PEAK, FORCE, LOOP = 9.3, 1800.0, 2.0
DECAY = 0.02  # minimum decay rate of the yaw [1/s]; excludes poles near zero, which do not settle
# noise of the jolt; its disturbances are 0.03 m at the platform and 7.5 N at the control
NOISE = {"stroke": 0.005, "tip_acceleration": 0.5}


def family(side: str) -> AffineFamily:
    """Return the family of a subsystem of the boom over the box, with six elements."""
    half = {"sym": "jolt", "anti": "yaw"}[side]
    return bc.boom_family(
        spring_factor=SPRING, mass_factor=MASS, subsystem=half, elements=6, accelerometer_bandwidth_hz=20.0
    )


def plant(model: SecondOrderModel, side: str, **signals: Any) -> control.StateSpace:
    """Return a generalized plant with the sensors and the control of a subsystem."""
    measured, push = [f"{stem}_{side}" for stem in MEASURED], f"suspension_{side}"
    return bc.generalized_plant(model, measurements=measured, controls=[push], **signals)


def jolt_plant(model: SecondOrderModel, share: float = 1.0) -> control.StateSpace:
    """Return the weighted jolt plant; the effort weight increases around 15 rad/s."""
    return plant(
        model,
        "sym",
        disturbances={"actuator_sym": bc.low_pass(0.03 * share, 4.0), "suspension_sym": 7.5 * share},
        performance={"tip_sym": 15.0},
        effort={"suspension_sym": bc.shelf(4.0 / 150.0, 40.0 / 150.0, 15.0)},
        noise={f"{stem}_sym": size * share for stem, size in NOISE.items()},
    )


def yaw_plant(model: SecondOrderModel, force: float = FORCE) -> control.StateSpace:
    """Return the yaw plant, scaled so that its three channels have similar norms."""
    return plant(
        model,
        "anti",
        disturbances={"actuator_anti": 1.0, "suspension_anti": force / LOOP},
        performance={"tip_anti": 1.0},
        effort={"suspension_anti": PEAK / force},
    )


@cache
def tuned_jolt(order: int = ORDER) -> TuneResult:
    """Tune the jolt controller: minimize the largest H2 norm over five points of the box."""
    half = family("sym")
    corners = [half.at(np.array(point)) for point in product((-1.0, 1.0), repeat=2)]
    plants = [jolt_plant(half.at(np.zeros(2))), *(jolt_plant(model, CORNERS) for model in corners)]
    return tuned(plants, order, "sym", [bc.tunable.objective(norm="h2")])


def tuned_yaw(order: int = ORDER, decay: float | None = DECAY, force: float = FORCE) -> TuneResult:
    """Tune the yaw controller: minimize the peaks from platform to tip and force, and at the control, over the box."""
    ends = [("actuator_anti", "tip_anti"), ("actuator_anti", "suspension_anti"), ("suspension_anti", "suspension_anti")]
    channels = [bc.tunable.objective(f"w_{start}", f"z_{end}") for start, end in ends]
    return tuned(partial(yaw_plant, force=force), order, "anti", channels, family=family("anti"), min_decay_rate=decay)


def tuned(P: Any, order: int, side: str, channels: list, **options: Any) -> TuneResult:
    """Tune a strictly proper controller of a subsystem."""
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
    """Tune both controllers with the given order and join them into one for the machine."""
    halves = {"jolt": tuned_jolt(order), "yaw": tuned_yaw(order, force=force)}
    facts = {f"{name}: tuned": found.certificate.summary for name, found in halves.items()}
    facts |= {f"{name}: proof in ball arithmetic": bc.prove(found).claim for name, found in halves.items()}
    return SuspensionDesign(
        "tuned_suspension",
        f"Fixed-structure suspension, order {order} for each subsystem",
        controller=bc.join_symmetric(suspension_model(), *(found.controller for found in halves.values())),
        synthesis_info=facts,
    )


def design() -> SuspensionDesign:
    """Return the design with the default order and force scale."""
    return suspension()


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
