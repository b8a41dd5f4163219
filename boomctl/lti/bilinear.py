"""The bilinear map ``z = (1 + w/g)/(1 - w/g)``, ``g = 2/dt``: the unit circle becomes the imaginary axis, exactly.

A discrete system and its image have the same response, at ``z = exp(j omega dt)`` and at ``w = j (2/dt) tan(omega dt/2)``;
the same norm and the same Hankel singular values, and both are stable or neither is.  The image of a discrete system is the
continuous system whose Tustin discretization it is.  A system in continuous time is its own image.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.lti.hold import zero_order_hold
from boomctl.lti.rounding import DIGIT, SUMMED
from boomctl.lti.system import Lti, balanced_inverse


def image_of_omega(omega: ArrayLike, dt: float) -> Array:
    """Return the frequencies ``(2/dt) tan(omega dt/2)`` of the image; ``inf`` for ``pi/dt``.

    If ``dt`` is 0, they are unchanged.
    """
    if dt == 0.0:
        return np.asarray(omega, dtype=float)
    half = 0.5 * dt * np.asarray(omega, dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(half >= 0.5 * np.pi * (1.0 - SUMMED), np.inf, (2.0 / dt) * np.tan(half))


def omega_of_image(v: ArrayLike, dt: float) -> Array:
    """Return the frequencies ``(2/dt) atan(v dt/2)`` of the images ``v``; ``pi/dt`` for ``inf``.

    If ``dt`` is 0, they are unchanged.
    """
    if dt == 0.0:
        return np.asarray(v, dtype=float)
    return np.minimum((2.0 / dt) * np.arctan(0.5 * dt * np.asarray(v, dtype=float)), np.pi / dt)


def continuous_image(system: Lti) -> Lti:
    """Return the continuous system whose Tustin discretization is the given one; a continuous one is unchanged.

    Raises
    ------
    ValueError
        If there is a pole at ``z = -1``.
    """
    if system.dt == 0.0:
        return system
    g = 2.0 / system.dt
    return _moved(system, (g, -g, 1.0), 0.0, "system: it has a pole at z = -1, and so no image in continuous time")


def discrete_image(system: Lti, dt: float) -> Lti:
    """Return the Tustin discretization of a continuous system.

    If ``dt`` is 0, the system is unchanged.

    Raises
    ------
    ValueError
        If there is a pole at ``w = 2/dt``.
    """
    if dt == 0.0:
        return system
    g = 2.0 / dt
    return _moved(
        system, (1.0 / g, 1.0, -1.0 / g), dt, f"system: it has a pole at 2/dt = {g:.6g} rad/s, and so no image"
    )


def _moved(system: Lti, coefficients: tuple[float, float, float], dt: float, message: str) -> Lti:
    """Return the system over ``(a x + b)/(c x + 1)`` instead of ``x``, which is ``s`` or ``z``.

    One factor goes to each side, so that Gramians stay those of the system up to no more than that.
    """
    (a, b, c), eye = coefficients, np.eye(len(system.A))
    inverse, moved = balanced_inverse(eye + c * system.A, DIGIT, message), b * eye + a * system.A
    A, B, C, side = inverse @ moved, inverse @ system.B, system.C @ inverse, np.sqrt(a - b * c)
    # A pole at zero leaves only rounding error.
    A[np.abs(A) <= DIGIT * (np.abs(inverse) @ (np.abs(b) * eye + np.abs(a * system.A)))] = 0.0
    D = system.D - c * (system.C @ B)
    return replace(system, A=A, B=side * B, C=side * C, D=D, dt=dt)


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
