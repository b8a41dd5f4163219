"""Mirror symmetry: a symmetric structure splits into a symmetric and an antisymmetric half."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from boomctl.arrays import Array, Matrix
from boomctl.structure.elimination import Elimination
from boomctl.structure.matrices import Prepared
from boomctl.structure.model import ElasticRows, SecondOrderModel
from boomctl.structure.ports import Ports

_TOLERANCE = 1e-9
_DENSE = 440


@dataclass(frozen=True)
class SignalPair:
    """A signal and its mirror image; ``left`` is None for a signal that is its own image (or minus it: parity -1)."""

    stem: str
    right: str
    left: str | None = None
    parity: int = 1


@dataclass(frozen=True)
class Mirror:
    """How the reflection ``x -> -x`` acts: coordinate ``i`` becomes ``sign[i]`` times coordinate ``partner[i]``."""

    partner: Array
    sign: Array
    pairs: tuple[SignalPair, ...]

    def restricted(self, choice: Elimination) -> "Mirror | None":
        """Return the mirror of the independent coordinates, or None if the elimination was not symmetric."""
        kept = choice.independent
        new = np.full(len(self.partner), -1)
        new[kept] = np.arange(len(kept))
        partner = new[self.partner[kept]]
        if (partner < 0).any():
            return None
        return Mirror(partner, self.sign[kept], self.pairs)

    def representatives(self, parity: int) -> Array:
        """Return one coordinate for each motion of the given parity: the first of a pair, or the one on the axis."""
        here = np.arange(len(self.partner))
        return np.flatnonzero((self.partner > here) | ((self.partner == here) & (self.sign == parity)))

    def places(self, parity: int) -> tuple[Array, Array]:
        """Return which column of the basis moves each coordinate, and by how much; by nothing where none does."""
        first = self.representatives(parity)
        column, amount = np.zeros(len(self.partner), dtype=np.intp), np.zeros(len(self.partner))
        image = self.partner[first]
        paired = image != first
        column[first] = column[image] = np.arange(len(first))
        amount[image] = parity * self.sign[first] * np.sqrt(0.5)
        amount[first] = np.where(paired, np.sqrt(0.5), 1.0)
        return column, amount

    def basis(self, parity: int) -> sparse.csr_array:
        """Return orthonormal columns that span the motions of the given parity (+1 symmetric, -1 antisymmetric)."""
        column, amount = self.places(parity)
        moved = np.flatnonzero(amount)
        shape = (len(amount), len(self.representatives(parity)))
        return sparse.csr_array((amount[moved], (moved, column[moved])), shape=shape)

    def completed(self, wanted: Sequence[str], available: Sequence[str]) -> tuple[str, ...]:
        """Return the signals wanted and, behind them, the mirror images that they lack."""
        partner = {
            a: b for pair in self.pairs if pair.left for a, b in ((pair.right, pair.left), (pair.left, pair.right))
        }
        lacking = [partner[name] for name in wanted if partner.get(name, name) not in wanted]
        return (*wanted, *(name for name in lacking if name in available))

    def signals(self, names: Sequence[str], parity: int) -> tuple[Array, tuple[str, ...]] | None:
        """Return the matrix from half signals to full ones, and the half signals' names; None if an image lacks."""
        place = {name: i for i, name in enumerate(names)}
        columns, stems, covered = [], [], set()
        for pair in self.pairs:
            have = [name for name in (pair.right, pair.left) if name in place]
            if not have:
                continue
            column = np.zeros(len(names))
            if pair.left is None:
                column[place[pair.right]] = 1.0 if pair.parity == parity else 0.0
                label = pair.stem
            elif len(have) < 2:
                return None
            else:
                column[place[pair.right]], column[place[pair.left]] = np.sqrt(0.5), parity * np.sqrt(0.5)
                label = f"{pair.stem}_{'sym' if parity > 0 else 'anti'}"
            covered.update(have)
            if column.any():
                columns.append(column)
                stems.append(label)
        if covered != set(names):
            return None
        return np.array(columns).reshape(-1, len(names)).T, tuple(stems)


