"""ExactModel: rigid bodies and springs as matrices, beams as exact dynamic stiffness, at any frequency."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.structure.beams.dynamic_stiffness import Segment, clamped_count, end_functions, segment_coefficients
from boomctl.structure.elimination import Elimination, eliminate
from boomctl.structure.matrices import dense
from boomctl.structure.ports import Ports
from boomctl.structure.symmetry import TOLERANCE, Mirror

_RESIDUAL = 1e-11  # of an equation's terms; where elimination leaves more, LAPACK solves anew (a choice)

Entries = Mapping[tuple[int, int], Array]


@dataclass(frozen=True)
class PlacedSegment:
    """A segment and the rows of its end displacements and rotations, ``w1, phi1, w2, phi2``."""

    segment: Segment
    rows: Array


@dataclass(frozen=True)
class ExactModel:
    """A structure whose beams are exact: ``D(s) q = B(s) d``, ``y = L q + E d``.

    Attributes
    ----------
    M, C, K : (n, n) ndarray
        Of everything but the beams' bending.
    placed : tuple of PlacedSegment
        The beams, segment by segment.
    ports : Ports
        Inputs and outputs over the coordinates; force inputs only until :meth:`prescribed`.
    coordinates : tuple of str
        Names.
    driven : Elimination or None
        Which inputs impose motion, as ``q = T_d d + T_q q_s``.
    moved : tuple of str
        Their names.
    mirror : Mirror or None
        The reflection about ``x = 0``, if there is one.
    """

    M: Array
    C: Array
    K: Array
    placed: tuple[PlacedSegment, ...]
    ports: Ports
    coordinates: tuple[str, ...]
    driven: Elimination | None = None
    moved: tuple[str, ...] = ()
    mirror: Mirror | None = None

    def prescribed(self, inputs: Sequence[str]) -> "ExactModel":
        """Return the structure with the motion of the points of the force inputs named imposed."""
        J = np.column_stack([self.ports.force_column(name) for name in inputs])
        choice = eliminate(J, tuple(inputs))
        mirror = self.mirror.restricted(choice) if self.mirror is not None else None
        return replace(self, driven=choice, moved=tuple(inputs), mirror=mirror)

    def mirrored(self, mirror: Mirror | None) -> "ExactModel":
        """Return the structure with a reflection, if it leaves the structure as it is; otherwise without."""
        bare = replace(self, mirror=None)
        if mirror is None:
            return bare
        system = _System.of(bare, self.ports.select((), ()))
        S = np.zeros((len(mirror.partner), len(mirror.partner)))
        S[np.arange(len(S)), mirror.partner] = mirror.sign
        change = np.abs(S @ system.D @ S.T - system.D).max(axis=(1, 2))
        return replace(self, mirror=mirror) if (change <= TOLERANCE * np.abs(system.D).max(axis=(1, 2))).all() else bare

    def prepared(self, inputs: Sequence[str], outputs: Sequence[str]) -> "PreparedResponse":
        """Return what of the frequency response does not depend on frequency; symmetric structures in halves."""
        wanted_in, wanted_out = tuple(inputs), tuple(outputs)
        if self.mirror is not None:
            wanted_in = self.mirror.completed(wanted_in, self.ports.inputs)
            wanted_out = self.mirror.completed(wanted_out, self.ports.outputs)
        ports = self.ports.select(wanted_in, wanted_out)
        whole = _System.of(self, ports)
        shape = (len(outputs), len(inputs))
        parts: list[tuple[_Solver, Array, Array]] = []  # with the half's outputs and inputs over the full ones
        for parity in (1, -1) if self.mirror is not None else ():
            assert self.mirror is not None
            ins, outs = self.mirror.signals(ports.inputs, parity), self.mirror.signals(ports.outputs, parity)
            if ins is None or outs is None:
                return replace(self, mirror=None).prepared(inputs, outputs)
            if ins[0].shape[1] and outs[0].shape[1]:
                half = whole.half(dense(self.mirror.basis(parity)), ins[0], outs[0])
                parts.append((half.solver(), outs[0][: shape[0]], ins[0][: shape[1]]))
        if self.mirror is None:
            parts = [(whole.solver(), np.eye(shape[0]), np.eye(shape[1]))]
        return PreparedResponse.of(shape, whole.functions, parts)

    def response(self, omega: Array, inputs: Sequence[str], outputs: Sequence[str]) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies), of displacement outputs."""
        return self.prepared(inputs, outputs).at(omega)

    def dynamic_stiffness(self, s: Array) -> Array:
        """Return ``D(s)`` of the free coordinates, shape (n, n, len(s))."""
        system = _System.of(self, self.ports.select((), ()))
        return system.matrix(system.functions(np.asarray(s, dtype=complex)))

    def count_below(self, omega: Array) -> Array:
        """Return how many undamped natural frequencies lie below each ``omega`` (Wittrick & Williams 1971)."""
        undamped = replace(self, C=np.zeros_like(self.C), placed=_undamped(self.placed))
        D = np.moveaxis(undamped.dynamic_stiffness(1j * omega).real, 2, 0)
        scale = np.sqrt(np.abs(D).max(axis=2))
        count = (np.linalg.eigvalsh(D / (scale[:, :, None] * scale[:, None, :])) < 0).sum(axis=1)
        for item in self.placed:
            seg = item.segment
            z = (omega**2 * seg.mass_per_length / seg.bending_stiffness) ** 0.25 * seg.length
            count = count + clamped_count(z)
        return count


