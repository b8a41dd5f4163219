"""Transfer functions as state-space systems, their response compared with that of the polynomials.

Entries with the same denominator and input become one balanced companion form with the original coefficients; with fewer
outputs than inputs, entries with the same denominator and output.  An entry that is zero has no state.  Uncontrollable and
unobservable states of a matrix are removed by SLICOT's staircase algorithm.  Polynomials are inaccurate for many or lightly
damped modes, so the response of the realization is compared with that of the polynomials around every pole and zero.
"""

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance, blocks
from boomctl.lti.rounding import ALIKE, LEVEL, SUMMED

if TYPE_CHECKING:
    import control

_NEARBY = (0.5, 0.99, 1.01, 2.0)  # Compared frequencies, as multiples of the magnitude of a pole or zero.
_REST = 1.0  # Compared frequency if all poles and zeros are at zero [rad/s].
_HALF_CIRCLE = np.linspace(
    0.01, 3.1, 64
)  # Compared angles in discrete time, in addition to those near poles and zeros.


def realized(system: "control.TransferFunction", what: str) -> tuple[Array, Array, Array, Array]:
    """Return ``A, B, C, D`` of a transfer function, balanced.

    A single entry retains all poles, also those that a zero cancels; a matrix retains only the poles of its response.

    Raises
    ------
    ValueError
        If a coefficient is not finite, if it is not proper, or if the realization has another response.
    """
    entries = [
        (np.asarray(n, dtype=float), np.asarray(d, dtype=float))
        for n, d in zip(chain(*system.num), chain(*system.den), strict=True)
    ]
    for n, d in entries:
        if not (np.isfinite(n).all() and np.isfinite(d).all()):
            raise ValueError(f"{what}: expected finite coefficients")
        if len(np.trim_zeros(n, "f")) > len(np.trim_zeros(d, "f")):
            raise ValueError(f"{what}: expected a proper transfer function, got a numerator of higher order")
    shape = system.noutputs, system.ninputs
    roots = np.concatenate([np.roots(part) for entry in entries for part in entry])
    if system.isctime():
        rates = np.abs(roots)
        at = 1j * np.unique(np.outer(rates[rates > 0.0] if rates.any() else [_REST], _NEARBY))
    else:
        nearby = np.outer(np.abs(np.angle(roots)), _NEARBY)
        at = np.exp(1j * np.union1d(_HALF_CIRCLE, nearby[(nearby > 0.0) & (nearby < np.pi)]))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        num, den, sizes_n, sizes_d = (
            np.array([np.polyval(size(entry[k]), size(at)) for entry in entries]).reshape(*shape, len(at))
            for size in (np.asarray, np.abs)
            for k in (0, 1)
        )
        G = num / den
        out, into = _signal_scales(np.abs(G).max(axis=2, where=np.isfinite(G), initial=0.0))
        A, B, C, D = _companions(entries, shape)
        order = len(A)
        if len(entries) > 1:
            A, B, C = _minimal(A, B * into, C / out[:, None])
            B, C = B / into, C * out[:, None]
        A, scale = balance(A)
        B, C = B / scale[:, None], C * scale
        error = C @ np.linalg.solve(at[:, None, None] * np.eye(len(A)) - A, B.astype(complex)[None]) + D
        error = np.abs(error.transpose(1, 2, 0) - G)
        allowed = LEVEL * np.abs(G) + SUMMED * (sizes_n + np.abs(G) * sizes_d) / np.abs(den)
        if len(A) < order:  # Entries were mixed: relative to all of them, in scaled units and as stored.
            units = (out[:, None] / into)[:, :, None]
            relative, absolute = (np.abs(G) / units).max(axis=(0, 1)), np.abs(G).max(axis=(0, 1))
            allowed += np.minimum(SUMMED * relative * units, ALIKE * absolute)
        if not (error <= allowed).all():
            raise ValueError(
                f"{what}: its polynomials have too few digits to tell its response in state space; expected a StateSpace"
            )
    return A, B, C, D


def _companions(entries: list[tuple[Array, Array]], shape: tuple[int, int]) -> tuple[Array, Array, Array, Array]:
    """Return balanced companion forms: one for entries of the same denominator and input.

    Of fewer outputs than inputs it is one for entries of the same denominator and output.
    """
    p, m = shape
    if p < m:
        A, B, C, D = _companions([entries[i * m + j] for j in range(m) for i in range(p)], (m, p))
        return A.T, C.T, B.T, D.T
    D, groups = np.zeros(shape), {}
    for k, (num, den) in enumerate(entries):
        n, d = np.trim_zeros(num, "f"), np.trim_zeros(den, "f")
        if len(n):
            i, j = divmod(k, m)
            n, d = np.pad(n, (len(d) - len(n), 0)) / d[0], d / d[0]
            D[i, j] = n[0]
            groups.setdefault((j, *d[1:]), {})[i] = n[1:] - n[0] * d[1:]
    parts = [(np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)))]
    for (j, *d), rows in groups.items():
        A, B, C = np.eye(len(d), k=-1), np.zeros((len(d), m)), np.zeros((p, len(d)))
        A[:1] = -np.array(d)
        A, scale = balance(A)
        B[:1, j] = 1.0 / scale[:1]
        C[list(rows)] = np.array(list(rows.values())) * scale
        parts.append((A, B, C))
    A, B, C = zip(*parts, strict=True)
    return linalg.block_diag(*A), np.vstack(B), np.hstack(C), D


def _minimal(A: Array, B: Array, C: Array) -> tuple[Array, Array, Array]:
    """Return a minimal realization of a system; unchanged if it is minimal already."""
    from boomctl.lti.python_control import control

    small = control.StateSpace(A, B, C, 0.0, remove_useless_states=False).minreal()
    return (small.A, small.B, small.C) if small.nstates < len(A) else (A, B, C)


def _signal_scales(sizes: Array) -> tuple[Array, Array]:
    """Return scales of outputs and inverse scales of inputs, powers of two, with which nonzero entries are similar."""
    p, m = sizes.shape
    inverse = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    scale = balance(blocks([[np.zeros((p, p)), sizes], [inverse.T, np.zeros((m, m))]]))[1]
    return scale[:p], scale[p:]
