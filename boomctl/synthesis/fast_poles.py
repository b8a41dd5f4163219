"""A controller without the poles that are too fast to implement, their static gain kept."""

from dataclasses import replace

import numpy as np
from scipy import linalg

from boomctl.lti.system import Lti


def without_fast_poles(K: Lti, fastest: float) -> Lti | None:
    """Return a system without its poles above a magnitude [rad/s], whose gain at zero frequency goes into ``D``.

    None comes back where an eigenvalue cannot be split off.  Nothing is said of the loop: verify it.
    """
    try:
        T, Z, count = linalg.schur(K.A, output="real", sort=lambda re, im=0.0: np.hypot(re, im) <= fastest)
        A, B, C = T[:count, :count], Z.T @ K.B, K.C @ Z
        fast = T[count:, count:]
        cross = linalg.solve_sylvester(A, -fast, -T[:count, count:])
    except (linalg.LinAlgError, ValueError):
        return None
    # with x = [I S; 0 I] v the two parts decouple
    slow_B, fast_C = B[:count] - cross @ B[count:], C[:, :count] @ cross + C[:, count:]
    gain = -fast_C @ np.linalg.solve(fast, B[count:]) if len(fast) else np.zeros_like(K.D)
    slower = replace(K, A=A, B=slow_B, C=C[:, :count], D=K.D + gain, states=())
    return slower if all(np.isfinite(part).all() for part in (slower.B, slower.C, slower.D)) else None
