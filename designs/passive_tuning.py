"""Passive suspension: springs, cradle damper and hinge damper that minimize the verified peak gain from platform to tips.

By symmetry the peak is the larger of two: the peak of the jolt depends on spring and cradle damper, the peak of the yaw on
spring and hinge damper. For each spring stiffness the two dampers are tuned separately. The peak decreases with decreasing
stiffness toward the static gain; springs must carry side wind and slopes, so that the lower bound is half of Table 2.
"""

from dataclasses import replace

import numpy as np
from scipy import optimize

import boomctl as bc
from boomctl.studies.suspension import SuspensionDesign, SuspensionResult

TABLE_2 = bc.BoomParameters()
STIFFNESS = (0.5 * TABLE_2.spring_stiffness, 2.0 * TABLE_2.spring_stiffness)  # [N/m]
CRADLE = (20.0, 2000.0)  # [N s/m]
HINGE = (2.0, 5000.0)  # [N m s/rad]
ELEMENTS = 10


def peaks(p: bc.BoomParameters) -> tuple[float, float]:
    """Return the verified peak gains of jolt and yaw."""
    jolt, yaw = bc.split_symmetric(bc.spray_boom(p, elements=ELEMENTS))
    found = [bc.sigma(half, inputs=f"actuator_{s}", outputs=f"tip_{s}") for half, s in ((jolt, "sym"), (yaw, "anti"))]
    return found[0].peak, found[1].peak


def tuned(stiffness: float) -> tuple[bc.BoomParameters, float]:
    """Return the optimal dampers for a spring stiffness, and the peak gain with them."""
    p = replace(TABLE_2, spring_stiffness=stiffness)

    def least(name: str, limits: tuple[float, float], which: int) -> optimize.OptimizeResult:
        return optimize.minimize_scalar(
            lambda x: np.log(peaks(replace(p, **{name: float(np.exp(x))}))[which]),
            bounds=np.log(limits),
            method="bounded",
            options={"xatol": 1e-4},
        )

    cradle, hinge = least("cradle_damping", CRADLE, 0), least("hinge_damping", HINGE, 1)
    best = replace(p, cradle_damping=float(np.exp(cradle.x)), hinge_damping=float(np.exp(hinge.x)))
    return best, max(peaks(best))


def design() -> SuspensionDesign:
    """Tune springs and dampers."""
    tried = {k: tuned(float(k)) for k in np.geomspace(*STIFFNESS, 3)}
    p, peak = min(tried.values(), key=lambda found: found[1])
    facts = {f"spring of {k:.0f} N/m": f"peak gain {value:.2f} with optimal dampers" for k, (_, value) in tried.items()}
    facts["chosen"] = (
        f"k_s = {p.spring_stiffness:.0f} N/m, c_g = {p.cradle_damping:.1f} N s/m, c_t = {p.hinge_damping:.0f} N m s/rad"
        f" (Table 2: {TABLE_2.spring_stiffness:.0f}, {TABLE_2.cradle_damping:.0f}, {TABLE_2.hinge_damping:.0f}): {peak:.2f}"
    )
    return SuspensionDesign(
        "passive_tuning", "Passive suspension with minimum peak gain", parameters=p, synthesis_info=facts
    )


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