def _undamped(placed: tuple[PlacedSegment, ...]) -> tuple[PlacedSegment, ...]:
    return tuple(
        PlacedSegment(Segment(p.segment.length, p.segment.mass_per_length, p.segment.bending_stiffness, 0.0), p.rows)
        for p in placed
    )


@dataclass(frozen=True)
class _System:
    """Coefficients of ``D`` and of the right-hand side over the functions ``1, s, s^2`` and six a kind of segment."""

    kinds: tuple[Segment, ...]
    D: Array
    B: Array
    L: Array
    E: Array

    @classmethod
    def of(cls, model: ExactModel, ports: Ports) -> "_System":
        if any(x.any() for triple in (ports.L, ports.E) for x in triple[1:]):
            raise ValueError("the exact beam offers displacement outputs only")
        if any(bandwidth is not None for bandwidth in ports.bandwidths):
            raise ValueError("the exact beam offers outputs without a bandwidth only")
        kinds = tuple(dict.fromkeys(item.segment for item in model.placed))
        n = len(model.coordinates)
        full = np.zeros((3 + 6 * len(kinds), n, n))
        full[0], full[1], full[2] = model.K, model.C, model.M
        for item in model.placed:
            first = 3 + 6 * kinds.index(item.segment)
            full[first : first + 6] += segment_coefficients(item.segment, item.rows)
        B = np.zeros((len(full), n, len(ports.inputs)))
        B[0] = ports.B[0]
        if model.driven is None:
            return cls(kinds, full, B, ports.L[0], np.zeros((len(ports.outputs), len(ports.inputs))))
        T_q, T_d = model.driven.T_q.toarray(), model.driven.T_d.toarray()
        E = np.zeros((len(ports.outputs), len(ports.inputs)))
        B = np.einsum("ja,fji->fai", T_q, B)
        for i, name in enumerate(ports.inputs):
            if name in model.moved:
                t = T_d[:, model.moved.index(name)]
                B[:, :, i] = -np.einsum("ja,fjk,k->fa", T_q, full, t)
                E[:, i] = ports.L[0] @ t
        return cls(kinds, T_q.T @ full @ T_q, B, ports.L[0] @ T_q, E)

    def half(self, P: Array, W_in: Array, W_out: Array) -> "_System":
        return _System(self.kinds, P.T @ self.D @ P, P.T @ self.B @ W_in, W_out.T @ self.L @ P, W_out.T @ self.E @ W_in)

    def functions(self, s: Array) -> Array:
        values = np.empty((3 + 6 * len(self.kinds), len(s)), dtype=complex)
        values[0], values[1], values[2] = 1.0, s, s * s
        for k, seg in enumerate(self.kinds):
            modulus = 1.0 + seg.damping * s
            x = -(s * s) * (seg.mass_per_length * seg.length**4 / seg.bending_stiffness) / modulus
            values[3 + 6 * k : 9 + 6 * k] = end_functions(x) * modulus
        return values

    def matrix(self, functions: Array) -> Array:
        terms, n, _ = self.D.shape
        return (self.D.reshape(terms, n * n).T @ functions).reshape(n, n, -1)

    def solver(self) -> "_Solver":
        """Return the coefficients of the entries that are not zero, ready for many frequencies."""
        n = self.D.shape[1]
        occupied = (np.abs(self.D).sum(axis=0) > 0) | np.eye(n, dtype=bool)
        places = tuple((int(i), int(j)) for i, j in np.argwhere(np.tril(occupied)))
        weights = 1.0 + 0.5 * np.cos(np.arange(n))
        rows = [self.D[:, i, j] for i, j in places]
        rows += list(np.einsum("i,fij->jf", weights, self.D))
        rows += list(np.moveaxis(self.B, 0, 2).reshape(-1, len(self.B)))
        rows += list(np.einsum("i,fim->mf", weights, self.B))
        return _Solver(n=n, inputs=self.B.shape[2], places=places, coefficients=np.array(rows), L=self.L, E=self.E)


def _combined(coefficients: Array, values: Array) -> Array:
    """Return real combinations of the rows of a complex array."""
    return (coefficients @ values.view(float)).view(complex)


