"""A structure without its inputs and outputs: mass, damping and stiffness, and what follows from them alone.

:class:`Structure` is what the numerics of a structure take, beside the :class:`~boomctl.structure.ports.Ports` through
which it is driven and read.  Models that differ only in inputs and outputs share one, and with it what was computed
once: the pencil ready to be factorised, the symmetric and the antisymmetric half.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from boomctl.arrays import Array, Matrix
from boomctl.structure.ports import Ports
from boomctl.structure.response.pencil import Pencil, stored
from boomctl.structure.symmetry import TOLERANCE, Mirror, half_matrix, half_rows

DENSE_LIMIT = (  # coordinates up to which matrices are stored dense: products cost half of sparse ones (measured)
    64  # coordinates up to which matrices are stored dense: a sparse product of that size costs more (measured)
)
_SYMMETRIC = 1e-12  # change under transposition, of the largest entry, that is rounding: some 1e4 eps


@dataclass(frozen=True)
class ElasticRows:
    """Stiffness and damping as sums over rows: ``K = R^T diag(k) R``, ``C = R^T diag(c) R``.

    Kept beside the matrices because ``R v`` loses no digits where ``K v`` does: the strain of a fine mesh that moves
    as a whole is a difference of near-equal displacements, its stiffness a difference of huge near-equal forces.
    """

    R: sparse.csr_array
    k: Array
    c: Array

    def _sum(self, weight: Array) -> sparse.csr_array:
        total = self.R.T @ sparse.diags_array(weight) @ self.R
        return sparse.csr_array(0.5 * (total + total.T))

    @property
    def K(self) -> sparse.csr_array:
        """Stiffness matrix."""
        return self._sum(self.k)

    @property
    def C(self) -> sparse.csr_array:
        """Damping matrix."""
        return self._sum(self.c)

    def congruent(self, T: sparse.csr_array | Array) -> "ElasticRows":
        """Return the rows over coordinates ``z`` with ``q = T z``."""
        return ElasticRows(sparse.csr_array(self.R @ sparse.csr_array(T)), self.k, self.c)


@dataclass(frozen=True, eq=False)
class Structure:
    """``s^2 M + s C + K`` over named coordinates.

    Attributes
    ----------
    M, C, K : (n, n) ndarray or sparse array
        Mass, damping and stiffness matrix.
    coordinates : tuple of str
        Names.
    elastic : ElasticRows or None
        Stiffness and damping once more, as sums over strains, where they are known.
    mirror : Mirror or None
        The reflection about ``x = 0`` that leaves the matrices as they are, where there is one.
    """

    M: Matrix
    C: Matrix
    K: Matrix
    coordinates: tuple[str, ...]
    elastic: ElasticRows | None = None
    mirror: Mirror | None = None

    @classmethod
    def of(
        cls,
        M: Matrix,
        C: Matrix,
        K: Matrix,
        coordinates: tuple[str, ...],
        *,
        elastic: ElasticRows | None = None,
        mirror: Mirror | None = None,
    ) -> "Structure":
        """Return a structure of matrices known to be sound; small sparse ones are stored dense."""
        M, C, K = (
            dense(matrix) if matrix.shape[0] <= DENSE_LIMIT or not sparse.issparse(matrix) else sparse.csr_array(matrix)
            for matrix in (M, C, K)
        )
        return cls(M, C, K, coordinates, elastic, mirror)

    def __getstate__(self) -> dict[str, object]:
        """Pickle what it is made of; what was computed when asked for can be computed again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @cached_property
    def symmetric(self) -> bool:
        """Whether the matrices are symmetric and every coordinate has mass."""
        for matrix in (self.M, self.C, self.K):
            if sparse.issparse(matrix):
                full = sparse.csr_array(matrix)
                change, size = np.abs((full - full.T).data), np.abs(full.data)
            else:
                change, size = np.abs(matrix - matrix.T), np.abs(matrix)
            if change.max(initial=0.0) > _SYMMETRIC * size.max(initial=0.0):
                return False
        return bool((self.M.diagonal() > 0).all())

    @cached_property
    def pencil(self) -> Pencil:
        """The matrices, ready to be factorised."""
        return Pencil.of(*(stored(matrix, self.n) for matrix in (self.M, self.C, self.K)))

    def at(self, s: Array) -> Array:
        """Return ``s^2 M + s C + K`` at each ``s``, dense, shape (len(s), n, n)."""
        M, C, K = dense(self.M), dense(self.C), dense(self.K)
        return (s**2)[:, None, None] * M + s[:, None, None] * C + K

    def force(self, motion: Array, s: Array) -> Array:
        """Return ``(s^2 M + s C + K) q`` of motions in columns, each with its ``s``; elastic forces through strains."""
        inertia = s**2 * (self.M @ motion)
        if self.elastic is None:
            return inertia + self.K @ motion + s * (self.C @ motion)
        rows = self.elastic
        return inertia + rows.R.T @ ((rows.k[:, None] + rows.c[:, None] * s) * (rows.R @ motion))

    def projected(self, V: Array, coordinates: tuple[str, ...] | None = None) -> "Structure":
        """Return the structure that moves only as the columns of ``V``, ``q = V v``: dense, through its strain rows."""
        names = tuple(f"v{i}" for i in range(V.shape[1])) if coordinates is None else coordinates
        M = V.T @ (self.M @ V)
        M = 0.5 * (M + M.T)
        if self.elastic is None:
            return Structure(M, V.T @ (self.C @ V), V.T @ (self.K @ V), names)
        rows, strain = self.elastic, self.elastic.R @ V
        return Structure(M, strain.T @ (rows.c[:, None] * strain), strain.T @ (rows.k[:, None] * strain), names)

    def mirrored(self, mirror: Mirror | None) -> "Structure":
        """Return the structure with a mirror, if that leaves its matrices as they are; otherwise as it is."""
        if mirror is None or any(mirror.change(matrix) > TOLERANCE for matrix in (self.M, self.C, self.K)):
            return self
        return replace(self, mirror=mirror)

    @cached_property
    def symmetric_half(self) -> "HalfStructure":
        """Half of a structure with a mirror, as it moves symmetrically."""
        return _half_structure(self, 1)

    @cached_property
    def antisymmetric_half(self) -> "HalfStructure":
        """Half of a structure with a mirror, as it moves antisymmetrically."""
        return _half_structure(self, -1)

    def make_halves(self) -> None:
        """Split a structure with a mirror now, so that no later question waits for it."""
        if self.mirror is not None:
            for half in (self.symmetric_half, self.antisymmetric_half):
                if half.structure.symmetric:
                    _ = half.structure.pencil


