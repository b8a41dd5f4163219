"""The methods of reduction: functions that cut a balanced form, and two choices of modes.

Three balance the system first, by square roots of its Gramians (Moore 1981; Tombs & Postlethwaite 1987), or of those of a
band of frequencies (Gawronski & Juang 1990, the modified scheme; Gugercin & Antoulas 2004 for the bound); two choose among
modes.  All but the choice of modes of a structure state a bound of their error beforehand.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf
from typing import TypeAlias

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.exceptions import ReductionError
from boomctl.lti.bilinear import continuous_image
from boomctl.lti.gramians import band_integral, refined_gramian, square_root
from boomctl.lti.modal import ModalSystem, diagonalized, residualised, spectral_parts
from boomctl.lti.rounding import ALIKE, DEPENDENT, LEVEL, ROOT, SUMMED
from boomctl.lti.system import Lti, parallel
from boomctl.reduction.verify import GRAMIANS, Band, SystemParts, Verified, verified
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import evaluate
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.realization import realize

_CENTER = 0.01  # Least lower limit of a range, relative to its upper limit, in its geometric mean.
_MOMENTS = 4  # Number of compared Markov parameters; sufficient for the few retained states.


@dataclass(frozen=True)
class Balanced:
    """A stable system whose Gramians are both ``diag(values)``, minimal.

    Attributes
    ----------
    system : Lti
    values : ndarray
        Hankel singular values, descending.
    lost : float
        Bound on the error of what is not minimal.
    retained : int
        Number of states in addition that are retained, for messages.
    """

    system: Lti
    values: Array
    lost: float
    retained: int

    def bound(self, order: int) -> float:
        """Return twice the sum of the truncated Hankel singular values, an error bound (Enns 1984, Glover 1984)."""
        return 2.0 * float(self.values[order:].sum()) + self.lost


def balance(system: Lti, modal: ModalSystem | None, retained: int = 0) -> Balanced:
    """Return the balanced minimal form of a stable system.

    In modal coordinates a Gramian is ``P_ij = -b_i b_j^*/(p_i + p_j^*)``.  ``modal`` is the same system in these, the real
    form of which is ``system``, or None.
    """
    if not len(system.A):
        return Balanced(system, np.zeros(0), 0.0, retained)
    if modal is None:
        P, Q = (refined_gramian(A, B).astype(float) for A, B in ((system.A, system.B), (system.A.T, system.C.T)))
    else:
        sums = modal.poles[:, None] + modal.poles.conj()
        P = modal.real_form(-(modal.B @ modal.B.conj().T) / sums)
        Q = modal.real_form(-(modal.C.conj().T @ modal.C) / sums.conj())
    F, H = square_root(P), square_root(Q)
    U, values, Vt = linalg.svd(H.T @ F, full_matrices=False)
    # with a tenth of it, reduced systems of a ladder of 100 states are not all stable
    count = int((values > DEPENDENT * values.max(initial=0.0)).sum())
    root = np.sqrt(values[:count])
    right, left = F @ Vt[:count].T / root, H @ U[:, :count] / root
    form = Lti(left.T @ system.A @ right, left.T @ system.B, system.C @ right, system.D)
    return Balanced(form, values[:count], 2.0 * float(values[count:].sum()), retained)


def truncated(form: Balanced, order: int) -> tuple[Lti, float]:
    """Return the leading states of the balanced form, and a bound on the error; exact at infinite frequency."""
    s = form.system
    return Lti(s.A[:order, :order], s.B[:order], s.C[:, :order], s.D), form.bound(order)


def perturbed(form: Balanced, order: int) -> tuple[Lti, float]:
    """Return the leading states, the others at rest (Liu & Anderson 1989), and a bound; exact at zero frequency."""
    return residualised(form.system, order), form.bound(order)


def nearest(form: Balanced, order: int) -> tuple[Lti, float]:
    """Return the nearest stable system in the Hankel norm (Glover 1984, Int. J. Control 39, Theorems 6.3 and 9.7).

    The Hankel norm of the error is the first truncated Hankel singular value, the minimum for any system of that order.
    Its H-infinity norm is not the smallest: it may exceed that of balanced truncation.  Its bound, ``sigma_{r+1} + 2 sum of
    the distinct later ones``, is the sum for an all-pass error and for the truncated antistable part.

    Raises
    ------
    ValueError
        If the Hankel singular value is repeated across the cut, so that there is no best system of this order.
    """
    values, n, r, kept = form.values, len(form.values), order, form.retained
    if r >= n:
        return form.system, form.lost
    distinct = np.concatenate([[0], np.flatnonzero(values[:-1] > values[1:] * (1.0 + ROOT)) + 1, [n]])
    if r not in distinct:
        low, high = int(distinct[distinct < r][-1]), int(distinct[distinct > r][0])
        raise ValueError(
            f"order {r + kept}: Hankel singular values {low + 1} to {high} are equal ({values[r]:.6g}), so that they "
            f"stay or go together; take {low + kept} or {high + kept}"
        )
    sigma = float(values[r])
    k = int((values[r:] >= sigma * (1.0 - ROOT)).sum())
    parts = spectral_parts(_dilated(form, r, k, sigma))
    if len(parts.rest.A) != r or len(parts.retained.A) != n - r - k:
        raise ValueError(
            f"order {r + kept}: the all-pass dilation has {len(parts.rest.A)} stable poles; Hankel singular values "
            f"{values[r]:.3g} and its neighbors are too close"
        )
    return parts.rest, sigma + 2.0 * float(values[r + k :].sum()) + form.lost


Cut: TypeAlias = Callable[[Balanced, int], tuple[Lti, float]]


class StateReducer:
    """A reduction in state space: the stable part is reduced and added to the retained part.

    Attributes
    ----------
    form : Balanced
        Balanced form of the stable part, weighted to the frequency range if there is one.
    """

    def __init__(self, cut: Cut, model: Lti | SecondOrderModel, parts: SystemParts, band: Band | None) -> None:
        self.cut, self.parts, self.band = cut, parts, band
        stable, modal, self.weights = parts.stable, parts.modal, ()
        if band is not None and len(stable.A):
            stable, modal, *self.weights = weighted(stable, modal, band)
        self.form = balance(stable, modal, len(parts.retained.A))

    def orders(self, error: float) -> Iterator[int]:
        """Yield the orders, ascending, retained part included, whose error may be at most ``error``.

        The error of a system of order ``r`` is at least the Hankel singular value ``r + 1``.  Values below the square root of
        rounding have no accuracy, and count as zero.
        """
        values, retained = self.form.values, self.form.retained
        least = max(error, GRAMIANS * float(values.max(initial=0.0)))
        fewest = int((values > least).sum()) if self.band is None else 0
        yield from range(retained + fewest, retained + len(self.parts.stable.A) + 1)

    def reduced(self, order: int) -> tuple[Lti, Verified]:
        """Return the reduced system, retained part included, and the verification of its stable part.

        Raises
        ------
        ValueError
            If there is no such order.
        ReductionError
            If the error exceeds its bound or could not be verified.
        """
        retained, stable = self.form.retained, self.parts.stable
        if order < retained:
            raise ValueError(
                f"order = {order}: {retained} unstable, undamped or rigid-body states are kept, so at least that"
            )
        try:
            smaller, bound = self.cut(self.form, min(order - retained, len(stable.A)))
        except np.linalg.LinAlgError:
            raise ReductionError(
                f"order {order}: the truncated states have no static response; use 'balanced'"
            ) from None
        if self.weights:
            T, R = self.weights
            smaller = Lti(smaller.A, smaller.B @ T, R @ smaller.C, stable.D + R @ smaller.D @ T)
            bound *= float(np.linalg.norm(R, 2) * np.linalg.norm(T, 2))
        small, result = verified(self.parts, smaller, bound, self.band)
        return parallel(self.parts.retained, small), result


def _dilated(balanced: Balanced, r: int, k: int, sigma: float) -> Lti:
    """Return the all-pass dilation: the given system minus it is ``sigma`` at every frequency."""
    cut = np.arange(r, r + k)
    keep = np.setdiff1d(np.arange(len(balanced.values)), cut)
    p, m = balanced.system.D.shape
    q = max(p, m)
    A = balanced.system.A[np.ix_(keep, keep)]
    B, C, D = np.zeros((len(balanced.values), q)), np.zeros((q, len(balanced.values))), np.zeros((q, q))
    B[:, :m], C[:p], D[:p, :m] = balanced.system.B, balanced.system.C, balanced.system.D
    U = _orthogonal(B[cut], C[:, cut], -_at_real_point(balanced.system.A, B, C))
    S = balanced.values[keep]
    B1, C1 = B[keep], C[:, keep]
    gamma = (S**2 - sigma**2)[:, None]
    A_new = (sigma**2 * A.T + S[:, None] * A * S[None, :] - sigma * C1.T @ U @ B1.T) / gamma
    B_new = (S[:, None] * B1 + sigma * C1.T @ U) / gamma
    C_new = C1 * S[None, :] + sigma * U @ B1.T
    return Lti(A_new, B_new[:, :m], C_new[:p], (D - sigma * U)[:p, :m])


def _at_real_point(A: Array, B: Array, C: Array) -> Array:
    """Return ``C (s - A)^-1 B`` at the real ``s`` amid the poles; unlike ``C B`` it is there for displacements, too."""
    s = float(np.exp(np.linalg.slogdet(A)[1] / len(A)))
    return C @ np.linalg.solve(s * np.eye(len(A)) - A, B)


def _orthogonal(B: Array, C: Array, near: Array) -> Array:
    """Return an orthogonal ``U`` with ``B = -C^T U``; it exists because ``B B^T = C^T C``.

    Where it is not unique, ``U`` is chosen close to ``near``, so that it does not depend on the order of the signals.
    """
    left, size, right = np.linalg.svd(-C @ B)
    rank = int((size > ROOT * size[0]).sum())
    rest_left, rest_right = left[:, rank:], right[rank:]
    turn, _, back = np.linalg.svd(rest_left.T @ near @ rest_right.T)
    return left[:, :rank] @ right[:rank] + rest_left @ (turn @ back) @ rest_right


class ModalTruncation(StateReducer):
    """The strongest modes, with the static gain of the others.

    A pair of poles is never split, so the order may be one less than requested.
    """

    def __init__(self, model: Lti | SecondOrderModel, parts: SystemParts, band: Band | None) -> None:
        super().__init__(self.strongest, model, parts, band)
        modal = parts.modal or diagonalized(continuous_image(parts.original))
        if modal is None:
            raise ValueError(
                "method 'modal': the stable poles are defective (Jordan blocks) or nearly so, use 'balanced'"
            )
        self.modal = modal

    def strongest(self, _: Balanced, order: int) -> tuple[Lti, float]:
        """Return the strongest modes, and a bound on the error.

        The response of a truncated mode beyond its static gain, ``c b s/(p (s - p))``, is at most ``|c| |b|/|Re p|``, by
        which the modes are ranked.
        """
        modal, sizes = self.modal, self.modal.sizes
        chosen = np.zeros(len(modal.poles), dtype=bool)
        for i in np.argsort(-sizes, kind="stable"):
            pair = 2 if modal.poles[i].imag > 0.0 else 1
            if modal.poles[i].imag >= 0.0 and chosen.sum() + pair <= order:
                chosen[i : i + pair] = True
        gone, strongest = modal.only(~chosen), modal.only(chosen).blocks
        static = np.real((gone.C / -gone.poles) @ gone.B)
        return replace(strongest, D=modal.D + static), float(gone.sizes.sum())


class StrongestModes:
    """A structure in its strongest undamped modes, outputs with the static response of the others.

    A symmetric projection preserves definite mass, damping and stiffness, so the reduced structure is stable and passive for
    any selection of modes.

    Raises
    ------
    ValueError
        If the matrices have no real modes.
    """

    def __init__(self, model: SecondOrderModel, parts: SystemParts, band: Band | None) -> None:
        self.model, self.parts, self.band, self.form = model, parts, band, balance(parts.stable, parts.modal)
        self.frequencies, self.modes = undamped_modes(model.structure)
        floating = self.frequencies == 0.0
        self.rigid, self.ranking = int(floating.sum()), self._ranking(floating)

    def orders(self, error: float) -> Iterator[int]:
        """Yield the orders: two states per mode."""
        yield from range(2 * max(self.rigid, 1), 2 * len(self.ranking) + 1, 2)

    def reduced(self, order: int) -> tuple[SecondOrderModel, Verified]:
        """Return the structure in ``order/2`` modes, and its verification."""
        least = 2 * max(self.rigid, 1)
        if order % 2 or order < least:
            raise ValueError(f"order = {order}: expected an even number, two states a coordinate, at least {least}")
        chosen = self.ranking[: order // 2]
        smaller = self._projected(chosen)
        parts = spectral_parts(realize(smaller.structure, smaller.ports).balanced())
        stable, retained = parts.rest, parts.retained
        if not _same(self.parts.retained, retained):
            raise ReductionError(
                f"{len(self.parts.retained.A)} unstable, undamped or rigid-body states are not preserved "
                f"({len(retained.A)} in the reduced structure): damping couples them to truncated modes"
            )
        return smaller, verified(self.parts, stable, inf, self.band)[1]

    def _ranking(self, floating: Array) -> Array:
        """Return the modes in descending order of their peak response, or of their largest response within the range."""
        model, frequencies, V = self.model, self.frequencies, self.modes
        damping = np.diag(model.structure.projected(V).C)
        at = np.sqrt(np.maximum(frequencies**2 - 0.5 * damping**2, 0.0))
        at = at if self.band is None else np.clip(at, *self.band)
        s = 1j * at
        acting = np.array([np.linalg.norm(b.T @ v) for b, v in zip(evaluate(model.ports.B, s), V.T, strict=True)])
        reading = np.array([np.linalg.norm(line @ v) for line, v in zip(evaluate(model.ports.L, s), V.T, strict=True)])
        stiffness = np.abs(frequencies**2 - at**2 + 1j * at * damping)
        with np.errstate(divide="ignore", invalid="ignore"):
            strength = np.where(stiffness > 0.0, acting * reading / stiffness, inf)
        strength[floating] = inf
        return np.argsort(-strength, kind="stable")

    def _projected(self, chosen: Array) -> SecondOrderModel:
        """Return the structure in the chosen modes, outputs with the static response of the others.

        With a range, the response of the others at its geometric mean is used, and none of modes within the range.
        """
        model, frequencies, V, band = self.model, self.frequencies, self.modes, self.band
        modes = np.sort(chosen)
        rest = np.setdiff1d(np.arange(self.rigid, V.shape[1]), modes)
        stiffness = frequencies[rest] ** 2
        if band is not None:
            inside = (frequencies[rest] >= band[0]) & (frequencies[rest] <= band[1])
            middle = np.sqrt(max(band[0], _CENTER * band[1]) * band[1])  # in the logarithm
            stiffness = np.where(inside, inf, stiffness - middle**2)
        static = (model.ports.L[0] @ V[:, rest] / stiffness) @ (V[:, rest].T @ model.ports.B[0])
        ports = model.ports.congruent(V[:, modes])
        E = ports.E.copy()
        E[0] += static
        names = tuple(f"mode{i + 1}" for i in modes)
        return SecondOrderModel.of(model.structure.projected(V[:, modes], names), replace(ports, E=E))


def _same(one: Lti, other: Lti) -> bool:
    """Return whether two small systems have equal Markov parameters."""
    if len(one.A) != len(other.A):
        return False
    for k in range(_MOMENTS):
        a, b = (system.C @ np.linalg.matrix_power(system.A, k) @ system.B for system in (one, other))
        size = [np.linalg.norm(s.C) * np.linalg.norm(s.A) ** k * np.linalg.norm(s.B) for s in (one, other)]
        if np.abs(a - b).max(initial=0.0) > LEVEL * max(np.abs(a).max(initial=0.0), ALIKE * max(size)):
            return False
    return True


def weighted(system: Lti, modal: ModalSystem | None, band: Band) -> tuple[Lti, ModalSystem | None, Array, Array]:
    """Return a system weighted to a frequency range, its modes, and ``T`` and ``R`` with ``G = D + R G_1 T``.

    The Gramians of a range belong to loads ``X = S B B^T + B B^T S^T`` that may be indefinite.  Their absolute value,
    ``|X| = B_1 B_1^T``, gives a system ``G_1 = (A, B_1, C_1)`` whose reduction is stable and bounded, and with
    ``B = B_1 T``, ``C = R C_1``.

    Raises
    ------
    ValueError
        If the range is so far from all poles that the system has almost no response there.
    """
    S = band_integral(system, modal, band)
    B = _absolute(S @ system.B @ system.B.T)
    C = _absolute(S.T @ system.C.T @ system.C).T
    T, R = np.linalg.lstsq(B, system.B, rcond=None)[0], np.linalg.lstsq(C.T, system.C.T, rcond=None)[0].T
    lost = np.abs(B @ T - system.B).max(initial=0.0), np.abs(R @ C - system.C).max(initial=0.0)
    if lost[0] > LEVEL * np.abs(system.B).max() or lost[1] > LEVEL * np.abs(system.C).max():
        raise ValueError(
            f"`omega_range` must be closer to the poles of the system, got {band} rad/s: some inputs or outputs have almost "
            "no response there."
        )
    zero = np.zeros((C.shape[0], B.shape[1]))
    if modal is not None:
        J = modal.mixing
        modal = ModalSystem(modal.poles, J.conj().T @ B, C @ J, zero)
    return Lti(system.A, B, C, zero), modal, T, R


def _absolute(half: Array) -> Array:
    """Return a factor of the absolute value of ``half + half^T``."""
    values, U = linalg.eigh(half + half.T)
    size = np.abs(values)
    good = size > SUMMED * size.max(initial=0.0)
    return U[:, good] * np.sqrt(size[good])
