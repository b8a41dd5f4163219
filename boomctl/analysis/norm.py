"""Certified H-infinity norms.

A norm is reported with two bounds of its own: the largest singular value found (attained at a frequency, from the
system's own response), and a level that no singular value reaches at any frequency (no eigenvalue of the Hamiltonian
matrix on the imaginary axis; Boyd, Balakrishnan & Kabamba 1989, Bruinsma & Steinbuch 1990).
"""

from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.frequency import Response, largest_gain, singular_values
from boomctl.lti.modal import side_of_axis
from boomctl.lti.system import Lti, of

if TYPE_CHECKING:
    import control

_LEVEL = 1e-6  # how far above the largest value found a level is tried, relative: a tenth of _CERTIFIED
_CERTIFIED = 1e-5  # relative distance of the two bounds up to which a norm is certified (a choice)
_ROUNDS = 30  # levels tried before giving up: each rises to a higher peak, so that a few do
_NEAR, _FAR = 1e-6, 3e-5  # distances from a pole on the axis, relative: an infinite response grows 30 times in between
_GROWN = 5.0  # growth from which it is called infinite; beside a pole that does not show it stays the same
_APART = 1e-6  # share of the fastest pole by which another one lies apart from that on the axis
# share of the Hamiltonian matrix's norm by which its eigenvalues may be off the axis
_ROUNDING = 1e2 * float(np.finfo(float).eps)
_RELATIVE_ROUNDING = 1e-12  # and share of the eigenvalue itself (both are choices, far below _LEVEL)

# What tells a norm, in the order looked at: one of these is a certificate's ``method``.
STATIC_GAIN = "static gain"  # no states: the norm of D
UNSTABLE = "an unstable pole"  # infinite
UNDAMPED = "a pole on the imaginary axis"  # infinite, if the pole shows in the response
NO_RESPONSE = "zero response"
NO_CROSSING = "no Hamiltonian eigenvalue on the imaginary axis"  # what is left: a level just above the largest value
NOT_TOLD = "a Hamiltonian eigenvalue too close to the imaginary axis to tell"  # no upper bound
NOT_ENDED = "the level was raised too often"  # no upper bound


@dataclass(frozen=True)
class NormCertificate:
    """An H-infinity norm between two bounds.

    Attributes
    ----------
    lower : float
        Largest singular value found; it is attained at ``omega``.
    upper : float
        No singular value is larger; ``inf`` where that could not be shown.
    omega : float
        Angular frequency of the peak [rad/s]; ``nan`` if the norm is infinite at no single frequency.
    method : str
        How the upper bound was obtained, or why there is none.
    path : tuple of str
        What stood for a structure, from the first to the last; empty of a state-space system, which stands for itself.
    """

    lower: float
    upper: float
    omega: float
    method: str
    path: tuple[str, ...] = ()

    def __repr__(self) -> str:
        at = f" at {self.omega:.6g} rad/s" if isfinite(self.omega) else ""
        doubt = "certified" if self.certified else f"not certified, at most {self.upper:.6g}"
        return f"NormCertificate: H-infinity norm {self.lower:.6g}{at}, {doubt}\n  {self.method}"

    @property
    def certified(self) -> bool:
        """Whether the bounds agree to one part in 1e5, or the norm is known to be infinite."""
        return self.lower == inf or self.upper <= self.lower * (1.0 + _CERTIFIED) + np.finfo(float).tiny


def hinf_norm(system: "control.StateSpace") -> NormCertificate:
    """Return the certified H-infinity norm of a state-space system; infinite if it is not stable.

    Poles on the imaginary axis count only if they show in the response (undamped or integrating modes).

    Raises
    ------
    TypeError, ValueError
        Another kind of system (:func:`boomctl.sigma` takes structures as well), discrete time, not finite.
    """
    return matrices_norm(of(system, expected="a StateSpace").balanced())


