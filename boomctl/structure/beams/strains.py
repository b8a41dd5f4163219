"""Exact beams in strain coordinates, for structures whose nodal dynamic stiffness is inaccurate, with rounding bounds.

A short segment has a stiffness of ``EI/l^3``.  The sum of its nodal stiffness with soft terms (springs, inertia) loses the
soft terms.  Here the coordinates are the strains of the springs and of the segments that are shorter than a wave at the
requested frequency; every other motion strains them by exactly zero (see :mod:`boomctl.structure.strain_coordinates`).  The
static part of the dynamic stiffness of these segments is that of the strains, and segments longer than a wave are soft.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import SMALLEST
from boomctl.lti.rounding import EPS
from boomctl.structure.beams.dynamic_stiffness import strain_functions, strain_lines, strain_terms
from boomctl.structure.beams.terms import Lines, kinds_of, term_weights, unit_terms
from boomctl.structure.layout import Weights
from boomctl.structure.parts import BeamSegment
from boomctl.structure.strain_coordinates import unstrained

_SHORT = 1.0  # |z| up to which strains of a segment are coordinates; rounding is alike from 0.5 to 2.
_DIFFERENCE = 1e-6  # Of |s|: step of the difference quotient, whose rounding and curvature are some 1e-10.


def wave_numbers(segments: Sequence[BeamSegment], s: Array) -> Array:
    """Return ``|z|`` of each undamped segment at each ``s``, shape (len(s), segments)."""
    unit = [(part.mass_per_length / part.bending_stiffness) ** 0.25 * part.length for part in segments]
    return np.sqrt(np.abs(s))[:, None] * np.array(unit)


@dataclass(frozen=True, eq=False)
class StrainEquations:
    """``D(s) z = B(s) d`` over strain coordinates, ``q = V z``.

    Attributes
    ----------
    V : (n, n) ndarray
    rigid : int
        Number of coordinates that strain neither a short segment nor a spring.
    kinds : tuple of BeamSegment
    coefficients, sizes : (numbers, n, n + m) ndarray
        Coefficients of ``1, s, s^2`` and six strain functions per kind of segment in ``[D, B]``; magnitudes of their
        terms.
    """

    V: Array
    rigid: int
    kinds: tuple[BeamSegment, ...]
    coefficients: Array
    sizes: Array

    def functions(self, s: Array) -> tuple[Array, Array]:
        """Return ``1, s, s^2`` and six strain functions per kind of segment at each ``s``, and their magnitudes."""
        values = np.empty((len(self.coefficients), len(s)), dtype=complex)
        sizes = np.empty(values.shape)
        values[0], values[1], values[2] = 1.0, s, s * s
        sizes[:3] = np.abs(values[:3])
        for k, kind in enumerate(self.kinds):
            modulus = 1.0 + kind.stiffness_damping * s
            x = -(s * s) * (kind.mass_per_length * kind.length**4 / kind.bending_stiffness) / modulus
            six, six_size = strain_functions(x)
            values[3 + 6 * k : 9 + 6 * k], sizes[3 + 6 * k : 9 + 6 * k] = six * modulus, six_size * np.abs(modulus)
        return values, sizes

    def at(self, values: Array) -> Array:
        """Return ``[D, B]`` at frequencies of these function values, (frequencies, n, n + m)."""
        return np.tensordot(values.T, self.coefficients, 1)

    def size(self, sizes: Array) -> Array:
        """Return the magnitudes of the terms of ``[D, B]`` from those of the functions."""
        return np.tensordot(sizes.T, self.sizes, 1)

    def scale(self, sizes: Array) -> Array:
        """Return scales of lines and columns with which no term of the diagonal exceeds one, (frequencies, n)."""
        terms = np.einsum("kii->ki", self.sizes[:, :, : self.V.shape[0]])
        return 1.0 / np.sqrt(np.maximum(sizes.T @ terms, np.finfo(float).tiny))

    @property
    def unit_rounding(self) -> float:
        """Bound on the rounding error of sum and elimination, relative to the terms (Higham 2002, section 3.1)."""
        return (len(self.coefficients) + self.V.shape[0]) * EPS


def stack_columns(left: Lines, right: Lines) -> Lines:
    """Return rows over coordinates, followed by columns for the inputs."""
    return np.hstack([left[0], right[0]]), np.hstack([left[1], right[1]]), np.hstack([left[2], right[2]])


@dataclass(frozen=True, eq=False)
class StrainSystem:
    """Rows of a structure with exact beams, ready for strain coordinates at any frequency.

    Attributes
    ----------
    left : tuple of ndarray
        ``N, R, S`` over the ``n`` coordinates.
    right : tuple of ndarray
        The same over the ``m`` inputs, with the sign of a load.
    forces : (n, m) ndarray
        Loads themselves.
    weights, segments : Weights, tuple of BeamSegment
    """

    left: Lines
    right: Lines
    forces: Array
    weights: Weights
    segments: tuple[BeamSegment, ...]
    _known: dict[bytes, StrainEquations] = field(default_factory=dict, init=False, repr=False)

    @property
    def at_rest(self) -> StrainEquations:
        """The equations over the strains of all segments."""
        return self._equations(np.ones(len(self.segments), dtype=bool))

    def _equations(self, short: Array) -> StrainEquations:
        """Return the equations over the strains of the short segments, which are cached."""
        key = short.tobytes()
        if key in self._known:
            return self._known[key]
        (N, R, S), weights, segments = self.left, self.weights, self.segments
        n, stiffness = N.shape[1], np.array([part.bending_stiffness / part.length**3 for part in segments])
        lines = strain_lines(S)
        imposed = self.right[0], self.right[1], strain_lines(self.right[2])
        scale = np.sqrt(np.stack([stiffness, 3.0 * stiffness], axis=1)).ravel()
        strains = lines.reshape(-1, 4, n)[:, 2:].reshape(-1, n) * scale[:, None]
        stiff = weights.k > SMALLEST * max(float(stiffness.max(initial=0.0)), float(weights.k.max(initial=0.0)))
        rows = np.concatenate([strains, np.sqrt(weights.k)[:, None] * R])
        used = np.concatenate([np.repeat(short, 2), stiff]) & rows.any(axis=1)
        V, strained, r = np.eye(n), rows[used], 0
        if used.any():
            reach = np.linalg.norm(strained / np.linalg.norm(strained, axis=1)[:, None], axis=0)
            V, Q, order, r = unstrained(strained, strained, 1.0 / np.where(reach > 0.0, reach, 1.0))
            strained = Q[np.argsort(order)]
        unit, count = np.sqrt(np.where(stiff, weights.k, 1.0)), len(strains)

        def numbers(size: Callable[[Array], Array]) -> Array:
            """Return the coefficients of the functions, from the numbers or from their absolute values."""
            T = size(V)
            moved, ends = size(rows) @ T, size(lines) @ T
            moved[used] = size(strained)
            ends.reshape(-1, 4, n)[:, 2:] = (moved[:count] / scale[:, None]).reshape(-1, 2, n)
            own = size(N) @ T, np.where(stiff[:, None], moved[count:] / unit[:, None], size(R) @ T), ends
            both = stack_columns(own, (size(imposed[0]), size(imposed[1]), size(imposed[2])))
            loads = np.hstack([np.zeros((n, n)), T.T @ size(self.forces)])
            return np.tensordot(term_weights(weights, segments), unit_terms(own, both, loads, strain_terms), 1)

        self._known[key] = StrainEquations(V, n - r, kinds_of(segments), numbers(np.asarray), numbers(np.abs))
        return self._known[key]

    def groups(self, s: Array) -> list[tuple[Array, StrainEquations]]:
        """Return the equations, each with the indices of ``s`` for which they hold."""
        short = wave_numbers(self.segments, s) < _SHORT
        count = short.sum(axis=1)  # Identifies them: they are the shortest ones.
        groups = [np.flatnonzero(count == k) for k in range(len(self.segments) + 1)]
        return [(indices, self._equations(short[indices[0]])) for indices in groups if len(indices)]

    def inertia(self, omega: Array) -> Array:
        """Return the eigenvalues of the scaled undamped dynamic stiffness, ascending, shape (len(omega), n)."""
        n = self.forces.shape[0]
        values = np.empty((len(omega), n))
        for indices, equations in self.groups(omega):
            functions, sizes = equations.functions(1j * omega[indices])
            D, scale = equations.at(functions), equations.scale(sizes)
            values[indices] = np.linalg.eigvalsh(scale[:, :, None] * D.real * scale[:, None, :])
        return values

    def newton_step(self, s: Array) -> tuple[Array, Array]:
        """Return ``det D/(det D)'`` at each ``s``: one over the trace of ``D^-1 D'``; and a bound of its rounding."""
        step, rounding = np.empty(len(s), dtype=complex), np.empty(len(s))
        for indices, equations in self.groups(s):
            at, h = s[indices], _DIFFERENCE * np.abs(s[indices])
            (functions, sizes), up, down = (equations.functions(x) for x in (at, at + h, at - h))
            D, size, scale = equations.at(functions), equations.size(sizes), equations.scale(sizes)
            slope = equations.at(up[0] - down[0]) / (2.0 * h)[:, None, None]
            both = scale[:, :, None] * scale[:, None, :]
            try:
                inverse = np.linalg.inv(both * D)
            except np.linalg.LinAlgError:  # An iterate is an eigenvalue to full accuracy.
                inverse = np.linalg.inv(both * D + EPS * np.eye(D.shape[1]))
            trace = np.einsum("fij,fji->f", inverse, both * slope)
            step[indices] = 1.0 / trace
            lost = np.einsum("fij,fji->f", np.abs(inverse), both * size)
            rounding[indices] = equations.unit_rounding * lost / np.abs(trace)
        return step, rounding

    def response(self, s: Array, L: Array) -> tuple[Array, Array]:
        """Return ``L q`` at each ``s``, (len(s), outputs, m), and a bound of its rounding."""
        n, m = self.forces.shape
        result = np.empty((len(s), len(L), m), dtype=complex)
        rounding = np.empty(result.shape)
        for indices, equations in self.groups(s):
            functions, sizes = equations.functions(s[indices])
            both, size, scale = equations.at(functions), equations.size(sizes), equations.scale(sizes)
            D = scale[:, :, None] * both[:, :, :n] * scale[:, None, :]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                try:
                    inverse = np.linalg.inv(D)
                    z = scale[:, :, None] * np.linalg.solve(D, scale[:, :, None] * both[:, :, n:])
                except np.linalg.LinAlgError:
                    raise ValueError("omega hits an undamped resonance: the response is infinite") from None
                read = L @ equations.V
                backward = size[:, :, :n] @ np.abs(z) + size[:, :, n:]
                forward = scale[:, :, None] * (np.abs(inverse) @ (scale[:, :, None] * backward))
                result[indices] = read @ z
                forward += np.abs(z)
                rounding[indices] = equations.unit_rounding * (np.abs(L) @ (np.abs(equations.V) @ forward))
        return result, rounding
