"""ExactModel: rigid bodies and springs as matrices, beams as exact dynamic stiffness, at any frequency."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from boomctl.arrays import Array, combined
from boomctl.lti.rounding import ALIKE, warn_of_rounding
from boomctl.structure.beams.dynamic_stiffness import clamped_count, end_functions
from boomctl.structure.beams.strains import StrainSystem, beside, wave_numbers
from boomctl.structure.beams.terms import Lines, Terms, kinds_of
from boomctl.structure.elimination import eliminate
from boomctl.structure.layout import KEPT, Layout, Weights
from boomctl.structure.parts import BeamSegment
from boomctl.structure.ports import Ports
from boomctl.structure.symmetry import Mirror

_RESIDUAL = 1e-11  # of an equation's terms; where elimination leaves more, strain coordinates answer (a choice)
_CANCELLED = 3e4  # nodal stiffness over its pivot, likewise: by then, 1e-10 of the response may be lost (measured)
# stiffness of the stiffest segment over that of all in a row, up to which nodal stiffnesses answer: errors of 1e-10 on random
# beams of up to 13 segments and springs of all sizes (measured)
_UNEVEN = 1e4
PROMISED = 1e-9  # rounding, of the largest output to an input or of an eigenfrequency, above which a user is warned

Entries = Mapping[tuple[int, int], Array]


@dataclass(frozen=True, eq=False)
class ExactLayout:
    """How a structure with exact beams moves, whatever it weighs: rows over its coordinates, and its signals.

    Attributes
    ----------
    rigid : Layout
        ``N``: centers of bodies, and beams along their axes; ``R``: elongations of springs and dampers.
    S : (4 segments, n) ndarray
        End displacements and rotations ``w1, l phi1, w2, l phi2`` of each segment of the beams, of length ``l``.
    ports : Ports
        Inputs and outputs over the coordinates.
    moved : tuple of str
        Inputs that impose motion; the others are forces.
    imposed : tuple of ndarray
        ``N, R, S`` over the imposed displacements.
    direct : (outputs, moved) ndarray
        What the outputs read of the imposed displacements.
    """

    rigid: Layout
    S: Array
    ports: Ports
    moved: tuple[str, ...] = ()
    imposed: tuple[Array, Array, Array] | None = None
    direct: Array | None = None

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.rigid.n

    @cached_property
    def terms(self) -> "Terms":
        """What each weight adds to the dynamic stiffness of all coordinates."""
        rows = self.rows(np.eye(self.n))
        return Terms.of(rows, rows, np.zeros((self.n, self.n)))

    def rows(self, P: Array) -> tuple[Array, Array, Array]:
        """Return ``N, R, S`` over coordinates ``z`` with ``q = P z``."""
        return self.rigid.N @ P, self.rigid.R @ P, self.S @ P


@lru_cache(maxsize=KEPT)
def _prescribed(layout: ExactLayout, inputs: tuple[str, ...]) -> ExactLayout:
    """Return the layout with the motion of the points of the force inputs named imposed."""
    choice = eliminate(np.column_stack([layout.ports.force_column(name) for name in inputs]), inputs)
    T_q, T_d = choice.T_q, choice.T_d
    return ExactLayout(
        layout.rigid.eliminated(choice),
        combined(layout.S, T_q),
        layout.ports.restricted(T_q),
        inputs,
        layout.rows(T_d),
        layout.ports.L[0] @ T_d,
    )


@dataclass(frozen=True)
class ExactModel:
    """A structure whose beams are exact: ``D(s) q = B(s) d``, ``y = L q + E d``.

    Attributes
    ----------
    layout : ExactLayout
        Rows over its coordinates, inputs and outputs.
    weights : Weights
        Of everything but the beams' bending.
    segments : tuple of BeamSegment
        The beams, segment by segment.
    mirror : Mirror or None
        The reflection about ``x = 0`` that leaves the structure as it is, if there is one.
    """

    layout: ExactLayout
    weights: Weights
    segments: tuple[BeamSegment, ...]
    mirror: Mirror | None = None

    @property
    def ports(self) -> Ports:
        """Inputs and outputs."""
        return self.layout.ports

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.layout.rigid.coordinates

    def prescribed(self, inputs: Sequence[str]) -> "ExactModel":
        """Return the structure with the motion of the points of the force inputs named imposed."""
        layout = _prescribed(self.layout, tuple(inputs))
        return replace(self, layout=layout, mirror=None if self.mirror is None else layout.rigid.mirror)

    def mirrored(self, mirror: Mirror | None) -> "ExactModel":
        """Return the structure with a reflection, if it leaves the structure as it is; otherwise without."""
        if mirror is None:
            return replace(self, mirror=None)
        n = self.layout.n
        D = self.layout.terms.weighed(self.weights, kinds_of(self.segments)[1]).reshape(-1, n, n)
        change = np.abs(mirror.sign[:, None] * D[:, mirror.partner][:, :, mirror.partner] * mirror.sign - D)
        if (change.max(axis=(1, 2)) > ALIKE * np.abs(D).max(axis=(1, 2))).any():
            return replace(self, mirror=None)
        return replace(self, layout=_mirrored(self.layout, mirror), mirror=mirror)

    def prepared(self, inputs: Sequence[str], outputs: Sequence[str]) -> "PreparedResponse":
        """Return what of the frequency response does not depend on frequency; symmetric structures in halves."""
        groups, direct = _arranged(self.layout, self.mirror, tuple(inputs), tuple(outputs))
        kinds, shares = kinds_of(self.segments)
        coefficients = [
            np.stack([part.terms.weighed(self.weights, shares).T for part in parts], axis=1) for parts in groups
        ]
        return PreparedResponse(groups, direct, self.weights, self.segments, kinds, tuple(coefficients), self._even)

    @property
    def _even(self) -> bool:
        """Whether no segment is so short that nodal stiffnesses lose digits."""
        soft = [part.length / part.bending_stiffness ** (1 / 3) for part in self.segments]
        return not soft or sum(soft) <= _UNEVEN ** (1 / 3) * min(soft)

    def response(self, omega: Array, inputs: Sequence[str], outputs: Sequence[str]) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies), of displacement outputs."""
        return self.prepared(inputs, outputs).at(omega)

    @cached_property
    def _at_rest(self) -> "ExactModel":
        """The structure without any damping."""
        weights = replace(self.weights, c=np.zeros_like(self.weights.c))
        return replace(self, weights=weights, segments=tuple(replace(s, stiffness_damping=0.0) for s in self.segments))

    def count_below(self, omega: Array) -> Array:
        """Return how many undamped natural frequencies lie below each ``omega`` (Wittrick & Williams 1971)."""
        values, clamped = self.inertia(omega)
        return (values < 0.0).sum(axis=1) + clamped

    def inertia(self, omega: Array) -> tuple[Array, Array]:
        """Return the eigenvalues of the scaled undamped dynamic stiffness, ascending, (len(omega), n).

        And how many natural frequencies of its clamped segments lie below each ``omega``.
        """
        clamped = clamped_count(wave_numbers(self.segments, omega)).sum(axis=1)
        return self._at_rest.strains.inertia(omega), clamped

    @cached_property
    def strains(self) -> StrainSystem:
        """The free coordinates' rows, ready for strain coordinates."""
        n = self.layout.n
        left = self.layout.rows(np.eye(n))
        N, R, S = (np.zeros((len(rows), 0)) for rows in left)
        return StrainSystem(left, (N, R, S), np.zeros((n, 0)), self.weights, self.segments)


