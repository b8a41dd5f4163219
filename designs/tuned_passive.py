"""Passive suspension: springs and dampers that minimize the worst-case peak gain over a box of parameters.

`passive_tuning` minimizes the peak gain for the nominal boom of Table 2, one damper at a time; here the spring stiffness is
uncertain by 30 % and the boom mass by 20 %. Springs must carry side wind and slopes, so that the lower bound of the stiffness
is half of Table 2; the optimum is again at this bound. The jolt depends on spring and cradle damper, the yaw on spring and
hinge damper. The jolt has the higher peak, so that the springs are tuned for it.
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
    "spring_stiffness": (550.0, 2200.0),  # 0.5 to 2 times the value of Table 2
    "cradle_damping": (20.0, 2000.0),
    "hinge_damping": (2.0, 5000.0),
}
UNITS = {"spring_stiffness": "N/m", "cradle_damping": "N s/m", "hinge_damping": "N m s/rad"}
SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # ranges of the factors on spring stiffness and boom mass
HALVES = {"jolt": "sym", "yaw": "anti"}


def made_at(half: str, point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return a function that maps springs and dampers to a subsystem, platform to tip, at a point of the box."""
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
    """Tune the named springs and dampers for the smallest worst-case peak of a subsystem, with the others fixed."""

    def made(point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
        make = made_at(half, point)
        return lambda values: make({**fixed, **values})

    first, *others = [bc.tunable.plant_parameter(name, *RANGES[name]) for name in names]
    plants = [made(point) for point in [(1.0, 1.0), *product(SPRING, MASS)]]
    return bc.tune(plants, 0, 0, sum(others, start=first), n_starts=2, time_limit=600.0)


def design() -> SuspensionDesign:
    """Tune springs and cradle damper for the jolt, then the hinge damper for the yaw."""
    jolt = tuned("jolt", ("spring_stiffness", "cradle_damping"), {})
    yaw = tuned("yaw", ("hinge_damping",), jolt.plant_parameters)
    chosen = {**jolt.plant_parameters, **yaw.plant_parameters}
    facts = {"jolt: tuned": jolt.certificate.summary, "yaw: tuned": yaw.certificate.summary}
    facts |= {f"{n}: proof in ball arithmetic": bc.prove(x).claim for n, x in (("jolt", jolt), ("yaw", yaw))}
    for name, value in chosen.items():
        facts[name.replace("_", " ")] = f"{value:.4g} {UNITS[name]} (Table 2: {getattr(TABLE_2, name):.4g})"
    parameters = replace(TABLE_2, **chosen)
    return SuspensionDesign(
        "tuned_passive",
        "Passive suspension with minimum worst-case peak gain",
        parameters=parameters,
        synthesis_info=facts,
    )


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
