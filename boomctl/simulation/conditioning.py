"""Anti-windup: the gain that corrects a controller's state at its limits, and the proof that the state stays bounded.

Let ``S`` be the controls at their limits.  With ``applied = commanded`` for the other controls the controller is

    x+ = (A - L[:, S] C[S]) x + (B - L[:, S] D[S]) y + L[:, S] applied[S],

and the applied controls are bounded.  So this matrix must be stable for every ``S``; a Lyapunov matrix proves stability for
each limited control alone and for all of them together.  Controls may enter and leave their limits: controls with a force
limit are bounded at any time, so that the matrix with all of them in ``S`` bounds the state.  If only the rate is limited,
``applied`` lags behind ``commanded``; for one or two such controls it stays bounded too, for ``I - C (I - A + L C)^-1 L``
then has positive principal minors, which for order two implies a diagonal Lyapunov matrix.
"""

from collections.abc import Iterable, Sequence
from math import frexp

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.checks import warn_user
from boomctl.exceptions import WindupWarning
from boomctl.lti.rounding import EPS, LEVEL, SUMMED
from boomctl.lti.system import Lti

# Relative noise added to all signals, so that the Riccati equation is solvable; too small to affect the gain.
_REGULAR = 1e-10
_WEAK = 1e8  # Softening of controls without limits: they count only for modes that no other control shows.
_FOLLOWED = 2  # Most controls with a rate limit only for which boundedness is proved: see above.
_DOUBLINGS = 40  # Doublings of the number of powers in a sum: a pole at 1 - 1e-10 has decayed by then.


def correction(laws: Sequence[Lti], force: Array, rate: Array) -> Array:
    """Return the gains of :func:`conditioning_gains` for limits of force and rate; warn if no gain is proved."""
    limited = np.isfinite(force) | _followed(force, rate, len(laws))
    gains, proved = conditioning_gains(laws, limited)
    left = np.isfinite(rate) & ~limited if proved else np.isfinite(force) | np.isfinite(rate)
    if laws[0].A.size and left.any():
        _warn(laws[0].output_labels, left)
    return gains


def bounded_correction(law: Lti, gains: Array, force: Array, rate: Array) -> Array:
    """Return the user's gains at each sample, the last one permanent; zeros and a warning if they are not proved bounded."""
    limited = np.isfinite(force) | _followed(force, rate, 1)
    own = float(np.abs(np.linalg.eigvals(law.A)).max())
    left = np.isfinite(rate) & ~limited
    if not left.any() and bounded((law,), gains[-1:], _limit_sets(limited), _rate(own)):
        return gains
    _warn(law.output_labels, limited | left)
    return np.zeros_like(gains)


def _limit_sets(limited: Array) -> list[list[int]]:
    """Return the sets of controls for the proof: each limited control alone, then all of them together."""
    F = np.flatnonzero(limited).tolist()
    return [[i] for i in F] + ([F] if len(F) > 1 else [])


def _rate(own: float) -> float:
    """Return the allowed growth factor of a corrected controller per sample: 1 if its poles are stable."""
    return own * (1.0 + LEVEL) if own > 1.0 - SUMMED else 1.0


def _followed(force: Array, rate: Array, count: int) -> Array:
    """Return a mask of controls with a rate limit only for which boundedness is proved, of one controller."""
    alone = np.isfinite(rate) & ~np.isfinite(force)
    return alone if count == 1 and alone.sum() <= _FOLLOWED else np.zeros_like(alone)


def _warn(outputs: Sequence[str], left: Array) -> None:
    names = ", ".join(name for name, item in zip(outputs, left, strict=True) if item)
    text = f"anti_windup: where limits are met by {names}, the controller's state is not corrected; no gain is proved bounded"
    warn_user(text, WindupWarning)


def conditioning_gains(laws: Sequence[Lti], limited: Array, softening: float = 0.1) -> tuple[Array, bool]:
    """Return the gains by which the applied controls correct the controller's state.

    The gain is the stationary Kalman gain of the controller as an observer of itself: its input is treated as white noise,
    and the applied control as a measurement of the commanded control, with a noise variance of ``softening`` times the
    variance that one sample adds.  Without softening it is Hanus' conditioning ``B D^-1`` if ``D`` is invertible and the
    controller is minimum phase, and stabilizing otherwise; but it is large if ``D`` is small, as in every controller that
    rolls off.  The gain assumes all controls at their limits, so it may not be stable with only some of them; then the
    gains are zero.

    Parameters
    ----------
    laws : sequence of Lti
        One controller, or several, between which matrices are interpolated linearly.
    limited : (controls,) ndarray of bool
        True for controls with limits; the gains of the others are zero.

    Source: Hanus, Kinnaert & Henrotte (1987); Astrom & Rundqwist (1989).

    Returns
    -------
    gains : (k, n, controls) ndarray
    proved : bool
        True if the corrected controller is proved bounded with each limited control alone and with all of them: for any
        change of the scheduling signal, if this is proved for the uncorrected controller, else for constant values of it.
        If the controller's poles are not stable: bounded with all controls, or growing no faster than the uncorrected
        controller.  If False, the gains are zero.
    """
    n, u = len(laws[0].A), len(limited)
    none = np.zeros((len(laws), n, u))
    if not (n and limited.any() and all(K.B.any() and K.C[limited].any() for K in laws)):
        return none, True
    own = max(float(np.abs(np.linalg.eigvals(K.A)).max()) for K in laws)
    rate = _rate(own)
    frozen = len(laws) > 1 and not bounded(laws, none, [()], rate)
    gains, sets = np.array([_kalman_gain(K, limited, softening) for K in laws]), _limit_sets(limited)
    proved = bounded(laws, gains, sets, rate, frozen)
    proved = proved or (rate > 1.0 and bounded(laws, gains, sets[-1:], 1.0, frozen))
    return (gains, True) if proved else (none, False)


