"""Generalized plants in the signals and states of the H-infinity and H2 solvers."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import block_diagonal
from boomctl.lti.system import Lti, signal_scales
from boomctl.synthesis.plants.partition import GeneralizedPlant

_MAX_CONDITION = 1e5  # Of the modal basis; modes with nearly dependent eigenvectors share a block.


@dataclass(frozen=True)
class NormalizedPlant(GeneralizedPlant):
    """Plant with ``D12 = [0; I]``, ``D21 = [0, I]``, ``D22 = 0`` and scaled modal states.

    The controller of the original plant is ``from_controls @ K @ from_measurements``, except for the effect of ``D22``.
    Disturbances and performance outputs are only rotated, which preserves norms. Each state is named after the original
    state with the largest participation.
    """

    from_controls: Array
    from_measurements: Array


def normalized(plant: GeneralizedPlant) -> NormalizedPlant:
    """Return the plant in normalized signals and real modal coordinates, scaled with its inputs and outputs.

    ``D12`` must have full column rank and ``D21`` full row rank.
    """
    ncon, nmeas = plant.ncon, plant.nmeas
    left, columns, right = linalg.svd(plant.D12)
    rotate_z = np.hstack([left[:, ncon:], left[:, :ncon]]).T
    from_controls = right.T / columns
    left, rows, right = linalg.svd(plant.D21)
    rotate_w = np.vstack([right[nmeas:], right[:nmeas]]).T
    from_measurements = left.T / rows[:, None]
    B = np.hstack([plant.B1 @ rotate_w, plant.B2 @ from_controls])
    C = np.vstack([rotate_z @ plant.C1, from_measurements @ plant.C2])
    D = np.zeros((len(C), B.shape[1]))
    D[: plant.nz, : plant.nw] = rotate_z @ plant.D11 @ rotate_w
    D[plant.nz - ncon : plant.nz, plant.nw :] = np.eye(ncon)
    D[plant.nz :, plant.nw - nmeas : plant.nw] = np.eye(nmeas)
    d = signal_scales(plant.A, B, C)
    A, columns, _ = block_diagonal(plant.A / d[:, None] * d, _MAX_CONDITION)
    basis, inverse = d[:, None] * columns, (np.linalg.inv(columns) if len(A) else columns) / d
    d = signal_scales(A, inverse @ B, C @ basis)
    names = tuple(plant.system.state_labels[k] for k in np.abs(basis).argmax(axis=0)) if len(A) else ()
    A, B, C = A / d[:, None] * d, inverse @ B / d[:, None], C @ basis * d
    system = Lti(A, B, C, D, state_labels=names, dt=plant.system.dt)
    return NormalizedPlant(system, nmeas, ncon, from_controls, from_measurements)