def matrices_norm(system: Lti, response: Response | None = None) -> NormCertificate:
    """Return the certified norm of ``A, B, C, D``; ``response`` may offer a more accurate frequency response."""
    respond = partial(system.response, quiet=True) if response is None else response
    if min(system.D.shape) == 0 or not len(system.A):
        value = float(np.linalg.norm(system.D, 2)) if system.D.size else 0.0
        return NormCertificate(value, value, 0.0, STATIC_GAIN)
    pole = unbounded_pole(system.poles, respond)
    if pole is not None and pole.real > 0.0:
        return NormCertificate(inf, inf, float("nan"), UNSTABLE)
    if pole is not None:
        return NormCertificate(inf, inf, pole.imag, UNDAMPED)
    peak, at = largest_gain(system, response)
    static = float(np.linalg.norm(system.D, 2))
    return _raised(system, respond, max(peak, static), at if peak >= static else inf)


def unbounded_pole(poles: Array, respond: Response) -> complex | None:
    """Return a pole that makes a response infinite: an unstable one, or an undamped one that shows; None without."""
    side, size = side_of_axis(poles), np.abs(poles)
    if (side > 0).any():
        return complex(poles[side > 0][0])
    for omega in np.unique(np.abs(poles[side == 0].imag)):
        others = size[np.abs(np.abs(poles.imag) - omega) > _APART * size.max()]
        if grows_towards(respond, float(omega), float(omega) if omega > 0.0 else float(others.min(initial=1.0))):
            return complex(0.0, omega)
    return None


def grows_towards(respond: Response, omega: float, scale: float) -> bool:
    """Return whether the response grows without bound towards ``omega``, seen from a millionth of ``scale`` away."""
    near, far = singular_values(respond(omega + scale * np.array([_NEAR, _FAR])))[0]
    return bool(near > _GROWN * far)


def _raised(system: Lti, respond: Response, peak: float, at: float) -> NormCertificate:
    """Raise a lower bound until no singular value reaches a level just above it."""
    for _ in range(_ROUNDS):
        level = peak * (1.0 + _LEVEL)
        if level == 0.0:
            return NormCertificate(0.0, 0.0, 0.0, NO_RESPONSE)
        crossings = level_crossings(system, level)
        if not len(crossings):
            return NormCertificate(peak, level, at, NO_CROSSING)
        middles = np.concatenate([crossings, 0.5 * (crossings[1:] + crossings[:-1])])
        values = singular_values(respond(middles))[0]
        best = int(np.argmax(values))
        if values[best] <= level:
            return NormCertificate(peak, inf, at, NOT_TOLD)
        peak, at = float(values[best]), float(middles[best])
    return NormCertificate(peak, inf, at, NOT_ENDED)


def level_crossings(system: Lti, level: float) -> Array:
    """Return the frequencies at which a singular value may equal ``level``; where there is none, all are below it.

    Raises
    ------
    ValueError
        ``level`` does not exceed the largest singular value of ``D``.
    """
    if np.linalg.norm(system.D, 2) >= level:
        raise ValueError(f"level = {level:g}: expected more than the largest singular value of D")
    return axis_eigenvalues(system, level)


def axis_eigenvalues(system: Lti, level: float) -> Array:
    """Return the frequencies at which a singular value may equal ``level``, which is none of those of ``D``.

    They are the imaginary parts, not below zero, of eigenvalues of the Hamiltonian matrix on the imaginary axis, or as
    near as rounding may have moved them: by a multiple of the norm of the balanced matrix, not of its eigenvalues.
    """
    A, B, C, D = system.A, system.B / np.sqrt(level), system.C / np.sqrt(level), system.D / level
    shifted, acting, reading = A, B.T, C
    if D.any():
        R, S = np.eye(D.shape[1]) - D.T @ D, np.eye(D.shape[0]) - D @ D.T
        shifted, acting, reading = A + B @ np.linalg.solve(R, D.T @ C), np.linalg.solve(R, B.T), np.linalg.solve(S, C)
    H = np.block([[shifted, B @ acting], [-C.T @ reading, -shifted.T]])
    with np.errstate(invalid="ignore"):  # scipy casts what may be large scales to permutations, which are not used
        H = linalg.matrix_balance(H, permute=False)[0]
    values = linalg.eigvals(H)
    noise = _ROUNDING * np.linalg.norm(H) + _RELATIVE_ROUNDING * np.abs(values)
    close = values[(np.abs(values.real) <= noise) & (values.imag >= 0.0)]
    return np.sort(close.imag)
