"""Springs and dampers alone, tuned for the largest peak over a box of springs and boom masses, and what is proved of it.

`passive_tuning` does it for the boom of Table 2, a damper at a time; here springs may turn out 30 % softer or stiffer and the
boom 20 % lighter or heavier. Springs carry side wind and slopes: half of Table 2 is the least allowed, and again it is what
the peak asks for. The jolt depends on spring and cradle, the yaw on spring and hinge, and the jolt's peak is the higher one.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product

import control

import boomctl as bc
from boomctl.boom.families import scaled_boom
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult
from boomctl.tuning import TuneResult

TABLE_2 = bc.BoomParameters()
RANGES = {
    "spring_stiffness": (550.0, 2200.0),  # half to twice that of Table 2
    "cradle_damping": (20.0, 2000.0),
    "hinge_damping": (2.0, 5000.0),
}
UNITS = {"spring_stiffness": "N/m", "cradle_damping": "N s/m", "hinge_damping": "N m s/rad"}
SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # factors on the spring chosen, and on the boom's mass
HALVES = {"jolt": "sym", "yaw": "anti"}


def made_at(half: str, point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return the function from springs and dampers to a half at a point of the box, from the platform to the tip."""
    side = HALVES[half]

    def make(values: Mapping[str, float]) -> control.StateSpace:
        machine = scaled_boom(replace(TABLE_2, **values), *point)
        halves = dict(zip(HALVES, bc.split_symmetric(bc.spray_boom(machine, elements=6)), strict=True))
        chosen = bc.synthesis.select_channels(
            halves[half].to_statespace(states="coordinates"), [f"actuator_{side}"], [f"tip_{side}"]
        )
        return control.ss(chosen.A, chosen.B, chosen.C, chosen.D, inputs=["platform"], outputs=["tip"])

    return make


def tuned(half: str, names: tuple[str, ...], fixed: Mapping[str, float]) -> TuneResult:
    """Return the values of some springs and dampers that make the worst peak of a half least, the others fixed."""

    def made(point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
        make = made_at(half, point)
        return lambda values: make({**fixed, **values})

    first, *others = [bc.tunable.plant_parameter(name, *RANGES[name]) for name in names]
    plants = [made(point) for point in [(1.0, 1.0), *product(SPRING, MASS)]]
    return bc.tune(plants, 0, 0, sum(others, start=first), n_starts=2, time_limit=600.0)


def design() -> SuspensionDesign:
    """Return the machine with tuned springs and dampers: spring and cradle by the jolt, then the hinge by the yaw."""
    jolt = tuned("jolt", ("spring_stiffness", "cradle_damping"), {})
    yaw = tuned("yaw", ("hinge_damping",), jolt.plant_parameters)
    chosen = {**jolt.plant_parameters, **yaw.plant_parameters}
    facts = {"jolt: tuned": jolt.certificate.summary, "yaw: tuned": yaw.certificate.summary}
    facts |= {f"{n}: proved in ball arithmetic": bc.prove(x).claim for n, x in (("jolt", jolt), ("yaw", yaw))}
    for name, value in chosen.items():
        facts[name.replace("_", " ")] = f"{value:.4g} {UNITS[name]} (Table 2: {getattr(TABLE_2, name):.4g})"
    parameters = replace(TABLE_2, **chosen)
    return SuspensionDesign(
        "tuned_passive",
        "Passive suspension tuned over a box of parameters",
        parameters=parameters,
        synthesis_info=facts,
    )


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