@dataclass(frozen=True)
class Half:
    """One half of a symmetric model; its signals make up the full ones, ``y = W_out y_half``, ``d_half = W_in^T d``."""

    model: SecondOrderModel
    W_in: Array
    W_out: Array


def beam_reflection(names: Sequence[str], nodes: int) -> Mapping[str, tuple[str, int]]:
    """Return, for the local coordinates of a beam of ``nodes`` nodes, name -> (mirror name, sign)."""
    images = {}
    for name in names:
        kind, number = name.rstrip("0123456789"), int(name[len(name.rstrip("0123456789")) :])
        if kind.startswith("b"):
            images[name] = (f"{kind}{nodes - 2 - number}", (-1) ** int(kind[1:-1]))
        else:
            images[name] = (f"{kind}{nodes - 1 - number}", 1 if kind == "w" else -1)
    return images


def _change(matrix: Matrix, mirror: Mirror) -> float:
    """Return how much a matrix changes under the reflection, relative to its largest entry."""
    full = sparse.csr_array(matrix)
    S = sparse.csr_array((mirror.sign, (np.arange(len(mirror.partner)), mirror.partner)), shape=full.shape)
    difference = sparse.csr_array(S @ full @ S.T - full)
    largest = np.abs(full.data).max(initial=0.0)
    return float(np.abs(difference.data).max(initial=0.0) / largest) if largest else 0.0


def _relabelled(matrix: sparse.csr_array, places: tuple[Array, Array], width: int) -> sparse.csr_array:
    """Return ``matrix P`` where each line of ``P`` has one entry, at the column and of the amount given."""
    column, amount = places
    data = matrix.data * amount[matrix.indices]
    indices = column[matrix.indices].astype(matrix.indices.dtype)
    product = sparse.csr_array((data, indices, matrix.indptr.copy()), shape=(matrix.shape[0], width))
    product.eliminate_zeros()
    product.sum_duplicates()
    return product


def _half_matrix(matrix: Matrix, mirror: Mirror, first: Array, places: tuple[Array, Array]) -> Matrix:
    """Return ``P^T matrix P``.

    The lines of ``matrix P`` that belong to mirror images are equal, so one of each pair is enough.
    """
    image, amount = mirror.partner[first], places[1]
    both = np.where(image == first, 1.0, np.sqrt(2.0))
    if len(amount) > _DENSE:
        lines = _relabelled(sparse.csr_array(matrix)[first], places, len(first))
        lines.data *= np.repeat(both, np.diff(lines.indptr))
        return lines
    if sparse.issparse(matrix):
        return _small_half(sparse.csr_array(matrix), first, places, both)
    lines = np.asarray(matrix)[first]
    other = np.where(image == first, 0.0, amount[image])
    return both[:, None] * (lines[:, first] * amount[first] + lines[:, image] * other)


def _small_half(matrix: sparse.csr_array, first: Array, places: tuple[Array, Array], both: Array) -> Array:
    """Return the lines ``first`` of ``matrix P``, each times ``both``, as a dense matrix."""
    column, amount = places
    n = len(first)
    line, factor = np.full(len(column), -1), np.zeros(len(column))
    line[first], factor[first] = np.arange(n), both
    row = np.repeat(np.arange(len(column)), np.diff(matrix.indptr))
    kept = np.flatnonzero(line[row] >= 0)
    row, indices = row[kept], matrix.indices[kept]
    data = matrix.data[kept] * amount[indices] * factor[row]
    return np.bincount(line[row] * n + column[indices], data, n * n).reshape(n, n)


@dataclass(frozen=True)
class HalfStructure:
    """Half of a symmetric structure: the motions of one parity, ``q = P q_half``, and the structure that they see."""

    P: Array | sparse.csr_array
    prepared: Prepared


