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
from boomctl.synthesis import TuneResult

TABLE_2 = bc.BoomParameters()
RANGES = {
    "spring_stiffness": (550.0, 2200.0),  # half to twice that of Table 2 [N/m]
    "cradle_damping": (20.0, 2000.0),  # [N s/m]
    "hinge_damping": (2.0, 5000.0),  # [N m s/rad]
}
SPRING, MASS = (0.7, 1.3), (0.8, 1.2)  # factors on the spring chosen, and on the boom's mass
HALVES = {"jolt": "sym", "yaw": "anti"}


def box(values: Mapping[str, float], half: str):
    """Return half of a boom with springs and dampers of given values, over the box."""
    return bc.boom_family(replace(TABLE_2, **values), spring=SPRING, mass=MASS, half=half, elements=6)


def made_at(half: str, point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
    """Return the function from springs and dampers to a half at a point of the box, from the platform to the tip."""
    side = HALVES[half]

    def make(values: Mapping[str, float]) -> control.StateSpace:
        machine = scaled_boom(replace(TABLE_2, **values), *point)
        halves = dict(zip(HALVES, bc.split_symmetric(bc.spray_boom(machine, elements=6)), strict=True))
        chosen = bc.select_channels(
            halves[half].to_statespace(states="coordinates"), [f"actuator_{side}"], [f"tip_{side}"]
        )
        return control.ss(chosen.A, chosen.B, chosen.C, chosen.D, inputs=["platform"], outputs=["tip"])

    return make


def proved(values: Mapping[str, float], half: str):
    """Return the worst peak of a half over the box, found and bounded."""
    side = HALVES[half]
    nothing = control.ss([], [], [], [[0.0]], inputs=[f"stroke_{side}"], outputs=[f"suspension_{side}"])
    return bc.worst_case(box(values, half), nothing, f"actuator_{side}", f"tip_{side}")


def tuned(half: str, names: tuple[str, ...], fixed: Mapping[str, float]) -> TuneResult:
    """Return the values of some springs and dampers that make the worst peak of a half least, the others fixed."""

    def made(point: tuple[float, float]) -> Callable[[Mapping[str, float]], control.StateSpace]:
        make = made_at(half, point)
        return lambda values: make({**fixed, **values})

    first, *others = [bc.tunable.physical(name, *RANGES[name]) for name in names]
    plants = [made(point) for point in [(1.0, 1.0), *product(SPRING, MASS)]]
    return bc.tune(plants, 0, 0, sum(others, start=first), starts=2, time_limit=600.0)


def design() -> SuspensionDesign:
    """Return the machine with tuned springs and dampers: spring and cradle by the jolt, then the hinge by the yaw."""
    jolt = tuned("jolt", ("spring_stiffness", "cradle_damping"), {})
    yaw = tuned("yaw", ("hinge_damping",), jolt.physical)
    chosen = {**jolt.physical, **yaw.physical}
    facts = {"jolt: tuned": jolt.certificate.statement, "yaw: tuned": yaw.certificate.statement}
    for name, value in chosen.items():
        facts[name] = f"{value:.4g} (Table 2: {getattr(TABLE_2, name):.4g})"
    for half in HALVES:
        worst = proved(chosen, half)
        facts[f"{half}: worst peak over the box"] = f"{worst.norm.lower:.4g} found, none above {worst.upper_bound:.5g}"
    parameters = replace(TABLE_2, **chosen)
    return SuspensionDesign("tuned_passive", "passive, tuned over the box", parameters=parameters, facts=facts)


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
