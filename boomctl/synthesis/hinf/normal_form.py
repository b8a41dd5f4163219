"""Generalized plants in the signals and states that H-infinity solvers work with."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.lti.modal import block_diagonal
from boomctl.lti.rounding import ROOT
from boomctl.lti.system import Lti, signal_scales
from boomctl.synthesis.plants.partition import GeneralizedPlant

_INDEPENDENT = 1e5  # condition of a basis above which its columns count as dependent: half of all digits are then left


@dataclass(frozen=True)
class NormalizedPlant(GeneralizedPlant):
    """A plant with ``D12 = [0; I]``, ``D21 = [0, I]``, ``D22 = 0`` and modes of like size.

    The controller of the plant is ``from_controls @ K @ from_measurements``, its ``D22`` apart; the states of the plant
    are ``modes`` times those in here, which are each named after the state of the plant that takes the largest part in
    them.  Disturbances and performance signals are only rotated, so no norm changes.
    """

    from_controls: Array
    from_measurements: Array
    modes: Array

    @property
    def reordered(self) -> "NormalizedPlant":
        """The plant with its states in reverse order and other scales: what rounding spoils in one the other may bear."""
        s = self.system
        A, B, C = s.A[::-1, ::-1], s.B[::-1], s.C[:, ::-1]
        scale = signal_scales(A, B, C)
        A, B, C = A / scale[:, None] * scale, B / scale[:, None], C * scale
        system = replace(s, A=A, B=B, C=C, state_labels=s.state_labels[::-1])
        return replace(self, system=system, modes=self.modes[:, ::-1] * scale)


def normalized(plant: GeneralizedPlant) -> NormalizedPlant:
    """Return the plant in normalized signals and, where its eigenvectors allow, in real modal coordinates.

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
    modes = _modal_basis(plant.A, B, C)
    lengths = np.linalg.norm(modes, axis=0)  # those of modes hardly driven or seen differ by many decades
    inverse = np.linalg.inv(modes / lengths) / lengths[:, None] if len(modes) else modes
    names = tuple(plant.system.state_labels[k] for k in np.abs(modes).argmax(axis=0)) if len(modes) else ()
    system = Lti(inverse @ plant.A @ modes, inverse @ B, C @ modes, D, state_labels=names, dt=plant.system.dt)
    return NormalizedPlant(system, nmeas, ncon, from_controls, from_measurements, modes)


def _modal_basis(A: Array, B: Array, C: Array) -> Array:
    """Return real columns that span the modes of ``A``, each scaled so that it is driven as much as it is seen.

    Modes whose eigenvectors hardly differ (integrator chains, double poles) stay together in a block.
    """
    if not len(A):
        return np.zeros((0, 0))
    values, vectors = linalg.eig(A)
    blocks = [
        [v.real, v.imag] if value.imag > 0.0 else [v.real]
        for value, v in zip(values, vectors.T, strict=True)
        if value.imag >= 0.0
    ]
    basis = np.array([column for block in blocks for column in block]).T
    widths = [len(block) for block in blocks]
    # a double pole that rounding split into a complex pair: the imaginary part of the eigenvector is rounding
    double = ((values.imag > 0.0) & (values.imag <= ROOT * np.abs(values))).any()
    if double or basis.shape != A.shape or np.linalg.cond(basis / np.linalg.norm(basis, axis=0)) > _INDEPENDENT:
        basis, widths = _blocks(A)
    B, C = np.linalg.solve(basis, B), C @ basis
    start = 0
    for width in widths:
        block = slice(start, start + width)
        driven, seen = np.linalg.norm(B[block]), np.linalg.norm(C[:, block])
        if driven > 0.0 and seen > 0.0:
            basis[:, block] *= np.sqrt(driven / seen)
        start += width
    return basis


def _blocks(A: Array) -> tuple[Array, list[int]]:
    """Return columns that bring ``A`` to diagonal blocks without being near to dependent, and the blocks' widths."""
    balanced, scale = balance(A)
    blocks, columns, widths = block_diagonal(balanced, _INDEPENDENT)
    basis, start = scale[:, None] * columns, 0
    for width in widths:
        part = slice(start, start + width)
        basis[:, part] *= balance(blocks[part, part])[1]
        start += width
    return basis, widths
