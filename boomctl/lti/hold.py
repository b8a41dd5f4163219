"""Exact steps of linear systems for held and linearly interpolated inputs, one by one or in blocks.

For a signal that is held or linear between samples the step of a linear system from sample to sample is exact.  Its maps
are blocks of one matrix exponential, or of two if a held signal changes within the step.  Many steps are computed in
blocks: :func:`recursion` returns all states, :func:`lifted_motion` the outputs, with matrix products in place of steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isqrt

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from boomctl.arrays import Array, balance, blocks
from boomctl.lti.rounding import EPS
from boomctl.lti.system import Lti

BLOCK = 64  # Number of steps in a block: the fastest for systems with 20 to 50 states.
_GROUP = 4  # Least number of steps that one product moves, of large systems: more cost accuracy, fewer cost time.
_SINGLE_STEPS = 1024  # States times steps up to which each step is one product.
# Inverse factorials of the Taylor polynomial of exp(X) - I.  Its remainder is below rounding for a norm of X up to 1/2.
_TAYLOR = (1.0 / np.cumprod(np.arange(1.0, 17.0))).reshape(4, 4)
# Largest change of an entry of the state matrix by its Schur form, relative to that entry, in multiples of rounding.  Dense
# matrices have 1e4 and less; where entries are structural zeros or far below the others, it has no limit.
_SCHUR_ROUNDING = 1e5


def matrix_expm1(A: Array) -> Array:
    """Compute ``exp(A) - I`` of a square matrix, each entry accurate to the rounding error of its terms.

    A Taylor polynomial of ``X = A/2^k`` is doubled ``k`` times, ``E <- 2 E + E^2``.  Sums and products of entries alone
    preserve the zeros of ``A``, so a chain of integrators is exact; without the unit matrix the increments of slow
    states are accurate when fast states determine ``k``.  Scaling a state changes no rounding error: ``k`` depends on the
    norm of the balanced matrix, which is not used otherwise.  ``k`` is at least ``log2 n``, so that entries that depend only
    on paths through more states than the degree of the polynomial are accurate too.

    Source: Higham (2008), Functions of Matrices, chapter 10.
    """
    n = len(A)
    if not n:
        return A
    balanced, low, high, _, _ = lapack.dgebal(A, scale=True, permute=True)
    cycles = np.abs(balanced[low : high + 1, low : high + 1]).sum(axis=0).max(initial=0.0)
    norm = max(float(cycles), float(np.abs(np.diag(balanced)).max()))
    if not np.isfinite(norm):
        return np.full_like(A, np.nan)
    count = max(int(np.frexp(norm)[1]) + 1, n.bit_length())
    X = np.ldexp(A, -count)
    square = X @ X
    powers = np.stack([X, square, square @ X, square @ square])
    parts = (_TAYLOR @ powers.reshape(4, -1)).reshape(powers.shape)
    E = parts[3]
    for part in parts[2::-1]:  # by Horner's rule in the fourth power
        E = powers[3] @ E + part
    for _ in range(count):
        E = E @ E + (E + E)
    return E


def motion_coordinates(system: Lti) -> tuple[Lti, Array]:
    """Return a continuous system in coordinates in which its motion is accurate, and the map of its states to them.

    Powers of a dense matrix with a large departure from normality, as with equal poles, cancel, but not over Schur vectors.
    A Schur form, however, changes every entry by rounding of the largest one, and the effect of a change in a chain of
    integrators grows with powers of time.  Therefore a matrix with zeros, or with small entries that would change, is
    unchanged.
    """
    n = len(system.A)
    A, scale = balance(system.A)
    if n and A.all():
        form, Z = linalg.schur(A)
        if (np.abs(Z @ form @ Z.T - A) <= _SCHUR_ROUNDING * EPS * np.abs(A)).all():
            to_form = Z.T / scale
            return replace(system, A=form, B=to_form @ system.B, C=(system.C * scale) @ Z), to_form
    return system, np.eye(n)


def zero_order_hold(A: Array, B: Array, step: float) -> tuple[Array, Array]:
    """Return ``Phi, G`` of ``x[k+1] = Phi x[k] + G u[k]``, exact for inputs held over the step."""
    n, m = B.shape
    generator = np.zeros((n + m, n + m))
    generator[:n, :n], generator[:n, n:] = step * A, step * B
    upper = matrix_expm1(generator)[:n]
    return upper[:, :n] + np.eye(n), upper[:, n:]


def linear_hold(A: Array, B: Array, step: float) -> tuple[Array, Array, Array]:
    """Return ``Phi, G, H`` of ``x[k+1] = Phi x[k] + G u[k] + H (u[k+1] - u[k])``, exact for inputs linear in between.

    It is a hold of the derivatives of the inputs, with the inputs as additional states.
    """
    n, m = B.shape
    ramps = blocks([[A, B], [np.zeros((m, n + m))]])
    Phi, H = zero_order_hold(ramps, np.eye(n + m, m, -n) / step, step)
    return Phi[:n, :n], Phi[:n, n:], H[:n]


def changing(A: Array, B: Array, whole: Array, duration: float, changes: Array) -> tuple[Array, Array]:
    """Return the contributions of inputs to the state over a duration, (n, m): before and after each change.

    Parameters
    ----------
    A, B : (n, n) and (n, m) ndarray
    whole : (n, m) ndarray
        Contributions of inputs that are held throughout.
    duration : float
        Duration [s].
    changes : (m,) ndarray
        Time from the beginning to the change of each input [s].
    """
    before, after = np.zeros_like(whole), np.zeros_like(whole)
    for change in set(changes.tolist()):
        these = changes == change
        if 0.0 < change < duration:  # two holds, one after the other
            rest, after[:, these] = zero_order_hold(A, B[:, these], duration - change)
            before[:, these] = rest @ zero_order_hold(A, B[:, these], change)[1]
        else:
            (after if change <= 0.0 else before)[:, these] = whole[:, these]
    return before, after


def recursion(Phi: Array, forcing: Array, start: Array) -> Array:
    """Return ``x[0] .. x[N]`` (columns) of ``x[k+1] = Phi x[k] + forcing[:, k]``."""
    n, count = forcing.shape
    length = max(int(np.sqrt(count)), 1)
    runs = -(-count // length)
    states = np.zeros((runs * length + 1, n))
    states[0], states[1 : count + 1] = start, forcing.T
    within, advance = states[1:].reshape(runs, length, n), Phi.T
    for k in range(1, length):
        within[:, k] += within[:, k - 1] @ advance
    power = np.linalg.matrix_power(advance, length)
    inherited, state = np.empty((runs, n)), states[0]
    for j in range(runs):
        inherited[j] = state
        state = state @ power + within[j, -1]
    for k in range(length):
        inherited = inherited @ advance
        within[:, k] += inherited
    return states[: count + 1].T


def linear_hold_response(system: Lti, inputs: Array, step: float, start: Array) -> Array:
    """Return the outputs of a continuous system at the samples of its inputs, which run straight between them.

    Parameters
    ----------
    system : Lti
        Continuous; ``m`` inputs, ``p`` outputs.
    inputs : (m, N) ndarray
    step : float
        Time between samples [s].
    start : (n,) ndarray
        State at the first sample.

    Returns
    -------
    (p, N) ndarray
        Exact to within rounding.
    """
    form, to_form = motion_coordinates(system)
    Phi, G, H = linear_hold(form.A, form.B, step)
    return lifted_motion((Phi, G - H, H), form.C, form.D, inputs, to_form @ start)[0]


@dataclass(frozen=True)
class Lifted:
    """``x+ = Phi x + G u``, ``y = C x + D u`` over blocks of ``size`` steps.

    Attributes
    ----------
    observed : (size, outputs, n) ndarray
        Outputs within a block per initial state.
    power : (n, n) ndarray
        Final state of a block per initial state.
    reached : (size, inputs, n) ndarray
        Final state of a block per input within it.
    pulse : (outputs, inputs, size) ndarray
        Pulse responses.
    """

    size: int
    observed: Array
    power: Array
    reached: Array
    pulse: Array

    @classmethod
    def of(cls, Phi: Array, G: Array, C: Array, D: Array, size: int) -> Lifted:
        """Return the blocks of a recursion."""
        observed, power = observability(Phi, C, size)
        reached = observability(Phi.T, G.T, size)[0][::-1]
        answers = (observed[:-1] @ G).transpose(1, 2, 0)
        return cls(size, observed, power, reached, np.concatenate([D[:, :, None], answers], axis=2))

    def blocks(self, U: Array) -> Array:
        """Return signals (inputs, count) as blocks (inputs, blocks, size), padded with zeros."""
        count = -(-U.shape[1] // self.size)
        padded = np.zeros((len(U), count * self.size))
        padded[:, : U.shape[1]] = U
        return padded.reshape(len(U), count, self.size)

    def pushed(self, blocks: Array) -> Array:
        """Return the contribution of the inputs to the final state of each block, (blocks, n)."""
        inputs, count, size = blocks.shape
        flat = blocks.transpose(1, 2, 0).reshape(count, size * inputs)
        return flat @ self.reached.reshape(size * inputs, self.reached.shape[2])

    def forced(self, blocks: Array, outputs: slice = slice(None)) -> Array:
        """Return outputs within each block from its inputs alone, (outputs, blocks, size)."""
        pulse = self.pulse[outputs]
        y = np.zeros((len(pulse), *blocks.shape[1:]))
        for o in range(len(pulse)):
            for i in range(len(blocks)):
                if pulse[o, i].any():
                    y[o] += blocks[i] @ _toeplitz(pulse[o, i]).T
        return y

    def free(self, starts: Array, outputs: slice = slice(None)) -> Array:
        """Return outputs within each block from the states (blocks, n) at its beginning, (outputs, blocks, size)."""
        return starts @ self.observed[:, outputs].transpose(1, 2, 0)


def recursion_without_lead(Phi: Array, first: Array, last: Array, C: Array, D: Array) -> tuple[Array, Array]:
    """Return ``G`` and ``D`` of ``x = z - last u`` for ``z+ = Phi z + first u + last u+``, ``y = C z + D u``."""
    return first + Phi @ last, D + C @ last


def lifted_motion(
    maps: tuple[Array, Array, Array], C: Array, D: Array, U: Array, start: Array | float = 0.0
) -> tuple[Array, Array]:
    """Return ``y = C z + D u`` at each step, (outputs, steps + 1), for ``z+ = Phi z + first u + last u+``, ``z = start``.

    The second value are the states ``z`` at the beginnings of blocks, (blocks, n).  Only these are computed sequentially.
    """
    Phi, first, last = maps
    G, through = recursion_without_lead(Phi, first, last, C, D)
    lifted = Lifted.of(Phi, G, C, through, min(BLOCK, U.shape[1]))
    blocks = lifted.blocks(U)
    starts = recursion(lifted.power, lifted.pushed(blocks).T, start - last @ U[:, 0])[:, :-1].T
    y = lifted.forced(blocks)
    y += lifted.free(starts)
    return y.reshape(len(C), -1)[:, : U.shape[1]], starts


def observability(Phi: Array, C: Array, size: int) -> tuple[Array, Array]:
    """Return ``C Phi^k`` for k below ``size``, (size, outputs, n), and ``Phi^size``.

    Steps are computed in sequence, one by one or in small groups.  Squares of high powers would cancel where powers grow
    before they decay, as with equal poles in companion form.
    """
    outputs, n = C.shape
    length = 1 if n * size <= _SINGLE_STEPS else max(_GROUP, isqrt(size) // 2)
    first, moved = [C], Phi
    for _ in range(length - 1):
        first.append(first[-1] @ Phi)
        moved = moved @ Phi
    groups = [np.concatenate(first)]
    for _ in range(-(-size // length) - 1):
        groups.append(groups[-1] @ moved)
    power = np.eye(n)
    for factor, count in ((moved, size // length), (Phi, size % length)):
        for _ in range(count):
            power = power @ factor
    return np.concatenate(groups)[: size * outputs].reshape(size, outputs, n), power


def _toeplitz(column: Array) -> Array:
    """Return the lower triangular Toeplitz matrix of a column."""
    n = len(column)
    line = np.concatenate([np.zeros(n - 1), column])
    return np.lib.stride_tricks.sliding_window_view(line, n)[:, ::-1].copy()
