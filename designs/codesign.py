"""Dampers and controllers at once, over a box of springs and boom masses: cradle with jolt, hinge with yaw.

What a damper does, no force has to: for the yaw a controller of two states is enough, for the jolt one of three.  The jolt
decides on the spray: its H2 norm of tip and force is least while its peak keeps a limit at the middle and the corners of the
box.  The yaw's peak is brought down there as far as the force may follow the platform and the loop at the control keeps its
distance, as in `tuned_suspension`.
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
SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # of Table 2, over which is tuned
POINTS = ((1.0, 1.0), *product(SPRING, MASS))  # middle and corners
MEASURED = ("stroke", "tip_acceleration")
DAMPER = {"sym": ("cradle_damping", 20.0, 1000.0), "anti": ("hinge_damping", 2.0, 2000.0)}  # [N s/m], [N m s/rad]
ORDER = {"sym": 3, "anti": 2}
FASTEST = {"sym": 50.0, "anti": 30.0}  # largest magnitude of a controller's poles [rad/s]
SECONDS = 600.0  # far above what is taken: the starts decide, not the clock
LIMIT = 7.7  # of the jolt's peak at the points, tip over platform; the yaw's static gain is 6.74 already (a choice)
CORNERS = 0.7  # what disturbances at the corners count for the H2 norm, of those in the middle
NOISE = {"stroke": 0.005, "tip_acceleration": 0.5}  # of the jolt, beside 0.03 m of platform and 7.5 N of disturbance
PEAK, FORCE, LOOP = 9.3, 1800.0, 2.0  # of the yaw: tip and force [N/m] over platform, force over force: sizes alike
DECAY = 0.02  # slowest decay of the yaw [1/s]; an integrator would do as well, and never settle


def half(side: str, values: Mapping[str, float], point: tuple[float, float]) -> control.StateSpace:
    """Return half of the boom with a damper, at a point of the box, over the same coordinates at all of them.

    The platform's motion is there once more, as ``platform``: what the limit is for is not filtered.
    """
    machine = scaled_boom(replace(TABLE_2, **values), *point)
    found = bc.split_symmetric(suspension_model(machine, elements=6))[side == "anti"]
    s = found.to_statespace(states="coordinates")
    again = [*range(s.ninputs), s.input_labels.index(f"actuator_{side}")]
    names = {"inputs": [*s.input_labels, "platform"], "outputs": s.output_labels}
    return control.ss(s.A, s.B[:, again], s.C, s.D[:, again], **names)


def plant(side: str, point: tuple[float, float], **signals: Any) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return the function from a damper to the generalized plant of a half at a point."""
    chosen: dict[str, Any] = {
        "measurements": [f"{stem}_{side}" for stem in MEASURED],
        "controls": [f"suspension_{side}"],
    }
    return lambda values: bc.generalized_plant(half(side, values, point), **chosen, **signals)


def jolt_plant(point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return the jolt with its weights; the force costs more above 15 rad/s."""
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
    """Return the yaw in such units that its three channels come out alike."""
    return plant(
        "anti",
        point,
        disturbances={"platform": 1.0, "suspension_anti": FORCE / LOOP},
        performance={"tip_anti": 1.0},
        effort={"suspension_anti": PEAK / FORCE},
    )


def tuned_jolt(limit: float = LIMIT) -> TuneResult:
    """Return the cradle's damper and the jolt's controller: the H2 norm, the largest of the points, and a limited peak."""
    weighed = ["w_actuator_sym", "w_suspension_sym", *(f"n_{stem}_sym" for stem in MEASURED)]
    peak = bc.tunable.constraint("w_platform", "z_tip_sym", 15.0 * limit)
    return tuned("sym", jolt_plant, [bc.tunable.objective(weighed, norm="h2"), peak], n_starts=1)


@cache
def tuned_yaw() -> TuneResult:
    """Return the hinge's damper and the yaw's controller: peaks from platform to tip and force, and round the control."""
    ends = [("platform", "tip_anti"), ("platform", "suspension_anti"), ("suspension_anti", "suspension_anti")]
    channels = [bc.tunable.objective(f"w_{start}", f"z_{end}") for start, end in ends]
    return tuned("anti", yaw_plant, channels, n_starts=1, min_decay_rate=DECAY)


def tuned(side: str, plant_at: Callable, channels: list, **options: Any) -> TuneResult:
    """Return the damper and a strictly proper controller of a half."""
    structure = bc.tunable.state_space(ORDER[side], strictly_proper=True) + bc.tunable.plant_parameter(*DAMPER[side])
    fixed: dict[str, Any] = {"channels": channels, "seed": 1, "fastest_pole": FASTEST[side], "time_limit": SECONDS}
    return bc.tune([plant_at(point) for point in POINTS], 2, 1, structure, **fixed, **options)


def suspension(limit: float = LIMIT) -> SuspensionDesign:
    """Return the machine with both dampers, and both halves' controllers joined into one of it."""
    halves = {"jolt": tuned_jolt(limit), "yaw": tuned_yaw()}
    facts = {f"{name}: tuned": found.certificate.summary for name, found in halves.items()}
    facts |= {f"{name}: proved in ball arithmetic": bc.prove(found).claim for name, found in halves.items()}
    chosen = {name: value for found in halves.values() for name, value in found.plant_parameters.items()}
    for name, value in chosen.items():
        facts[name] = f"{value:.4g} (Table 2: {getattr(TABLE_2, name):.4g})"
    parameters = replace(TABLE_2, **chosen)
    return SuspensionDesign(
        "codesign",
        "Suspension with dampers and controllers tuned together",
        parameters=parameters,
        controller=bc.join_symmetric(suspension_model(parameters), *(found.controller for found in halves.values())),
        synthesis_info=facts,
        notes=(
            f"The cradle's damper goes with a controller of {ORDER['sym']} states, the hinge's with one of {ORDER['anti']}.",
            f"The hinge's damper is {parameters.hinge_damping / TABLE_2.hinge_damping:.0f} times that of Table 2: a part to"
            " be added. With it the yaw is overdamped; springs up to the measured 0.34 Hz are those that bring the boom"
            " there with the dampers of Table 2.",
        ),
    )


def design() -> SuspensionDesign:
    """Return the suspension that the folder is about."""
    return suspension()


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
