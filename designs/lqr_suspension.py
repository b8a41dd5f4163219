"""LQR suspension: state feedback that minimizes tip displacement, tip velocity and force, with all states measured.

The states of the boom cannot be measured; this design is a reference for the others. Its plant is a coarse finite element
model with state outputs, as a family over the same ranges of spring stiffness and boom mass as the other designs.
"""

from collections.abc import Mapping

import numpy as np

import boomctl as bc
from boomctl.boom.families import scaled_boom
from boomctl.structure import AffineFamily, SecondOrderModel
from boomctl.studies.suspension import (
    ACCELERATIONS,
    CONTROLS,
    MASS,
    SPRING,
    SuspensionDesign,
    SuspensionResult,
    suspension_model,
)

ELEMENTS = 6
TIP, TIP_SPEED, FORCE = 0.2, 0.2, 60.0  # values scaled to one [m], [m/s], [N]


def boom(values: Mapping[str, float]) -> SecondOrderModel:
    """Return the boom with scaled springs and mass, with nozzle outputs and without accelerometers."""
    model = suspension_model(scaled_boom(bc.BoomParameters(), **values), ELEMENTS, nozzles=True)
    return model.select(None, [name for name in model.output_labels if name not in ACCELERATIONS])


def design() -> SuspensionDesign:
    """Design the state feedback and its plant family."""
    family = bc.with_state_outputs(AffineFamily.from_function({"spring_factor": SPRING, "mass_factor": MASS}, boom))
    plant = family.nominal.to_statespace()
    tips = np.asarray(plant.C)[[plant.output_labels.index(name) for name in ("tip_left", "tip_right")]]
    speeds = tips @ plant.A
    Q = tips.T @ tips / TIP**2 + speeds.T @ speeds / TIP_SPEED**2
    regulator = bc.lqr(plant, Q, 1.0 / FORCE**2, controls=CONTROLS)
    certificate = regulator.certificate
    assert certificate.regulator_riccati is not None  # set for every regulator; None for other designs
    return SuspensionDesign(
        "lqr_suspension",
        "LQR suspension, all states measured",
        controller=regulator.controller,
        plant=family,
        synthesis_info={
            "Riccati residual": f"{certificate.regulator_riccati.residual:.2g} relative",
            "return difference": f"minimum {certificate.min_return_difference:.6f} (Kalman's inequality: at least 1)",
            "proof in ball arithmetic": bc.prove(regulator).claim,
            "slowest pole": f"{regulator.poles.real.max():.3g} rad/s",
        },
        notes=("All states are assumed to be measured without error. This design is a reference, not implementable.",),
    )


def main() -> SuspensionResult:
    """Evaluate the suspension."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
