"""Anti-windup: the gain that corrects a controller's state where it saturates, and the proof that it stays bounded.

Some, ``S``, of the controls meet their limits.  With ``given = asked`` of the others the controller is

    x+ = (A - L[:, S] C[S]) x + (B - L[:, S] D[S]) y + L[:, S] given[S],

and what is given is bounded.  So this matrix must be stable for every ``S``; a Lyapunov matrix proves that it is, for each
control with limits alone and for all of them together.  Controls may change between meeting their limits and not: what is
given is bounded, at any time, for all controls whose force is limited, so that one matrix, that with ``S`` all of them,
bounds the state.  Where only the rate is limited, ``given`` runs after what is asked for; of one or two such controls it
stays bounded too, for ``I - C (I - A + L C)^-1 L`` then has positive principal minors, and of order two that is a diagonal
Lyapunov matrix.
"""

from collections.abc import Iterable, Sequence
from math import frexp

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.checks import warn_user
from boomctl.exceptions import WindupWarning
from boomctl.lti.system import Lti

# share of the noise added everywhere, so that the Riccati equation is solvable; below all that is felt
_REGULAR = 1e-10
_HARDLY = 1e8  # softening of controls that are not corrected by: they are looked at only for what no other one shows
_OWN = 1e-6  # share by which a controller that is not stable may grow faster than by its own poles, a sample (a choice)
_ROUNDED = 1e-12  # error of the magnitude of a pole on the unit circle
_FOLLOWED = 2  # controls whose rate alone is limited, which are proved: see above
_DOUBLINGS = 40  # of the steps that a sum of powers has: a pole at 1 - 1e-10 has faded by then (a choice)
_UNIT = 2.0**-53  # of rounding


def correction(laws: Sequence[Lti], force: Array, rate: Array) -> Array:
    """Return the gains of :func:`conditioning_gains` for limits of force and rate, ``inf`` for none; warn of none."""
    limited = np.isfinite(force) | _followed(force, rate, len(laws))
    gains, proved = conditioning_gains(laws, limited)
    left = np.isfinite(rate) & ~limited if proved else np.isfinite(force) | np.isfinite(rate)
    if laws[0].A.size and left.any():
        _warn(laws[0].output_labels, left)
    return gains


def bounded_correction(law: Lti, gains: Array, force: Array, rate: Array) -> Array:
    """Return gains given for each sample, of which the last stays; zeros, and a warning, where these are not bounded."""
    limited = np.isfinite(force) | _followed(force, rate, 1)
    own = float(np.abs(np.linalg.eigvals(law.A)).max())
    left = np.isfinite(rate) & ~limited
    if not left.any() and bounded((law,), gains[-1:], _looked_at(limited), _rate(own)):
        return gains
    _warn(law.output_labels, limited | left)
    return np.zeros_like(gains)


def _looked_at(limited: Array) -> list[list[int]]:
    """Return the sets of controls of which it is proved: each with limits alone, then all of them together."""
    F = np.flatnonzero(limited).tolist()
    return [[i] for i in F] + ([F] if len(F) > 1 else [])


def _rate(own: float) -> float:
    """Return how fast a corrected controller may grow a sample: not at all, if its own poles are stable."""
    return own * (1.0 + _OWN) if own > 1.0 - _ROUNDED else 1.0


def _followed(force: Array, rate: Array, count: int) -> Array:
    """Return which controls are limited in their rate alone, of one controller, where that is bounded."""
    alone = np.isfinite(rate) & ~np.isfinite(force)
    return alone if count == 1 and alone.sum() <= _FOLLOWED else np.zeros_like(alone)


def _warn(outputs: Sequence[str], left: Array) -> None:
    names = ", ".join(name for name, item in zip(outputs, left, strict=True) if item)
    text = f"anti_windup: where limits are met by {names}, the controller's state is not corrected; no gain is proved bounded"
    warn_user(text, WindupWarning)