def half_structure(whole: Prepared, parity: int) -> HalfStructure:
    """Return half of a structure that carries a mirror."""
    mirror = whole.mirror
    if mirror is None:
        raise ValueError("the structure carries no mirror")
    n = len(whole.coordinates)
    first, places = mirror.representatives(parity), mirror.places(parity)
    if n <= _DENSE:
        P = np.zeros((n, len(first)))
        P[np.arange(n), places[0]] = places[1]
    else:
        P = mirror.basis(parity)
    elastic = whole.elastic
    if elastic is not None:
        elastic = ElasticRows(_relabelled(elastic.R, places, len(first)), elastic.k, elastic.c)
    M, C, K = (_half_matrix(X, mirror, first, places) for X in (whole.M, whole.C, whole.K))
    stem = "sym" if parity > 0 else "anti"
    names = tuple(f"{whole.coordinates[i]}_{stem}" for i in first)
    return HalfStructure(P, SecondOrderModel.build(M, C, K, Ports.none(len(first)), names, elastic).prepared)


def half(model: SecondOrderModel, parity: int) -> Half | None:
    """Return one half of a model that carries a mirror; None if a signal has no image or the model no mirror."""
    if model.mirror is None:
        return None
    ins, outs = model.mirror.signals(model.inputs, parity), model.mirror.signals(model.outputs, parity)
    if ins is None or outs is None:
        return None
    structure = model.prepared.symmetric_half if parity > 0 else model.prepared.antisymmetric_half
    ports = model.ports.congruent(structure.P).mixed(ins[0], outs[0], ins[1], outs[1])
    primary = _primary(model, parity, ins[1], outs[1])
    return Half(SecondOrderModel.of_prepared(structure.prepared, ports, primary), ins[0], outs[0])


def _primary(
    model: SecondOrderModel, parity: int, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    if model.primary is None or model.mirror is None:
        return None
    ins, outs = (model.mirror.signals(names, parity) for names in model.primary)
    if ins is None or outs is None:
        return None
    return tuple(n for n in ins[1] if n in inputs), tuple(n for n in outs[1] if n in outputs)


def halves(model: SecondOrderModel) -> tuple[Half, Half] | None:
    """Return the symmetric and the antisymmetric half, or None where the model does not split."""
    symmetric, antisymmetric = half(model, 1), half(model, -1)
    if symmetric is None or antisymmetric is None:
        return None
    return symmetric, antisymmetric


def split_symmetric(model: SecondOrderModel) -> tuple[SecondOrderModel, SecondOrderModel]:
    """Split a mirror-symmetric model into its symmetric (jolt) and antisymmetric (yaw) half.

    Signals that come in pairs become ``stem_sym = (right + left)/sqrt 2`` and ``stem_anti = (right - left)/sqrt 2``;
    the transformation is orthonormal, so that the singular values of the two halves are those of the whole.

    Returns
    -------
    jolt, yaw : SecondOrderModel

    Raises
    ------
    ValueError
        The mesh or the machine is not symmetric about ``x = 0``.
    """
    if model.mirror is None:
        raise ValueError("the model is not symmetric about x = 0 (mesh or machine), so it does not split")
    for name, matrix in (("M", model.M), ("C", model.C), ("K", model.K)):
        if _change(matrix, model.mirror) > _TOLERANCE:
            raise ValueError(f"the model is not symmetric about x = 0: its reflection changes {name}")
    pair = halves(model)
    if pair is None:
        raise ValueError(f"inputs {model.inputs} or outputs {model.outputs} are not pairs of mirror images")
    return pair[0].model, pair[1].model


def mirror_of(
    coordinates: Sequence[str], images: Mapping[str, tuple[str, int]], pairs: tuple[SignalPair, ...]
) -> Mirror | None:
    """Return the mirror that ``images`` (coordinate -> (image, sign)) describes; None if an image is not there."""
    place = {name: i for i, name in enumerate(coordinates)}
    if any(images[name][0] not in place for name in coordinates):
        return None
    partner = np.array([place[images[name][0]] for name in coordinates])
    return Mirror(partner, np.array([float(images[name][1]) for name in coordinates]), pairs)


def with_mirror(model: SecondOrderModel, mirror: Mirror | None) -> SecondOrderModel:
    """Return the model with a mirror, if that leaves its matrices as they are; otherwise the model as it is."""
    if mirror is None or any(_change(matrix, mirror) > _TOLERANCE for matrix in (model.M, model.C, model.K)):
        return model
    return SecondOrderModel.build(
        model.M, model.C, model.K, model.ports, model.coordinates, model.elastic, mirror, model.primary
    )
