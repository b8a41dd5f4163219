"""A structure without its inputs and outputs: mass, damping and stiffness, and results that depend only on them.

:class:`Structure` is the input of all structural computations, together with the :class:`~boomctl.structure.ports.Ports`
with its inputs and outputs.  Models that differ only in inputs and outputs share one, and its cached results: strain
coordinates, the symmetric and the antisymmetric subsystem.
"""

from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, EPS, SUMMED
from boomctl.printing import compact
from boomctl.structure.layout import CACHE_SIZE, Layout, Weights, layout_of_matrices, weigh
from boomctl.structure.outline import Outline
from boomctl.structure.ports import Ports
from boomctl.structure.strain_coordinates import StrainForm, strain_form
from boomctl.structure.symmetry import Mirror

_LARGEST = 1000  # coordinates of a model
# largest over median stiffness over mass of coordinates, from which on a mesh is not split: the rounding of its stations
# makes images of its shortest elements unlike each other, and a half that holds both would lock
_GRADED = 1e14


@dataclass(frozen=True, eq=False)
class Structure:
    """``s^2 M + s C + K`` over named coordinates: rows and their weights.

    Attributes
    ----------
    layout : Layout
        Rows over the coordinates.
    weights : Weights
        Their weights; for matrices passed by the user these matrices.
    outline : Outline or None
        Positions of the parts and their motion with the coordinates, if known.
    settled : bool
        If True, its state space uses these coordinates, so that similar structures have the same states.
    """

    layout: Layout
    weights: Weights
    outline: Outline | None = field(default=None, repr=False)
    settled: bool = field(default=False, repr=False)

    __repr__ = compact

    @classmethod
    def of(
        cls,
        M: Array,
        C: Array,
        K: Array,
        coordinates: tuple[str, ...],
        mirror: Mirror | None = None,
        outline: Outline | None = None,
    ) -> "Structure":
        """Return a structure of matrices known to be sound."""
        structure = cls(layout_of_matrices(coordinates, mirror), Weights(M, C, K), outline)
        structure.__dict__["matrices"] = M, C, K
        return structure

    def __getstate__(self) -> dict[str, object]:
        """Pickle the fields without cached results."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.layout.coordinates

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.layout.coordinates)

    @property
    def mirror(self) -> Mirror | None:
        """The reflection about ``x = 0`` that leaves the matrices as they are, where there is one."""
        return self.layout.mirror

    @property
    def has_strains(self) -> bool:
        """True if stiffness and damping are known as sums over strains, and not only as matrices."""
        return self.weights.k.ndim == 1

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness matrix."""
        return self.layout.matrices(self.weights)

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
    def strain_form(self) -> StrainForm | None:
        """The structure in strain coordinates; None for matrices passed by the user."""
        return strain_form(self.layout, self.weights) if self.has_strains else None

    @cached_property
    def _squares(self) -> Array:
        """Stiffness over mass of the coordinates that have mass, ascending [rad^2/s^2]."""
        pairs = (self.layout.R, self.weights.k), (self.layout.N, self.weights.m)
        stiffness, mass = (w @ rows**2 if w.ndim == 1 else (rows * (w @ rows)).sum(axis=0) for rows, w in pairs)
        return np.sort(np.abs(stiffness[mass > 0.0]) / mass[mass > 0.0])

    @property
    def noise(self) -> float:
        """Rounding of the stiffness matrix over the mass matrix, at most: an uncertainty of ``omega^2``."""
        return EPS * float(self._squares.max(initial=0.0))

    @property
    def graded(self) -> bool:
        """True if rows are known and some elements are so short that strains of displacements are inaccurate."""
        square = self._squares
        return self.has_strains and len(square) > 0 and bool(square[-1] > _GRADED * square[len(square) // 2])

    def projected(self, V: Array, coordinates: tuple[str, ...] | None = None) -> "Structure":
        """Return the structure that moves only as the columns of ``V``, ``q = V v``, through its strain rows."""
        names = tuple(f"v{i}" for i in range(V.shape[1])) if coordinates is None else coordinates
        moving, strain, weights = self.layout.N @ V, self.layout.R @ V, self.weights
        M = moving.T @ weigh(weights.m, moving)
        C, K = (strain.T @ weigh(weight, strain) for weight in (weights.c, weights.k))
        return Structure.of(0.5 * (M + M.T), C, K, names)

    def mirrored(self, mirror: Mirror | None) -> "Structure":
        """Return the structure with a mirror, if that leaves its matrices as they are; otherwise without."""
        N, R, weights = self.layout.N, self.layout.R, self.weights
        if mirror is not None:
            strain, pairs = R @ mirror.probe, (weights.c, weights.k)
            forces = [N.T @ weigh(weights.m, N @ mirror.probe), *(R.T @ weigh(weight, strain) for weight in pairs)]
            mirror = mirror if mirror.change(np.array(forces)) <= ALIKE else None
        return replace(self, layout=_mirrored(self.layout, None if self.graded else mirror))

    @cached_property
    def halves(self) -> "dict[int, tuple[Array, Structure]]":
        """Of a structure with a mirror: the motions of each parity, ``q = P q_half``, and the structure over them."""
        result, weights, (mass, elastic) = {}, self.weights, self.layout.pairs
        if self.has_strains:  # A row stands for its image, too.
            sums = ((weights.m, mass), (weights.c, elastic), (weights.k, elastic))
            weights = Weights(*(w[first] + np.where(image == first, 0.0, w[image]) for w, (first, image) in sums))
        for parity, (P, layout) in self.layout.halves.items():
            outline = self.outline and replace(self.outline, maps=(*self.outline.maps, P), parity=parity)
            if self.has_strains:
                half = replace(self, layout=layout, weights=weights, outline=outline)
            else:
                half = replace(self.projected(P, layout.coordinates), outline=outline, settled=self.settled)
            result[parity] = P, half
        return result


@lru_cache(maxsize=CACHE_SIZE)
def _mirrored(layout: Layout, mirror: Mirror | None) -> Layout:
    """Return a layout with or without a mirror, cached for all structures that share the layout."""
    return replace(layout, mirror=mirror)


# A subsystem of a symmetric structure with its signals: ``W_in``, ``W_out`` of ``y = W_out y_half``, ``d_half = W_in^T d``.
Half = tuple[Structure, Ports, Array, Array]


def halves(structure: Structure, ports: Ports, empty: bool = False) -> tuple[Half, ...] | None:
    """Return the symmetric and the antisymmetric subsystem; None without a mirror, or if a signal has no image.

    A subsystem without inputs or outputs is omitted, unless ``empty``.
    """
    if structure.mirror is None:
        return None
    signals = {k: [structure.mirror.signals(names, k) for names in (ports.inputs, ports.outputs)] for k in (1, -1)}
    result, rows = [], structure.layout.pairs[1][0] if structure.has_strains else slice(None)
    for parity, (ins, outs) in signals.items():
        if ins is None or outs is None:
            return None
        if empty or (ins[1] and outs[1]):
            P, part = structure.halves[parity]
            result.append((part, ports.mixed(P, ins, outs, rows), ins[0], outs[0]))
    return tuple(result)


def dynamic_stiffness(matrices: tuple[Array, Array, Array], s: Array) -> Array:
    """Return ``s^2 M + s C + K`` at each imaginary ``s``, shape (len(s), n, n)."""
    (M, C, K), omega = matrices, s.imag[:, None, None]
    full = np.empty((len(s), *M.shape), dtype=complex)
    full.real, full.imag = K - omega**2 * M, omega * C
    return full


def check_size(n: int) -> None:
    """Raise ValueError if a model has too many coordinates."""
    if n > _LARGEST:
        raise ValueError(
            f"The model must have at most {_LARGEST} coordinates, got {n}. Use a few elements of high order:"
            " four represent the whole boom to 5e-10."
        )


def is_symmetric(matrix: Array) -> bool:
    """Return whether a matrix is symmetric to within rounding."""
    return bool(np.abs(matrix - matrix.T).max(initial=0.0) <= SUMMED * np.abs(matrix).max(initial=0.0))