def conditioning_gains(laws: Sequence[Lti], limited: Array, softening: float = 0.1) -> tuple[Array, bool]:
    """Return the gains through which the controls that were applied correct the controller's state.

    The controller is run as an observer of itself: its input is taken for white noise, what was applied for a
    measurement of what it asked for, itself noisy by ``softening`` of the variance that one sample adds.  Without
    softening the stationary Kalman gain is Hanus' conditioning ``B D^-1`` where ``D`` is invertible and the controller
    of minimum phase, and stabilizing otherwise; but that is harsh where ``D`` is small, as it is in every controller
    that rolls off.  The gain counts on all controls at once, so that it may not be stable with some of them; then there
    is none.

    Parameters
    ----------
    laws : sequence of Lti
        One controller, or those between which matrices run in straight lines.
    limited : (controls,) ndarray of bool
        Which controls have limits; the gains of the others are zero.

    Source: Hanus, Kinnaert & Henrotte (1987); Astrom & Rundqwist (1989).

    Returns
    -------
    gains : (k, n, controls) ndarray
    proved : bool
        Whether the corrected controller is bounded with each limited control alone and with all of them: however that
        which its matrices follow may change, if this is proved of the controller by itself; else where it stands at one of
        its values.  Where its own poles are not stable: with all of them; or, where these do not show such a pole, no worse
        than by itself.  False with gains of zero.
    """
    n, u = len(laws[0].A), len(limited)
    none = np.zeros((len(laws), n, u))
    if not (n and limited.any() and all(K.B.any() and K.C[limited].any() for K in laws)):
        return none, True
    own = max(float(np.abs(np.linalg.eigvals(K.A)).max()) for K in laws)
    rate = _rate(own)
    standing = len(laws) > 1 and not bounded(laws, none, [()], rate)
    gains, sets = np.array([_kalman_gain(K, limited, softening) for K in laws]), _looked_at(limited)
    proved = bounded(laws, gains, sets, rate, standing)
    proved = proved or (rate > 1.0 and bounded(laws, gains, sets[-1:], 1.0, standing))
    return (gains, True) if proved else (none, False)


def _kalman_gain(K: Lti, limited: Array, softening: float) -> Array:
    """Return the gain of a controller as an observer of itself; not finite where there is none."""
    A, n, u = K.A, len(K.A), len(K.C)
    with np.errstate(all="ignore"):  # of numbers whose products are beyond all numbers there is no gain
        moved = float(np.abs(K.B).max())
        B, shown = K.B / moved, np.hstack([K.D, K.C @ K.B])
        size = np.abs(shown).max(axis=1)
        size = size * np.linalg.norm(
            shown / np.where(size > 0.0, size, 1.0)[:, None], axis=1
        )  # no square of large numbers
        size = np.where(size > 0.0, size, size.max() or 1.0)
        C, D = K.C * moved / size[:, None], K.D / size[:, None]
    if not all(np.isfinite(item).all() for item in (A, B, C, D)):
        return np.full((n, u), np.nan)
    soft = np.where(limited, softening + _REGULAR, _HARDLY * (softening + 1.0))
    R, Q, S = D @ D.T + np.diag(soft), B @ B.T, B @ D.T
    Q = Q + _REGULAR * np.linalg.norm(Q) * np.eye(n)
    try:
        with np.errstate(all="ignore"):  # states of very different size
            P = linalg.solve_discrete_are(A.T, C.T, Q, R, s=S)
        gain = np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T + S.T).T * moved / size
    except (linalg.LinAlgError, ValueError):
        return np.full((n, u), np.nan)
    return np.where(limited, gain, 0.0)


