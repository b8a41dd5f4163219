"""Four-bar linkage with a flexible coupler: a closed kinematic chain, modeled in three ways.

The crank rotates about A, the rocker about D; the coupler, a beam, is hinged to the crank at B.  The joint at C between
coupler and rocker closes the chain.  It is modeled (a) as a cut joint of the assembly, (b) by prescribing zero relative
displacement at its two constraint forces, (c) by Lagrange multipliers on the open chain.
"""

from dataclasses import dataclass

import numpy as np

from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    CutJoint,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SecondOrderModel,
    SpringDamper,
    prescribe_displacement,
    revolute,
)

SPAN, HEIGHT = 2.0, 0.5
A, D = (-0.3, 0.0), (2.2, -0.2)
COUPLER = BeamSegment(SPAN, mass_per_length=1.2, bending_stiffness=80.0, stiffness_damping=2e-4)
OMEGA = np.linspace(1.0, 60.0, 40)


@dataclass(frozen=True)
class FourBar:
    """Eigenfrequencies [Hz] of the linkage, and largest relative differences between the three models."""

    eigenfrequencies_hz: np.ndarray
    held_against_cut: float
    multipliers_against_cut: float


def linkage(closed: bool) -> Assembly:
    """Return the linkage, closed by a cut joint, or open with the constraint forces of the joint as inputs."""
    crank = RigidBody("crank", GROUND.at(*A), revolute(), mass=1.0, inertia=0.03)
    coupler = Beam("coupler", crank.at(0, HEIGHT), revolute(), (0.0, HEIGHT), (COUPLER,), FiniteElements(8))
    rocker = RigidBody("rocker", GROUND.at(*D), revolute(), mass=1.0, inertia=0.03)
    spring = SpringDamper(crank.at(*A), GROUND.at(*A), "theta", stiffness=40.0, damping=0.05)
    end, head = coupler.end, rocker.at(SPAN, HEIGHT)
    joint_forces = (Force("joint_x", end, "x", head), Force("joint_y", end, "y", head))
    return Assembly(
        bodies=(crank, coupler, rocker),
        springs=(spring,),
        forces=(Force("torque", crank.at(*A), "theta"), *(() if closed else joint_forces)),
        outputs=(
            Output("rocker_angle", rocker.at(*D), "theta"),
            Output("coupler_middle", coupler.at(SPAN / 2)),
        ),
        cut_joints=(CutJoint(end, head),) if closed else (),
    )


def by_multipliers(tree: SecondOrderModel, omega: np.ndarray) -> np.ndarray:
    """Return the frequency response to the torque, (outputs, frequencies), with Lagrange multipliers at the joint."""
    J, drive = tree.ports.B[0][:, 1:], tree.ports.B[0][:, 0]
    response = []
    for w in omega:
        D = tree.K + 1j * w * tree.C - w**2 * tree.M
        system = np.block([[D, J], [J.T, np.zeros((2, 2))]])
        z = np.linalg.solve(system, np.concatenate([drive, np.zeros(2)]).astype(complex))
        response.append(tree.ports.L[0] @ z[: tree.ncoordinates])
    return np.array(response).T


def main() -> FourBar:
    """Compare the frequency responses of the three models to a torque on the crank."""
    cut = linkage(closed=True).assemble()
    tree = linkage(closed=False).assemble()
    held = prescribe_displacement(tree, hold=["joint_x", "joint_y"])
    reference = cut.frequency_response(OMEGA).frdata[:, 0]

    def distance(response: np.ndarray) -> float:
        return float((np.abs(response - reference).max(axis=1) / np.abs(reference).max(axis=1)).max())

    return FourBar(
        cut.eigenfrequencies_hz(4),
        distance(held.frequency_response(OMEGA).frdata[:, 0]),
        distance(by_multipliers(tree, OMEGA)),
    )


if __name__ == "__main__":
    print(main())