@dataclass(frozen=True)
class HalfStructure:
    """Half of a symmetric structure: the motions of one parity, ``q = P q_half``, and the structure that they see."""

    P: Array | sparse.csr_array
    structure: Structure


def _half_structure(whole: Structure, parity: int) -> HalfStructure:
    mirror = whole.mirror
    if mirror is None:
        raise ValueError("the structure carries no mirror")
    first, places = mirror.representatives(parity), mirror.places(parity)
    elastic = whole.elastic
    if elastic is not None:
        elastic = ElasticRows(half_rows(elastic.R, places, len(first)), elastic.k, elastic.c)
    M, C, K = (half_matrix(matrix, mirror, first, places) for matrix in (whole.M, whole.C, whole.K))
    stem = "sym" if parity > 0 else "anti"
    names = tuple(f"{whole.coordinates[i]}_{stem}" for i in first)
    return HalfStructure(mirror.basis(parity), Structure.of(M, C, K, names, elastic=elastic))


@dataclass(frozen=True)
class Half:
    """One half of a symmetric structure with its signals, ``y = W_out y_half``, ``d_half = W_in^T d``."""

    structure: Structure
    ports: Ports
    W_in: Array
    W_out: Array


def half(structure: Structure, ports: Ports, parity: int) -> Half | None:
    """Return one half of a structure with its signals; None where it carries no mirror, or a signal has no image."""
    mirror = structure.mirror
    if mirror is None:
        return None
    ins, outs = mirror.signals(ports.inputs, parity), mirror.signals(ports.outputs, parity)
    if ins is None or outs is None:
        return None
    primary = None
    if ports.primary is not None:
        pair = [mirror.signals(names, parity) for names in ports.primary]
        if pair[0] is not None and pair[1] is not None:
            primary = tuple(n for n in pair[0][1] if n in ins[1]), tuple(n for n in pair[1][1] if n in outs[1])
    part = structure.symmetric_half if parity > 0 else structure.antisymmetric_half
    mixed = ports.congruent(part.P).mixed(ins[0], outs[0], ins[1], outs[1])
    return Half(part.structure, replace(mixed, primary=primary), ins[0], outs[0])


def halves(structure: Structure, ports: Ports) -> tuple[Half, ...] | None:
    """Return the halves that have both inputs and outputs, or None where the structure or its signals do not split."""
    both = half(structure, ports, 1), half(structure, ports, -1)
    if both[0] is None or both[1] is None:
        return None
    return tuple(part for part in both if part is not None and part.W_in.shape[1] and part.W_out.shape[1])


def dense(matrix: object) -> Array:
    """Return a matrix as a dense array."""
    return matrix.toarray() if hasattr(matrix, "toarray") else np.asarray(matrix)  # type: ignore[attr-defined]


def is_symmetric(matrix: Array) -> bool:
    """Return whether a dense matrix is symmetric but for rounding."""
    return bool(np.abs(matrix - matrix.T).max(initial=0.0) <= _SYMMETRIC * np.abs(matrix).max(initial=0.0))