def bounded(
    laws: Sequence[Lti], gains: Array, subsets: Iterable[Sequence[int]], rate: float = 1.0, standing: bool = False
) -> bool:
    """Return whether corrected controllers are proved to grow by less than a factor a sample.

    Parameters
    ----------
    laws, gains
        Of :func:`conditioning_gains`.
    subsets : iterable of sequence of int
        Of controls at their limits.
    rate : float
        The factor.  With 1 they are bounded.
    standing : bool
        Whether each is by itself; otherwise they may change into each other in any way, as one matrix proves.
    """
    for S in subsets:
        V, doubt = _corrected(laws, gains, list(S))
        parts = [slice(k, k + 1) for k in range(len(laws))] if standing else [slice(None)]
        if not all(_contracting(V[part], doubt[part], rate) for part in parts):
            return False
    return True


def _corrected(laws: Sequence[Lti], gains: Array, S: list[int]) -> tuple[Array, Array]:
    """Return ``A - L C`` of each controller, then what all between them lie between, and what rounding leaves in doubt.

    Along a straight line ``A - L C`` is a parabola: it lies between both ends and the point where its tangents meet.
    """
    pairs = [(i, i) for i in range(len(laws))] + [(i, i + 1) for i in range(len(laws) - 1)]
    V, doubt = (np.zeros((len(pairs), *laws[0].A.shape)) for _ in range(2))
    for k, (i, j) in enumerate(pairs):
        for a, b in ((i, j), (j, i)):
            L, C = gains[a][:, S], laws[b].C[S]
            V[k] += 0.5 * (laws[a].A - L @ C)
            # twice what products, sums and differences round off
            doubt[k] += (len(S) + 4) * _UNIT * (np.abs(laws[a].A) + np.abs(L) @ np.abs(C))
    return V, doubt


def _contracting(V: Array, doubt: Array, rate: float) -> bool:
    """Return whether a matrix ``P > 0`` is proved to make ``V' P V < rate^2 P`` of each of the matrices."""
    P = _lyapunov_matrix(V.mean(axis=0) / rate)
    if P is None or not positive_definite(P, np.zeros_like(P)):
        return False
    size, sums = np.abs(P), (4 * len(P) + 8) * _UNIT  # twice what the sums of the products round off
    for item, off in zip(V, doubt, strict=True):
        M, reach = rate**2 * P - item.T @ P @ item, np.abs(item) + off
        E = sums * (rate**2 * size + reach.T @ size @ reach) + off.T @ size @ reach + reach.T @ size @ off
        if not positive_definite(0.5 * (M + M.T), E):
            return False
    return True


def _lyapunov_matrix(V: Array) -> Array | None:
    """Return what is nearly ``P = V' P V + I``, in units of the states in which the matrix is balanced; None if it grows."""
    if not np.isfinite(V).all():
        return None
    power, scale = balance(V)
    P = np.eye(len(V))
    with np.errstate(all="ignore"):
        for _ in range(_DOUBLINGS):
            P, power = P + power.T @ P @ power, power @ power
            if not np.isfinite(P).all():
                return None
            if np.abs(power).max() < _UNIT:
                break
    return 0.5 * (P + P.T) / np.outer(scale, scale)


def positive_definite(M: Array, doubt: Array) -> bool:
    """Return whether every symmetric matrix within ``doubt`` of ``M`` is positive definite: proved, not only computed.

    Where Cholesky's method goes through in floating point, a matrix that is not farther off than its rounding, which has a
    bound, is positive definite.  Source: Rump (2006).
    """
    if not (np.isfinite(M).all() and np.isfinite(doubt).all() and (np.diag(M) > 0.0).all()):
        return False
    scale = np.exp2([-round(0.5 * frexp(value)[1]) for value in np.diag(M)])  # powers of two: exact
    M, doubt = M * np.outer(scale, scale), doubt * np.outer(scale, scale)
    off = doubt.sum(axis=1).max() + doubt.sum(axis=0).max() + 2.0 * (len(M) + 2) * _UNIT * np.trace(M)
    try:
        np.linalg.cholesky(M - off * np.eye(len(M)))
    except np.linalg.LinAlgError:
        return False
    return True