@lru_cache(maxsize=KEPT)
def _mirrored(layout: ExactLayout, mirror: Mirror) -> ExactLayout:
    return replace(layout, rigid=replace(layout.rigid, mirror=mirror))


def _functions(kinds: Sequence[BeamSegment], s: Array) -> Array:
    """Return ``1, s, s^2`` and six functions a kind of segment at each ``s``."""
    values = np.empty((3 + 6 * len(kinds), len(s)), dtype=complex)
    values[0], values[1], values[2] = 1.0, s, s * s
    for k, seg in enumerate(kinds):
        modulus = 1.0 + seg.stiffness_damping * s
        x = -(s * s) * (seg.mass_per_length * seg.length**4 / seg.bending_stiffness) / modulus
        values[3 + 6 * k : 9 + 6 * k] = end_functions(x) * modulus
    return values


def _combined(coefficients: Array, values: Array) -> Array:
    """Return real combinations of the rows of a complex array."""
    return (coefficients @ values.view(float)).view(complex)


@dataclass(frozen=True, eq=False)
class _Part:
    """Equations of a structure or one of its halves, and the contribution of its unknowns to the requested response.

    ``terms`` are what each weight adds to the entries of ``D`` at ``places``, to the sums of its columns, weighted, to
    ``B`` and to its sums.  ``mixing`` takes the unknowns ``shown``, each with its input, to outputs times inputs.
    ``W_out`` and ``W_in`` are the part's outputs and inputs over those requested, ``L`` its outputs over its unknowns;
    ``left`` and ``right`` the rows ``N, R, S`` over coordinates and inputs, ``forces`` the columns of the forces.
    """

    places: tuple[tuple[int, int], ...]
    terms: Terms
    mixing: Array
    shown: tuple[tuple[int, int], ...]
    W_out: Array
    W_in: Array
    L: Array
    left: Lines
    right: Lines
    forces: Array

    @classmethod
    def of(
        cls, layout: ExactLayout, ports: Ports, P: Array, W_in: Array, W_out: Array, shape: tuple[int, int]
    ) -> "tuple[_Part, Array]":
        """Return the part of motions ``q = P z``, inputs ``d = W_in v`` and outputs ``W_out^T y``; and its feedthrough.

        Of inputs and outputs, the first ones, ``shape``, are requested.
        """
        n, m = P.shape[1], W_in.shape[1]
        moved = [[name == item for name in ports.inputs] for item in layout.moved]
        which = np.array(moved, dtype=float).reshape(-1, len(ports.inputs)) @ W_in
        forces = P.T @ np.where(np.any(moved, axis=0), 0.0, ports.B[0]) @ W_in
        left = layout.rows(P)
        if layout.imposed is None:
            right = np.zeros((len(left[0]), m)), np.zeros((len(left[1]), m)), np.zeros((len(left[2]), m))
        else:
            N_d, R_d, S_d = layout.imposed
            right = -(N_d @ which), -(R_d @ which), -(S_d @ which)
        if layout.direct is None:
            direct = np.zeros((W_out.shape[1], m))
        else:
            direct = W_out.T @ layout.direct[[layout.ports.outputs.index(name) for name in ports.outputs]] @ which
        terms = Terms.of(left, beside(left, right), np.hstack([np.zeros((n, n)), forces]))
        occupied = np.eye(n, dtype=bool)
        for item in (terms.elastic, terms.inertia, terms.bending):
            occupied |= (np.abs(item[..., :n]).reshape(-1, n, n) > 0.0).any(axis=0)
        i, j = np.nonzero(np.tril(occupied))
        weights = 1.0 + 0.5 * np.cos(np.arange(n))

        def numbers(entries: Array) -> Array:
            D, B = entries[..., :n], entries[..., n:]
            flat = (*entries.shape[:-2], n * m)
            return np.concatenate([D[..., i, j], weights @ D, B.reshape(flat), weights @ B], axis=-1)

        L, W_out, W_in = W_out.T @ ports.L[0] @ P, W_out[: shape[0]], W_in[: shape[1]]
        mixing = np.einsum("ou,uk,iv->oikv", W_out, L, W_in).reshape(-1, n * m)
        shown = np.flatnonzero(mixing.any(axis=0))
        part = cls(
            places=tuple(zip(i.tolist(), j.tolist(), strict=True)),
            terms=terms.mapped(numbers),
            mixing=mixing[:, shown],
            shown=tuple(divmod(k, m) for k in shown.tolist()),
            W_out=W_out,
            W_in=W_in,
            L=L,
            left=left,
            right=right,
            forces=forces,
        )
        return part, W_out @ direct @ W_in.T


