"""Inputs and outputs of a second-order model.

The equations of motion and the outputs are, with ``d`` the inputs and ``q`` the coordinates,

    M q'' + C q' + K q = B0 d + B1 d' + B2 d''
    y = L0 q + L1 q' + L2 q'' + E0 d + E1 d' + E2 d''

A force input has only ``B0``, a displacement input all three.  If the velocity or acceleration of a displacement input is
imposed, ``integrators`` is the number of integrations from the signal to ``d``.
An output may have a second-order low-pass filter (damping ratio ``1/sqrt 2``) of a given bandwidth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from boomctl.arrays import Array, combined
from boomctl.checks import names
from boomctl.printing import compact
from boomctl.units import half_unit

# Damping ratio of Butterworth filters of order 2: a gain of 1/sqrt(2) at the corner.
FILTER_DAMPING = float(np.sqrt(0.5))


def evaluate(terms: Array, s: Array) -> Array:
    """Return ``X0 + s X1 + s^2 X2`` for each ``s``, shape (len(s), rows, columns)."""
    s = s[:, None, None]
    return terms[0] + s * (terms[1] + s * terms[2])


@dataclass(frozen=True, kw_only=True)
class Ports:
    """Names and matrices of inputs and outputs.

    Attributes
    ----------
    inputs, outputs : tuple of str
        Names of ``m`` inputs and ``p`` outputs.
    B, L, E : (3, n, m), (3, p, n), (3, p, m) ndarray
        As in the equations above, ``B[0]`` the columns of ``d``, ``B[1]`` those of ``d'``, and so on.
    moved : tuple of bool
        True for inputs that impose motion.
    integrators : tuple of int
        Number of integrations from an input to ``d``.
    bandwidths : tuple of float or None
        Bandwidths of the low-pass filters of outputs [rad/s]; None without a filter.
    primary : pair of tuples of str, or None
        Default inputs and outputs; None for all.
    strains : (rows, m) ndarray, or None
        Strains of a structure's elastic rows by imposed displacements, ``B[0] = -R^T diag(k) strains``.  Near a stiff beam
        ``B[0]`` itself consists of forces far larger than their resultant.  Zero for other inputs.
    tensions : (p, rows) ndarray, or None
        Rows of outputs that are reactions over the forces of the elastic rows, ``L[0] = tensions diag(k) R``.
    units : mapping from signal to str
        SI units of the signals whose unit is known.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    B: Array
    L: Array
    E: Array
    moved: tuple[bool, ...]
    integrators: tuple[int, ...]
    bandwidths: tuple[float | None, ...]
    primary: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    strains: Array | None = None
    tensions: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    __repr__ = compact

    @classmethod
    def of_forces(cls, inputs: tuple[str, ...], columns: Array, outputs: tuple[str, ...], lines: Array) -> "Ports":
        """Return the ports of force inputs (columns, (n, m)) and outputs (lines, (3, p, n)) without feedthrough."""
        n, m, p = columns.shape[0], len(inputs), len(outputs)
        B = np.zeros((3, n, m))
        B[0] = columns.reshape(n, m)
        return cls(
            inputs=inputs,
            outputs=outputs,
            B=B,
            L=lines,
            E=np.zeros((3, p, m)),
            moved=(False,) * m,
            integrators=(0,) * m,
            bandwidths=(None,) * p,
        )

    def select(self, inputs: str | Sequence[str] | None, outputs: str | Sequence[str] | None) -> "Ports":
        """Return the named ports, in the requested order; ``None`` means all.  Named ports become the primary ones."""
        if inputs is None and outputs is None:
            return self
        ins, outs = names("input", inputs, self.inputs), names("output", outputs, self.outputs)
        i = [self.inputs.index(name) for name in ins]
        o = [self.outputs.index(name) for name in outs]
        first = self.primary
        if first is not None:
            first = ins if inputs is not None else first[0], outs if outputs is not None else first[1]
        return replace(
            self,
            primary=first,
            inputs=ins,
            outputs=outs,
            B=self.B[:, :, i],
            L=self.L[:, o],
            E=self.E[:, o][:, :, i],
            moved=tuple(self.moved[k] for k in i),
            integrators=tuple(self.integrators[k] for k in i),
            bandwidths=tuple(self.bandwidths[k] for k in o),
            strains=None if self.strains is None else self.strains[:, i],
            tensions=None if self.tensions is None else self.tensions[o],
        )

    def congruent(self, T: Array) -> "Ports":
        """Return the ports over coordinates ``z`` with ``q = T z``."""
        return replace(self, B=T.T @ self.B, L=self.L @ T)

    def restricted(self, T: Array) -> "Ports":
        """Return the ports over ``z`` with ``q = T z``, with zeros in place of rounding error from the truncated motions."""
        (_, n, m), p = self.B.shape, self.L.shape[1]
        lines = combined(np.concatenate([self.B.transpose(0, 2, 1).reshape(3 * m, n), self.L.reshape(3 * p, n)]), T)
        B, L = lines[: 3 * m].reshape(3, m, lines.shape[1]), lines[3 * m :].reshape(3, p, lines.shape[1])
        return replace(self, B=B.transpose(0, 2, 1), L=L)

    def over_motions(self, V: Array, rigid: Array) -> "Ports":
        """Return the ports over motions ``V``, of which some are rigid.

        An imposed displacement acts through strains, which are zero for rigid motions.
        """
        result = self.restricted(V)
        result.B[0, rigid[:, None], np.flatnonzero(self.moved)] = 0.0
        return result

    def mixed(
        self,
        P: Array,
        ins: tuple[Array, tuple[str, ...]],
        outs: tuple[Array, tuple[str, ...]],
        rows: Array | slice = slice(None),
    ) -> "Ports":
        """Return the ports over ``z`` with ``q = P z`` whose inputs ``v`` and outputs are ``d = W_in v``, ``W_out^T y``.

        ``ins`` and ``outs`` are ``W_in`` and ``W_out``, each with the names of the new signals, ``rows`` the elastic rows
        of the new structure.
        """
        (W_in, inputs), (W_out, outputs) = ins, outs
        first_in, first_out = np.abs(W_in).argmax(axis=0).tolist(), np.abs(W_out).argmax(axis=0).tolist()
        into = list(zip(inputs, (self.inputs[k] for k in first_in), strict=True))
        out = list(zip(outputs, (self.outputs[k] for k in first_out), strict=True))
        pairs, first = [(new, old, self.units.get(old, "")) for new, old in into + out], self.primary
        if first is not None:
            first = tuple(n for n, old in into if old in first[0]), tuple(n for n, old in out if old in first[1])
        return Ports(
            inputs=inputs,
            outputs=outputs,
            B=P.T @ (self.B @ W_in),
            L=(W_out.T @ self.L) @ P,
            E=W_out.T @ self.E @ W_in,
            moved=tuple(self.moved[k] for k in first_in),
            integrators=tuple(self.integrators[k] for k in first_in),
            bandwidths=tuple(self.bandwidths[k] for k in first_out),
            primary=first,
            strains=None if self.strains is None else self.strains[rows] @ W_in,
            tensions=None if self.tensions is None else W_out.T @ self.tensions[:, rows],
            units={new: unit if new == old else half_unit(unit, new) for new, old, unit in pairs},
        )

    def conditioned(self, s: Array, Y: Array) -> Array:
        """Return a response, (outputs, inputs, len(s)), behind the filters of outputs and integrators of inputs."""
        result = Y.copy()
        for i, bandwidth in enumerate(self.bandwidths):
            if bandwidth is not None:
                result[i] *= bandwidth**2 / (s**2 + 2 * FILTER_DAMPING * bandwidth * s + bandwidth**2)
        for i, count in enumerate(self.integrators):
            if count and (s == 0).any():
                raise ValueError(f"input {self.inputs[i]!r} is integrated: its response at omega = 0 is not finite")
            if count:
                result[:, i] *= s**-count
        return result
