"""A generalised plant cut into its blocks, in coordinates that solvers can work with."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import finite_array, whole
from boomctl.lti.system import Lti

if TYPE_CHECKING:
    import control

_INDEPENDENT = 1e5


@dataclass(frozen=True)
class Plant:
    """``x' = A x + B1 w + B2 u``, ``z = C1 x + D11 w + D12 u``, ``y = C2 x + D21 w + D22 u``, every signal named."""

    A: Array
    B1: Array
    B2: Array
    C1: Array
    C2: Array
    D11: Array
    D12: Array
    D21: Array
    D22: Array
    disturbances: tuple[str, ...]
    controls: tuple[str, ...]
    performance: tuple[str, ...]
    measurements: tuple[str, ...]
    states: tuple[str, ...]


@dataclass(frozen=True)
class Normalised:
    """A plant with ``D12 = [0; I]``, ``D21 = [0, I]``, ``D22 = 0`` and modes of like size.

    The controller of the plant is ``from_controls @ K @ from_measurements``, its ``D22`` apart; the states of the plant
    are ``modes`` times those in here.  Disturbances and performance signals are only rotated, so no norm changes.
    """

    A: Array
    B1: Array
    B2: Array
    C1: Array
    C2: Array
    D11: Array
    from_controls: Array
    from_measurements: Array
    modes: Array

    @property
    def D12(self) -> Array:
        """Performance signals of the controls."""
        count = self.B2.shape[1]
        return np.vstack([np.zeros((len(self.C1) - count, count)), np.eye(count)])

    @property
    def D21(self) -> Array:
        """Measurements of the disturbances."""
        count = len(self.C2)
        return np.hstack([np.zeros((count, self.B1.shape[1] - count)), np.eye(count)])


def partition(P: "control.StateSpace", nmeas: int, ncon: int) -> Plant:
    """Return the blocks of a generalised plant whose last outputs are measured and whose last inputs are controls.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; counts that leave no disturbance or no performance signal.
    """
    from boomctl.lti.python_control import control

    if not isinstance(P, control.StateSpace):
        raise TypeError(f"P: expected a StateSpace, got {type(P).__name__}")
    if not P.isctime():
        raise ValueError(f"P: expected continuous time, got a sampling time of {P.dt:g} s")
    if whole("nmeas", nmeas) >= P.noutputs:
        raise ValueError(
            f"nmeas = {nmeas}: P has {P.noutputs} output(s), and at least one must be a performance signal"
        )
    if whole("ncon", ncon) >= P.ninputs:
        raise ValueError(f"ncon = {ncon}: P has {P.ninputs} input(s), and at least one must be a disturbance")
    m, p = P.ninputs - ncon, P.noutputs - nmeas
    A, B, C, D = (finite_array(f"{name} of P", getattr(P, name), 2) for name in "ABCD")
    ins, outs = tuple(P.input_labels), tuple(P.output_labels)
    return Plant(
        A, B[:, :m], B[:, m:], C[:p], C[p:], D[:p, :m], D[:p, m:], D[p:, :m], D[p:, m:],
        ins[:m], ins[m:], outs[:p], outs[p:], tuple(P.state_labels),
    )  # fmt: skip


def normalised(plant: Plant) -> Normalised:
    """Return the plant in normalised signals and, where its eigenvectors allow, in real modal coordinates.

    ``D12`` must have full column rank and ``D21`` full row rank.
    """
    left, columns, right = linalg.svd(plant.D12)
    ncon, nmeas = len(columns), len(plant.D21)
    rotate_z = np.hstack([left[:, ncon:], left[:, :ncon]]).T
    from_controls = right.T / columns
    left, rows, right = linalg.svd(plant.D21)
    rotate_w = np.vstack([right[nmeas:], right[:nmeas]]).T
    from_measurements = left.T / rows[:, None]
    B1, B2 = plant.B1 @ rotate_w, plant.B2 @ from_controls
    C1, C2 = rotate_z @ plant.C1, from_measurements @ plant.C2
    modes = modal_basis(plant.A, np.hstack([B1, B2]), np.vstack([C1, C2]))
    inverse: Any = linalg.inv(modes) if len(modes) else modes
    return Normalised(
        inverse @ plant.A @ modes, inverse @ B1, inverse @ B2, C1 @ modes, C2 @ modes,
        rotate_z @ plant.D11 @ rotate_w, from_controls, from_measurements, modes,
    )  # fmt: skip


def modal_basis(A: Array, B: Array, C: Array) -> Array:
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
    if basis.shape != A.shape or np.linalg.cond(basis / np.linalg.norm(basis, axis=0)) > _INDEPENDENT:
        basis, widths = _blocks(A)
    return basis * _even(np.linalg.solve(basis, B), C @ basis, widths)


def _blocks(A: Array) -> tuple[Array, list[int]]:
    """Return columns that bring ``A`` to diagonal blocks without being near to dependent, and the blocks' widths."""
    from boomctl.lti.python_control import control

    balanced, (scale, _) = linalg.matrix_balance(A, permute=False, separate=True)
    blocks, columns, widths = control.bdschur(balanced, condmax=_INDEPENDENT)
    basis, start = np.asarray(scale)[:, None] * np.asarray(columns), 0
    for width in map(int, widths):
        part = slice(start, start + width)
        _, (inner, _) = linalg.matrix_balance(blocks[part, part], permute=False, separate=True)
        basis[:, part] *= inner
        start += width
    return basis, [int(width) for width in widths]


def _even(B: Array, C: Array, widths: list[int]) -> Array:
    """Return a factor for each state, one for each block, with which its input and output have the same size."""
    factors, start = np.ones(len(B)), 0
    for width in widths:
        block = slice(start, start + width)
        driven, seen = np.linalg.norm(B[block]), np.linalg.norm(C[:, block])
        if driven > 0.0 and seen > 0.0:
            factors[block] = np.sqrt(driven / seen)
        start += width
    return factors


def blocks_of(plant: Plant) -> Lti:
    """Return the plant's matrices, unpartitioned."""
    D = np.block([[plant.D11, plant.D12], [plant.D21, plant.D22]])
    return Lti(plant.A, np.hstack([plant.B1, plant.B2]), np.vstack([plant.C1, plant.C2]), D)
