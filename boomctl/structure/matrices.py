"""A structure without its inputs and outputs: mass, damping and stiffness, and what follows from them alone.

:class:`Structure` is what the numerics of a structure take, beside the :class:`~boomctl.structure.ports.Ports` through
which it is driven and read.  Models that differ only in inputs and outputs share one, and with it what was computed
once: strain coordinates, the symmetric and the antisymmetric half.
"""

from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, EPS, SUMMED
from boomctl.printing import compact
from boomctl.structure.layout import KEPT, Layout, Weights, squared_sums
from boomctl.structure.outline import Outline, mapped
from boomctl.structure.ports import Ports
from boomctl.structure.strain_coordinates import StrainForm, strain_form
from boomctl.structure.symmetry import Mirror

_LARGEST = 1000  # coordinates of a model
# largest over median stiffness over mass of coordinates, from which on a mesh is not split: the rounding of its stations
# makes images of its shortest elements unlike each other, and a half that holds both would lock
_GRADED = 1e14


@dataclass(frozen=True)
class ElasticRows:
    """Stiffness and damping as sums over rows: ``K = R^T diag(k) R``, ``C = R^T diag(c) R``."""

    R: Array
    k: Array
    c: Array

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Structure:
    """``s^2 M + s C + K`` over named coordinates: matrices given, or rows and what they weigh.

    Attributes
    ----------
    coordinates : tuple of str
        Names.
    given : triple of (n, n) ndarray, or None
        Mass, damping and stiffness matrix; None: they follow from rows.
    layout, weights : Layout, Weights, or None
        Rows over the coordinates and their weights, where they are known.
    mirror : Mirror or None
        The reflection about ``x = 0`` that leaves the matrices as they are, where there is one.
    outline : Outline or None
        Where the parts are and how they move with the coordinates, where that is known.
    settled : bool
        Whether its state space is over these very coordinates, so that structures beside it have the same states.
    """

    coordinates: tuple[str, ...]
    given: tuple[Array, Array, Array] | None = None
    layout: Layout | None = None
    weights: Weights | None = None
    mirror: Mirror | None = None
    outline: Outline | None = field(default=None, repr=False)
    settled: bool = field(default=False, repr=False)

    __repr__ = compact

    @classmethod
    def of(
        cls, M: Array, C: Array, K: Array, coordinates: tuple[str, ...], mirror: Mirror | None = None
    ) -> "Structure":
        """Return a structure of matrices known to be sound."""
        return cls(coordinates, (M, C, K), mirror=mirror)

    @classmethod
    def weighed(
        cls, layout: Layout, weights: Weights, mirror: Mirror | None = None, outline: Outline | None = None
    ) -> "Structure":
        """Return a structure of rows and what they weigh; its matrices are computed on first access."""
        return cls(layout.coordinates, None, layout, weights, mirror, outline)

    def __getstate__(self) -> dict[str, object]:
        """Pickle what it is made of; what was computed when asked for can be computed again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness matrix."""
        if self.layout is None or self.weights is None:
            assert self.given is not None
            return self.given
        layout, weights = self.layout, self.weights
        return layout.mass(weights.m), layout.stiffness(weights.c), layout.stiffness(weights.k)

    @property
    def M(self) -> Array:
        """Mass matrix."""
        return self.matrices[0]

    @property
    def C(self) -> Array:
        """Damping matrix."""
        return self.matrices[1]

    @property
    def K(self) -> Array:
        """Stiffness matrix."""
        return self.matrices[2]

    @cached_property
    def elastic(self) -> ElasticRows | None:
        """Stiffness and damping once more, as sums over strains, where they are known."""
        if self.layout is None or self.weights is None:
            return None
        return ElasticRows(self.layout.R, self.weights.k, self.weights.c)

    @cached_property
    def strain_form(self) -> StrainForm | None:
        """The structure in strain coordinates; None without rows."""
        return None if self.layout is None or self.weights is None else strain_form(self.layout, self.weights)

    @cached_property
    def in_strains(self) -> "Structure":
        """The structure over strain coordinates where it has them, or itself."""
        form = self.strain_form
        if form is None:
            return self
        names = tuple(f"z{i}" for i in range(self.n))
        return Structure(names, (form.N.T @ form.N, form.C, form.K))

    @cached_property
    def _squares(self) -> Array:
        """Stiffness over mass of the coordinates that have mass, ascending [rad^2/s^2]."""
        if self.layout is None or self.weights is None:
            stiffness, mass = np.abs(self.K.diagonal()), self.M.diagonal()
        else:
            stiffness, mass = squared_sums(self.layout.R, self.weights.k), squared_sums(self.layout.N, self.weights.m)
        return np.sort(stiffness[mass > 0.0] / mass[mass > 0.0])

    @property
    def noise(self) -> float:
        """Rounding of the stiffness matrix over the mass matrix, at most: an uncertainty of ``omega^2``."""
        return EPS * float(self._squares.max(initial=0.0))

    @property
    def graded(self) -> bool:
        """Whether rows are known and some elements are so much shorter than most that displacements lose their strains."""
        square = self._squares
        return self.layout is not None and len(square) > 0 and bool(square[-1] > _GRADED * square[len(square) // 2])

    def at(self, s: Array) -> Array:
        """Return ``s^2 M + s C + K`` at each imaginary ``s``, shape (len(s), n, n)."""
        full, omega = np.empty((len(s), self.n, self.n), dtype=complex), s.imag[:, None, None]
        full.real, full.imag = self.K - omega**2 * self.M, omega * self.C
        return full

    def force(self, motion: Array, s: Array) -> Array:
        """Return ``(s^2 M + s C + K) q`` of motions in columns, each with its ``s``; elastic forces through strains."""
        inertia, rows = s**2 * (self.M @ motion), self.elastic
        if rows is None:
            return inertia + self.K @ motion + s * (self.C @ motion)
        return inertia + rows.R.T @ ((rows.k[:, None] + rows.c[:, None] * s) * (rows.R @ motion))

    def projected(self, V: Array, coordinates: tuple[str, ...] | None = None) -> "Structure":
        """Return the structure that moves only as the columns of ``V``, ``q = V v``, through its strain rows."""
        names = tuple(f"v{i}" for i in range(V.shape[1])) if coordinates is None else coordinates
        if self.layout is None or self.weights is None:
            M, C, K = (V.T @ (matrix @ V) for matrix in (self.M, self.C, self.K))
        else:
            moving, strain, weights = self.layout.N @ V, self.layout.R @ V, self.weights
            M = moving.T @ (weights.m[:, None] * moving)
            C, K = (strain.T @ (weight[:, None] * strain) for weight in (weights.c, weights.k))
        return Structure(names, (0.5 * (M + M.T), C, K))

    def mirrored(self, mirror: Mirror | None) -> "Structure":
        """Return the structure with a mirror, if that leaves its matrices as they are; otherwise as it is."""
        if mirror is None:
            return self
        if self.layout is None or self.weights is None:
            broken = any(mirror.change(matrix) > ALIKE for matrix in self.matrices)
            return self if broken else replace(self, mirror=mirror)
        if self.graded or not self.layout.keeps_mirror(mirror, self.weights):
            return self
        return replace(self, layout=_mirrored(self.layout, mirror), mirror=mirror)

    @cached_property
    def halves(self) -> "dict[int, tuple[Array, Structure]]":
        """Of a structure with a mirror: the motions of each parity, ``q = P q_half``, and the structure over them."""
        return {parity: self._half(parity) for parity in (1, -1)}

    def _half(self, parity: int) -> "tuple[Array, Structure]":
        assert self.mirror is not None
        if self.layout is not None and self.weights is not None:
            P, layout = self.layout.halves[parity]
            return P, Structure.weighed(layout, self.weights, None, mapped(self.outline, P, parity))
        P, names = self.mirror.basis(parity), self.mirror.half_coordinates(self.coordinates, parity)
        M, C, K = (P.T @ (matrix @ P) for matrix in self.matrices)
        return P, Structure(names, (M, C, K), outline=mapped(self.outline, P, parity), settled=self.settled)


@lru_cache(maxsize=KEPT)
def _mirrored(layout: Layout, mirror: Mirror) -> Layout:
    """Return a layout with a mirror; one for all structures that share the layout."""
    return replace(layout, mirror=mirror)


@dataclass(frozen=True)
class Half:
    """One half of a symmetric structure with its signals, ``y = W_out y_half``, ``d_half = W_in^T d``."""

    structure: Structure
    ports: Ports
    W_in: Array
    W_out: Array

    __repr__ = compact


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
    P, part = structure.halves[parity]
    return Half(part, ports.mixed(P, ins, outs, primary), ins[0], outs[0])


def halves(structure: Structure, ports: Ports) -> tuple[Half, ...] | None:
    """Return the halves that have both inputs and outputs, or None where the structure or its signals do not split."""
    both = half(structure, ports, 1), half(structure, ports, -1)
    if both[0] is None or both[1] is None:
        return None
    return tuple(part for part in both if part is not None and part.W_in.shape[1] and part.W_out.shape[1])


def check_size(n: int) -> None:
    """Raise if a model has more coordinates than matrices are made for."""
    if n > _LARGEST:
        raise ValueError(
            f"The model must have at most {_LARGEST} coordinates, got {n}. Use a few elements of high order:"
            " four represent the whole boom to 5e-10."
        )


def is_symmetric(matrix: Array) -> bool:
    """Return whether a matrix is symmetric but for rounding."""
    return bool(np.abs(matrix - matrix.T).max(initial=0.0) <= SUMMED * np.abs(matrix).max(initial=0.0))