def _kalman_gain(K: Lti, limited: Array, softening: float) -> Array:
    """Return the Kalman gain of a controller as an observer of itself; NaN if none exists."""
    A, n, u = K.A, len(K.A), len(K.C)
    with np.errstate(all="ignore"):  # matrices whose products overflow have no gain
        moved = float(np.abs(K.B).max())
        B, shown = K.B / moved, np.hstack([K.D, K.C @ K.B])
        size = np.linalg.norm(shown, axis=1)
        size = np.where(size > 0.0, size, size.max() or 1.0)
        C, D = K.C * moved / size[:, None], K.D / size[:, None]
    if not all(np.isfinite(item).all() for item in (A, B, C, D)):
        return np.full((n, u), np.nan)
    soft = np.where(limited, softening + _REGULAR, _WEAK * (softening + 1.0))
    R, Q, S = D @ D.T + np.diag(soft), B @ B.T, B @ D.T
    Q = Q + _REGULAR * np.linalg.norm(Q) * np.eye(n)
    try:
        with np.errstate(all="ignore"):  # states of very different magnitude
            P = linalg.solve_discrete_are(A.T, C.T, Q, R, s=S)
        gain = np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T + S.T).T * moved / size
    except (linalg.LinAlgError, ValueError):
        return np.full((n, u), np.nan)
    return np.where(limited, gain, 0.0)


def bounded(
    laws: Sequence[Lti], gains: Array, subsets: Iterable[Sequence[int]], rate: float = 1.0, frozen: bool = False
) -> bool:
    """Return True if corrected controllers are proved to grow by less than a factor per sample.

    Parameters
    ----------
    laws, gains
        As in :func:`conditioning_gains`.
    subsets : iterable of sequence of int
        Sets of controls at their limits.
    rate : float
        The factor.  With 1 the controllers are bounded.
    frozen : bool
        Prove each controller separately, for a constant scheduling signal; otherwise one Lyapunov matrix proves all of
        them, for any change of the signal.
    """
    for S in subsets:
        V, error_bound = _corrected(laws, gains, list(S))
        parts = [slice(k, k + 1) for k in range(len(laws))] if frozen else [slice(None)]
        if not all(_contracting(V[part], error_bound[part], rate) for part in parts):
            return False
    return True


def _corrected(laws: Sequence[Lti], gains: Array, S: list[int]) -> tuple[Array, Array]:
    """Return vertices of a hull of ``A - L C`` of all controllers and those between, and bounds of the rounding errors.

    Under linear interpolation ``A - L C`` is a parabola, in the hull of both ends and the intersection of their tangents.
    """
    pairs = [(i, i) for i in range(len(laws))] + [(i, i + 1) for i in range(len(laws) - 1)]
    V, error_bound = (np.zeros((len(pairs), *laws[0].A.shape)) for _ in range(2))
    for k, (i, j) in enumerate(pairs):
        for a, b in ((i, j), (j, i)):
            L, C = gains[a][:, S], laws[b].C[S]
            V[k] += 0.5 * (laws[a].A - L @ C)
            # four times the rounding error of products, sums and differences
            error_bound[k] += (len(S) + 4) * EPS * (np.abs(laws[a].A) + np.abs(L) @ np.abs(C))
    return V, error_bound


def _contracting(V: Array, error_bound: Array, rate: float) -> bool:
    """Return True if a matrix ``P > 0`` is proved to satisfy ``V' P V < rate^2 P`` for each of the matrices."""
    P = _lyapunov_matrix(V.mean(axis=0) / rate)
    if P is None or not positive_definite(P, np.zeros_like(P)):
        return False
    size, sums = np.abs(P), (4 * len(P) + 8) * EPS  # four times the rounding error of the sums of the products
    for item, off in zip(V, error_bound, strict=True):
        M, reach = rate**2 * P - item.T @ P @ item, np.abs(item) + off
        E = sums * (rate**2 * size + reach.T @ size @ reach) + off.T @ size @ reach + reach.T @ size @ off
        if not positive_definite(0.5 * (M + M.T), E):
            return False
    return True


def _lyapunov_matrix(V: Array) -> Array | None:
    """Return an approximate solution of ``P = V' P V + I`` in scaled states that balance V; None if it diverges."""
    if not np.isfinite(V).all():
        return None
    power, scale = balance(V)
    P = np.eye(len(V))
    with np.errstate(all="ignore"):
        for _ in range(_DOUBLINGS):
            P, power = P + power.T @ P @ power, power @ power
            if not np.isfinite(P).all():
                return None
            if np.abs(power).max() < EPS:
                break
    return 0.5 * (P + P.T) / np.outer(scale, scale)


def positive_definite(M: Array, error_bound: Array) -> bool:
    """Return True if every symmetric matrix within ``error_bound`` of ``M`` is proved positive definite.

    If Cholesky's method succeeds in floating point, all matrices within the bound of its rounding error are positive
    definite.  Source: Rump (2006).
    """
    if not (np.isfinite(M).all() and np.isfinite(error_bound).all() and (np.diag(M) > 0.0).all()):
        return False
    scale = np.exp2([-round(0.5 * frexp(value)[1]) for value in np.diag(M)])  # powers of two: exact
    M, E = M * np.outer(scale, scale), error_bound * np.outer(scale, scale)
    off = E.sum(axis=1).max() + E.sum(axis=0).max() + (len(M) + 2) * EPS * np.trace(M)
    try:
        np.linalg.cholesky(M - off * np.eye(len(M)))
    except np.linalg.LinAlgError:
        return False
    return True
