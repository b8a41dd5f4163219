"""Co-design of dampers and controllers over a box of spring stiffness and boom mass.

The cradle damper is tuned together with the jolt controller, the hinge damper together with the yaw controller.  With tuned
dampers, controllers of low order are sufficient: three states for the jolt, two for the yaw.  The jolt determines the spray
distribution: the H2 norm of tip displacement and force is minimized, with a constraint on the peak gain at the center and the
corners of the box.  For the yaw, the peaks from platform to tip, from platform to force and of the loop at the control are
minimized at the same points, as in `tuned_suspension`.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import control

import boomctl as bc
from boomctl.boom.families import scaled_boom
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult, suspension_model
from boomctl.tuning import TuneResult

TABLE_2 = bc.BoomParameters()
SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # ranges of the factors on the values of Table 2
POINTS = ((1.0, 1.0), *product(SPRING, MASS))  # center and corners of the box
MEASURED = ("stroke", "tip_acceleration")
DAMPER = {"sym": ("cradle_damping", 20.0, 1000.0), "anti": ("hinge_damping", 2.0, 2000.0)}  # [N s/m], [N m s/rad]
ORDER = {"sym": 3, "anti": 2}
FASTEST = {"sym": 50.0, "anti": 30.0}  # largest magnitude of a controller's poles [rad/s]
SECONDS = 600.0  # time limit; not reached, so that the result does not depend on the run time
LIMIT = 7.7  # on the peak gain of the jolt, platform to tip, at each point; the static gain of the yaw is 6.74
CORNERS = 0.7  # weight of the corners in the H2 norm, relative to the center
# noise of the jolt; its disturbances are 0.03 m at the platform and 7.5 N at the control
NOISE = {"stroke": 0.005, "tip_acceleration": 0.5}
# channel scales of the yaw: platform to tip, platform to force [N/m], force to force
PEAK, FORCE, LOOP = 9.3, 1800.0, 2.0
DECAY = 0.02  # minimum decay rate of the yaw [1/s]; excludes poles near zero, which do not settle


def half(side: str, values: Mapping[str, float], point: tuple[float, float]) -> control.StateSpace:
    """Return a subsystem of the boom with a damper, at a point of the box, in the same coordinates at all points.

    The platform motion has a second, unfiltered input ``platform``, on which the peak constraint is defined.
    """
    machine = scaled_boom(replace(TABLE_2, **values), *point)
    found = bc.split_symmetric(suspension_model(machine, elements=6))[side == "anti"]
    s = found.to_statespace(states="coordinates")
    again = [*range(s.ninputs), s.input_labels.index(f"actuator_{side}")]
    names = {"inputs": [*s.input_labels, "platform"], "outputs": s.output_labels}
    return control.ss(s.A, s.B[:, again], s.C, s.D[:, again], **names)


def plant(side: str, point: tuple[float, float], **signals: Any) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return a function that maps a damper to the generalized plant of a subsystem at a point."""
    chosen: dict[str, Any] = {
        "measurements": [f"{stem}_{side}" for stem in MEASURED],
        "controls": [f"suspension_{side}"],
    }
    return lambda values: bc.generalized_plant(half(side, values, point), **chosen, **signals)


def jolt_plant(point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return the weighted jolt plant; the effort weight increases around 15 rad/s."""
    share = 1.0 if point == POINTS[0] else CORNERS
    return plant(
        "sym",
        point,
        disturbances={"actuator_sym": bc.low_pass(0.03 * share, 4.0), "suspension_sym": 7.5 * share, "platform": 1.0},
        performance={"tip_sym": 15.0},
        effort={"suspension_sym": bc.shelf(4.0 / 150.0, 20.0 / 150.0, 15.0)},
        noise={f"{stem}_sym": size * share for stem, size in NOISE.items()},
    )


def yaw_plant(point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return the yaw plant, scaled so that its three channels have similar norms."""
    return plant(
        "anti",
        point,
        disturbances={"platform": 1.0, "suspension_anti": FORCE / LOOP},
        performance={"tip_anti": 1.0},
        effort={"suspension_anti": PEAK / FORCE},
    )


def tuned_jolt(limit: float = LIMIT) -> TuneResult:
    """Tune cradle damper and jolt controller: minimize the largest H2 norm over the points, with limited peak gain."""
    weighed = ["w_actuator_sym", "w_suspension_sym", *(f"n_{stem}_sym" for stem in MEASURED)]
    peak = bc.tunable.constraint("w_platform", "z_tip_sym", 15.0 * limit)
    return tuned("sym", jolt_plant, [bc.tunable.objective(weighed, norm="h2"), peak], n_starts=1)


@cache
def tuned_yaw() -> TuneResult:
    """Tune hinge damper and yaw controller: minimize the peaks from platform to tip and force, and at the control."""
    ends = [("platform", "tip_anti"), ("platform", "suspension_anti"), ("suspension_anti", "suspension_anti")]
    channels = [bc.tunable.objective(f"w_{start}", f"z_{end}") for start, end in ends]
    return tuned("anti", yaw_plant, channels, n_starts=1, min_decay_rate=DECAY)


def tuned(side: str, plant_at: Callable, channels: list, **options: Any) -> TuneResult:
    """Tune the damper and a strictly proper controller of a subsystem."""
    structure = bc.tunable.state_space(ORDER[side], strictly_proper=True) + bc.tunable.plant_parameter(*DAMPER[side])
    fixed: dict[str, Any] = {"channels": channels, "seed": 1, "fastest_pole": FASTEST[side], "time_limit": SECONDS}
    return bc.tune([plant_at(point) for point in POINTS], 2, 1, structure, **fixed, **options)


def suspension(limit: float = LIMIT) -> SuspensionDesign:
    """Return the machine with both dampers and the joined controllers of jolt and yaw."""
    halves = {"jolt": tuned_jolt(limit), "yaw": tuned_yaw()}
    facts = {f"{name}: tuned": found.certificate.summary for name, found in halves.items()}
    facts |= {f"{name}: proof in ball arithmetic": bc.prove(found).claim for name, found in halves.items()}
    chosen = {name: value for found in halves.values() for name, value in found.plant_parameters.items()}
    for name, value in chosen.items():
        facts[name] = f"{value:.4g} (Table 2: {getattr(TABLE_2, name):.4g})"
    parameters = replace(TABLE_2, **chosen)
    return SuspensionDesign(
        "codesign",
        "Co-design of suspension dampers and controllers",
        parameters=parameters,
        controller=bc.join_symmetric(suspension_model(parameters), *(found.controller for found in halves.values())),
        synthesis_info=facts,
        notes=(
            f"The controller of the jolt has {ORDER['sym']} states, that of the yaw {ORDER['anti']}.",
            f"The hinge damping is {parameters.hinge_damping / TABLE_2.hinge_damping:.0f} times that of Table 2 and requires"
            " an additional damper. With it the yaw is overdamped; the stiffness range up to the measured 0.34 Hz is"
            " therefore computed with the dampers of Table 2.",
        ),
    )


def design() -> SuspensionDesign:
    """Return the design with the default peak limit."""
    return suspension()


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