@dataclass(frozen=True)
class _Solver:
    """One half (or the whole): ``coefficients`` of the entries of ``D``, the checks, ``B`` and its checks."""

    n: int
    inputs: int
    places: tuple[tuple[int, int], ...]
    coefficients: Array
    L: Array
    E: Array

    def check_static(self, functions: Array) -> None:
        D = np.zeros((self.n, self.n))
        for (i, j), value in zip(self.places, _combined(self.coefficients, functions)[:, 0].real, strict=False):
            D[i, j] = D[j, i] = value
        scale = np.sqrt(np.abs(np.diag(D))) + np.finfo(float).tiny
        size = np.linalg.svd(D / np.outer(scale, scale), compute_uv=False)
        if size[-1] <= 1e-13 * size[0]:
            raise ValueError("omega = 0: the structure moves freely (a rigid-body mode), its response is infinite")


@dataclass(frozen=True)
class _Batch:
    """Halves of one pattern, solved together; ``mixing`` takes their unknowns that show to the full response."""

    solvers: tuple[_Solver, ...]
    coefficients: Array
    shown: Array
    mixing: Array

    @classmethod
    def of(cls, parts: Sequence[tuple[_Solver, Array, Array]]) -> "_Batch":
        count, first = len(parts), parts[0][0]
        mixing = [np.einsum("ou,uk,iv->oikv", W_out, solver.L, W_in) for solver, W_out, W_in in parts]
        by_unknown = np.stack(mixing, axis=-1).reshape(-1, first.n * first.inputs * count)
        shown = np.flatnonzero(by_unknown.any(axis=0))
        coefficients = np.stack([solver.coefficients for solver, _, _ in parts], axis=1)
        stacked = coefficients.reshape(-1, coefficients.shape[2])
        return cls(tuple(solver for solver, _, _ in parts), stacked, shown, by_unknown[:, shown])

    def add(self, functions: Array, total: Array) -> None:
        """Add the batch's share of the response, (outputs * inputs, frequencies); frequencies of all halves in line."""
        first, count, points = self.solvers[0], len(self.solvers), functions.shape[1]
        values = _combined(self.coefficients, functions).reshape(-1, count * points)
        entries, n, m = len(first.places), first.n, first.inputs
        D = dict(zip(first.places, values, strict=False))
        check = values[entries : entries + n]
        B = values[entries + n : entries + n + n * m].reshape(n, m, -1)
        X = solve_symmetric(n, D, list(B), check, values[entries + n + n * m :])
        rows = [X[k // (m * count)][k // count % m].reshape(count, points)[k % count] for k in self.shown]
        if rows:
            total += _combined(self.mixing, np.array(rows))


@dataclass(frozen=True)
class PreparedResponse:
    """A structure with exact beams, ready to be asked for its response at any frequencies."""

    shape: tuple[int, int]
    functions: Callable[[Array], Array]
    batches: tuple[_Batch, ...]
    direct: Array

    @classmethod
    def of(
        cls,
        shape: tuple[int, int],
        functions: Callable[[Array], Array],
        parts: Sequence[tuple[_Solver, Array, Array]],
    ) -> "PreparedResponse":
        """Return the response of parts, each with its outputs and inputs over those of the whole."""
        alike: dict[object, list[tuple[_Solver, Array, Array]]] = {}
        for part in parts:
            alike.setdefault((part[0].places, part[0].inputs), []).append(part)
        direct = sum((W_out @ solver.E @ W_in.T for solver, W_out, W_in in parts), np.zeros(shape))
        return cls(shape, functions, tuple(_Batch.of(group) for group in alike.values()), direct)

    def at(self, omega: Array) -> Array:
        """Return the response, shape (outputs, inputs, frequencies), at ``omega`` [rad/s].

        Raises
        ------
        ValueError
            ``omega = 0`` and the structure moves freely.
        """
        if (omega == 0.0).any():
            for batch in self.batches:
                for solver in batch.solvers:
                    solver.check_static(self.functions(np.zeros(1, dtype=complex)))
        total = np.empty((self.direct.size, len(omega)), dtype=complex)
        total[:] = self.direct.reshape(-1, 1)
        functions = self.functions(1j * omega)
        for batch in self.batches:
            batch.add(functions, total)
        return total.reshape(*self.shape, -1)


def solve_symmetric(n: int, D: Entries, B: list[Array], check: Array, check_B: Array) -> list[Array]:
    """Solve ``D(f) X(f) = B(f)`` for each frequency ``f``.

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
    X = _eliminate(n, D, B)
    bad = ~(_residual(X, check, check_B) <= _RESIDUAL)
    if bad.any():
        _by_lapack(n, D, X, B, bad)
    return X


def _eliminate(n: int, D: Entries, B: list[Array]) -> list[Array]:
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
    return rhs


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


def _by_lapack(n: int, D: Entries, X: list[Array], B: list[Array], bad: Array) -> None:
    full = np.zeros((int(bad.sum()), n, n), dtype=complex)
    for (i, j), value in D.items():
        full[:, i, j] = full[:, j, i] = value[bad]
    rhs = np.array([b[:, bad] for b in B])
    solved = np.linalg.solve(full, np.moveaxis(rhs, 2, 0))
    for i in range(n):
        X[i][:, bad] = solved[:, i].T
