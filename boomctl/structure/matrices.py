"""What of a structure depends neither on its inputs and outputs nor on frequency."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from boomctl.arrays import Matrix
from boomctl.structure.response.pencil import Pencil, stored

if TYPE_CHECKING:
    from boomctl.structure.model import ElasticRows
    from boomctl.structure.symmetry import HalfStructure, Mirror


@dataclass(frozen=True, eq=False)
class Prepared:
    """A structure's matrices, and what follows from them; made when first needed, shared by all choices of signals."""

    M: Matrix
    C: Matrix
    K: Matrix
    coordinates: tuple[str, ...]
    elastic: "ElasticRows | None"
    mirror: "Mirror | None"

    @cached_property
    def symmetric(self) -> bool:
        """Whether the matrices are symmetric and every coordinate has mass."""
        for matrix in (self.M, self.C, self.K):
            if sparse.issparse(matrix):
                full = sparse.csr_array(matrix)
                change, size = np.abs((full - full.T).data), np.abs(full.data)
            else:
                change, size = np.abs(matrix - matrix.T), np.abs(matrix)
            if change.max(initial=0.0) > 1e-12 * size.max(initial=0.0):
                return False
        return bool((self.M.diagonal() > 0).all())

    @cached_property
    def pencil(self) -> Pencil:
        """The matrices, ready to be factorised."""
        n = len(self.coordinates)
        return Pencil.of(*(stored(matrix, n) for matrix in (self.M, self.C, self.K)))

    @cached_property
    def symmetric_half(self) -> "HalfStructure":
        """Half of a symmetric structure, as it moves symmetrically."""
        return self._half(1)

    @cached_property
    def antisymmetric_half(self) -> "HalfStructure":
        """Half of a symmetric structure, as it moves antisymmetrically."""
        return self._half(-1)

    def make_halves(self) -> None:
        """Split a symmetric structure now, so that no later question waits for it."""
        if self.mirror is not None:
            for half in (self.symmetric_half, self.antisymmetric_half):
                if half.prepared.symmetric:
                    _ = half.prepared.pencil

    def _half(self, parity: int) -> "HalfStructure":
        from boomctl.structure.symmetry import half_structure

        return half_structure(self, parity)
