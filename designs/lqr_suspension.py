"""LQR suspension: the state feedback of least tip displacement, tip velocity and force, if all states were measured.

No sensor reads the states of a boom; this design tells what the others can be measured by. It lives on its own plant, a
coarse finite element model that also puts out its states, over springs and masses as the other designs are judged.
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
TIP, TIP_SPEED, FORCE = 0.2, 0.2, 60.0  # what counts as one [m], [m/s], [N]


def boom(values: Mapping[str, float]) -> SecondOrderModel:
    """Return the boom with other springs and another mass, nozzles among its outputs, without accelerometers."""
    model = suspension_model(scaled_boom(bc.BoomParameters(), **values), ELEMENTS, nozzles=True)
    return model.select(None, [name for name in model.output_labels if name not in ACCELERATIONS])


def design() -> SuspensionDesign:
    """Return the regulator and its plant."""
    family = bc.with_state_outputs(AffineFamily.from_function({"spring_factor": SPRING, "mass_factor": MASS}, boom))
    plant = family.nominal.to_statespace()
    tips = np.asarray(plant.C)[[plant.output_labels.index(name) for name in ("tip_left", "tip_right")]]
    speeds = tips @ plant.A
    Q = tips.T @ tips / TIP**2 + speeds.T @ speeds / TIP_SPEED**2
    regulator = bc.lqr(plant, Q, 1.0 / FORCE**2, controls=CONTROLS)
    certificate = regulator.certificate
    assert certificate.regulator_riccati is not None  # every regulator has its solution; other designs have none
    return SuspensionDesign(
        "lqr_suspension",
        "LQR suspension, all states measured",
        controller=regulator.controller,
        plant=family,
        synthesis_info={
            "Riccati residual": f"{certificate.regulator_riccati.residual:.2g} relative",
            "return difference": f"{certificate.min_return_difference:.6f} at least (1 by Kalman's inequality)",
            "proved in ball arithmetic": bc.prove(regulator).claim,
            "slowest pole": f"{regulator.poles.real.max():.3g} rad/s",
        },
        notes=("All states are taken to be measured, without error: a yardstick, not a suspension to be built.",),
    )


def main() -> SuspensionResult:
    """Return what the suspension is worth."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
