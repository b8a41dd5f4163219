"""The bilinear map ``z = (1 + w/g)/(1 - w/g)``, ``g = 2/dt``: the unit circle becomes the imaginary axis, exactly.

A discrete system and its image have the same response, at ``z = exp(j omega dt)`` and at ``w = j (2/dt) tan(omega dt/2)``;
the same norm, the same Hankel singular values; and one is stable where the other is.  The image of a discrete system is that
continuous one whose Tustin discretisation it is; a system in continuous time is its own, so that nobody has to ask.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.lti.hold import zero_order_hold
from boomctl.lti.rounding import DIGIT, SUMMED
from boomctl.lti.system import Lti

# share of the largest singular value of A + 1 (of 1 - A/g) below which a pole lies at z = -1 (at w = g) but for rounding
_SINGULAR = 1e-15


def image_of_omega(omega: ArrayLike, dt: float) -> Array:
    """Return the frequencies ``(2/dt) tan(omega dt/2)`` of the image; ``inf`` for ``pi/dt``.

    Without ``dt`` they stay.
    """
    if dt == 0.0:
        return np.asarray(omega, dtype=float)
    half = 0.5 * dt * np.asarray(omega, dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(half >= 0.5 * np.pi * (1.0 - SUMMED), np.inf, (2.0 / dt) * np.tan(half))


def omega_of_image(v: ArrayLike, dt: float) -> Array:
    """Return the frequencies ``(2/dt) atan(v dt/2)`` whose images are given; ``pi/dt`` for ``inf``.

    Without ``dt`` they stay.
    """
    if dt == 0.0:
        return np.asarray(v, dtype=float)
    return np.minimum((2.0 / dt) * np.arctan(0.5 * dt * np.asarray(v, dtype=float)), np.pi / dt)


def continuous_image(system: Lti) -> Lti:
    """Return the continuous system that a discrete one is the Tustin discretisation of; a continuous one stays.

    Raises
    ------
    ValueError
        A pole at ``z = -1``: there is none.
    """
    if system.dt == 0.0:
        return system
    g, eye = 2.0 / system.dt, np.eye(len(system.A))
    inverse = _inverse(system.A + eye, "system: it has a pole at z = -1, and so no image in continuous time")
    A = g * (inverse @ (system.A - eye))
    B, C = inverse @ system.B, system.C @ inverse
    # one factor of 2 g to each side, so that Gramians are those of the discrete system up to no more than that
    side = np.sqrt(2.0 * g)
    D = system.D - system.C @ B
    return Lti(
        A, side * B, side * C, D, system.input_labels, system.output_labels, system.state_labels, scales=system.scales
    )


def discrete_image(system: Lti, dt: float) -> Lti:
    """Return the Tustin discretisation of a continuous system: the discrete one whose continuous image it is.

    Without ``dt`` it is the system itself.

    Raises
    ------
    ValueError
        A pole at ``w = 2/dt``: there is none.
    """
    if dt == 0.0:
        return system
    g, eye = 2.0 / dt, np.eye(len(system.A))
    inverse = _inverse(eye - system.A / g, f"system: it has a pole at 2/dt = {g:.6g} rad/s, and so no image")
    B, C, side = inverse @ system.B, system.C @ inverse, np.sqrt(2.0 / g)
    moved = eye + system.A / g
    A, D = inverse @ moved, system.D + system.C @ B / g
    # of a pole at -2/dt nothing is left but rounding
    A[np.abs(A) <= DIGIT * (np.abs(inverse) @ (eye + np.abs(system.A) / g))] = 0.0
    return Lti(
        A, side * B, side * C, D, system.input_labels, system.output_labels, system.state_labels, dt, system.scales
    )


def discretized(system: Lti, dt: float, method: str, warped: float | None = None) -> Lti:
    """Return a continuous system from sample to sample, by the rule of Tustin ("tustin") or for held inputs ("zoh").

    ``warped`` is the frequency at which the response by Tustin's rule is exact [rad/s]; None: zero frequency.
    """
    if method == "tustin":
        return replace(
            discrete_image(system, dt if warped is None else 2.0 * np.tan(0.5 * warped * dt) / warped), dt=dt
        )
    A, B = zero_order_hold(system.A, system.B, dt)
    return replace(system, A=A, B=B, dt=dt)


def _inverse(matrix: Array, refusal: str) -> Array:
    if not len(matrix):
        return matrix
    balanced, scale = balance(matrix)
    values = linalg.svdvals(balanced)
    if values[-1] <= _SINGULAR * values[0]:
        raise ValueError(refusal)
    result = linalg.inv(balanced)
    result += result @ (
        np.eye(len(matrix)) - balanced @ result
    )  # to componentwise accuracy: zeros of a chain stay zero
    return result * scale[:, None] / scale