Parts = tuple[_Part, ...]


@lru_cache(maxsize=KEPT)
def _arranged(
    layout: ExactLayout, mirror: Mirror | None, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[tuple[Parts, ...], Array]:
    """Return the parts of a structure, those of one pattern together, and what inputs add to outputs directly."""
    wanted_in, wanted_out, shape = inputs, outputs, (len(outputs), len(inputs))
    if mirror is not None:
        wanted_in = mirror.completed(wanted_in, layout.ports.inputs)
        wanted_out = mirror.completed(wanted_out, layout.ports.outputs)
    ports = layout.ports.select(wanted_in, wanted_out)
    if any(x.any() for x in ports.L[1:]):
        raise ValueError("the exact beam offers displacement outputs only")
    if any(bandwidth is not None for bandwidth in ports.bandwidths):
        raise ValueError("the exact beam offers outputs without a bandwidth only")
    if mirror is None:
        motions = [(np.eye(layout.n), np.eye(shape[1]), np.eye(shape[0]))]
    else:
        motions = []
        for parity in (1, -1):
            ins, outs = mirror.signals(ports.inputs, parity), mirror.signals(ports.outputs, parity)
            if ins is None or outs is None:
                return _arranged(layout, None, inputs, outputs)
            if ins[0].shape[1] and outs[0].shape[1]:
                motions.append((mirror.basis(parity), ins[0], outs[0]))
    alike: dict[object, Parts] = {}
    total = np.zeros(shape)
    for motion in motions:
        part, direct = _Part.of(layout, ports, *motion, shape)
        total += direct
        key = part.places, part.forces.shape
        alike[key] = (*alike.get(key, ()), part)
    return tuple(alike.values()), total


@dataclass(frozen=True, eq=False)
class PreparedResponse:
    """The frequency response of a structure with exact beams, but for frequency.

    ``coefficients`` are, for each group of parts of one pattern, those of its numbers over ``1, s, s^2`` and the functions
    of the ``kinds`` of segments; ``even`` is whether no segment is short.
    """

    groups: tuple[Parts, ...]
    direct: Array
    weights: Weights
    segments: tuple[BeamSegment, ...]
    kinds: tuple[BeamSegment, ...]
    coefficients: tuple[Array, ...]
    even: bool

    def at(self, omega: Array) -> Array:
        """Return the response, shape (outputs, inputs, frequencies), at ``omega`` [rad/s].

        It is computed by nodal stiffnesses, and by strain coordinates where a segment is short or these cancel.

        Raises
        ------
        ValueError
            ``omega = 0`` and the structure moves freely.

        Warns
        -----
        AccuracyWarning
            Rounding may exceed 1e-9 of the largest output to an input.
        """
        if (omega == 0.0).any() and any(system.rigid for _, system in self._strained):
            raise ValueError("omega = 0: the structure moves freely (a rigid-body mode), its response is infinite")
        if not self.even:
            return self._in_strains(omega)
        total = np.empty((self.direct.size, len(omega)), dtype=complex)
        total[:] = self.direct.reshape(-1, 1)
        functions, lost = _functions(self.kinds, 1j * omega), np.zeros(len(omega), dtype=bool)
        for parts, coefficients in zip(self.groups, self.coefficients, strict=True):
            lost |= _add(parts, coefficients, functions, total)
        response = total.reshape(*self.direct.shape, -1)
        if lost.any():
            response[:, :, lost] = self._in_strains(omega[lost])
        return response

    @cached_property
    def _strained(self) -> list[tuple[_Part, StrainSystem]]:
        """The parts, each with its rows prepared for strain coordinates."""
        parts = [part for group in self.groups for part in group]
        return [(part, StrainSystem(part.left, part.right, part.forces, self.weights, self.segments)) for part in parts]

    def _in_strains(self, omega: Array) -> Array:
        """Return the response by strain coordinates, and warn of its rounding."""
        total = np.tile(self.direct.astype(complex), (len(omega), 1, 1))
        rounding = np.zeros(total.shape)
        for part, system in self._strained:
            response, error = system.response(1j * omega, part.L)
            total += part.W_out @ response @ part.W_in.T
            rounding += np.abs(part.W_out) @ error @ np.abs(part.W_in).T
        size = np.abs(total).max(axis=1, initial=0.0)
        ratio = np.divide(rounding.max(axis=1, initial=0.0), size, out=np.zeros_like(size), where=size > 0.0).max(
            axis=1
        )
        if len(omega):
            worst = int(np.argmax(ratio))
            of = f"the exact beam's response at {omega[worst]:.6g} rad/s"
            warn_of_rounding(of, float(ratio[worst]), PROMISED)
        return total.transpose(1, 2, 0)


def _add(parts: Parts, coefficients: Array, functions: Array, total: Array) -> Array:
    """Add the response of parts of one pattern, (outputs * inputs, frequencies); return where it lost too many digits.

    All parts are solved at once, the frequencies of one after those of another.
    """
    (n, m), count, points = parts[0].forces.shape, len(parts), functions.shape[1]
    values = _combined(coefficients.reshape(-1, coefficients.shape[2]), functions).reshape(-1, count * points)
    D, check, B, check_B = np.split(values, np.cumsum([len(parts[0].places), n, n * m]))
    entries = dict(zip(parts[0].places, D, strict=True))
    X, lost = solve_symmetric(n, entries, list(B.reshape(n, m, -1)), check, check_B)
    for k, part in enumerate(parts):
        if part.shown:
            rows = np.array([X[i][v, k * points : (k + 1) * points] for i, v in part.shown])
            total += _combined(part.mixing, rows)
    return np.asarray(lost.reshape(count, points).any(axis=0))


def solve_symmetric(n: int, D: Entries, B: list[Array], check: Array, check_B: Array) -> tuple[list[Array], Array]:
    """Solve ``D(f) X(f) = B(f)`` for each frequency ``f``, and tell where too many digits are lost, (N,) bool.

    Parameters
    ----------
    n : int
        Number of equations.
    D : mapping from (i, j), i >= j, to (N,) arrays
        Lower triangle of a complex symmetric matrix at ``N`` frequencies; entries not there are zero.
    B : list of (m, N) arrays
        Right-hand sides, one item an equation.
    check : (n, N) array
    check_B : (m, N) array
        A weighted sum of all equations, left and right side.
    """
    X, lost = _eliminate(n, D, B)
    return X, lost | ~(_residual(X, check, check_B) <= _RESIDUAL)


def _eliminate(n: int, D: Entries, B: list[Array]) -> tuple[list[Array], Array]:
    """Return the solution, and where a pivot is what little is left of its entry: there, what was left may be rounding."""
    A, rhs = dict(D), list(B)
    inverse: list[Array] = []
    factors: list[list[tuple[int, Array]]] = []
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for k in range(n):
            inverse.append(1.0 / A[k, k])
            later = [i for i in range(k + 1, n) if (i, k) in A]
            factors.append([(i, A[i, k] * inverse[k]) for i in later])
            for place, (i, factor) in enumerate(factors[k]):
                for j in later[: place + 1]:
                    update = factor * A[j, k]
                    A[i, j] = A[i, j] - update if (i, j) in A else -update
                rhs[i] = rhs[i] - factor * rhs[k]
        for k in reversed(range(n)):
            value = rhs[k] * inverse[k]
            for i, factor in factors[k]:
                value -= factor * rhs[i]
            rhs[k] = value
        quotients = np.empty((n, len(inverse[0])), dtype=complex)
        for k in range(n):
            np.multiply(D[k, k], inverse[k], out=quotients[k])
        left = quotients.view(float)
        np.abs(left, out=left)
        lost = np.zeros(left.shape[1] // 2, dtype=bool)
        if not left.max(initial=0.0) <= _CANCELLED:
            lost = ~(left.reshape(n, -1, 2).max(axis=(0, 2)) <= _CANCELLED)
    return rhs, lost


def _residual(X: list[Array], check: Array, check_B: Array) -> Array:
    """Return, for each frequency, by how much the weighted sum of equations is missed, relative to its terms."""
    with np.errstate(invalid="ignore", over="ignore"):
        terms = np.array(X)
        terms *= check[:, None, :]
        size = _size(check_B) + _size(terms).sum(axis=0) + np.finfo(float).tiny
        gap = terms.sum(axis=0)
        gap -= check_B
        return (_size(gap) / size).max(axis=0)


def _size(value: Array) -> Array:
    """Return ``|Re| + |Im|``, cheaper than the modulus."""
    parts = np.abs(value.view(float))
    return parts[..., ::2] + parts[..., 1::2]
