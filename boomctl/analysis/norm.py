"""Certified H-infinity norms.

A norm is reported with two bounds of its own: the largest singular value found (attained at a frequency, from the
system's own response), and a level that no singular value reaches at any frequency (no eigenvalue of the Hamiltonian
matrix on the imaginary axis; Boyd, Balakrishnan & Kabamba 1989, Bruinsma & Steinbuch 1990).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, optimize

from boomctl.arrays import Array
from boomctl.lti.frequency import singular_values
from boomctl.lti.system import Lti, state_matrices

if TYPE_CHECKING:
    import control

_LEVEL = 1e-6
_AXIS = 1e-10
_ROUNDS = 30
_REFINED = 3
_SCREENED = 60
_RESOLVED = 1e-13  # poles slower than that share of the fastest are rounding, not dynamics

Response = Callable[[Array], Array]


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
        How the upper bound was obtained.
    """

    lower: float
    upper: float
    omega: float
    method: str

    def __repr__(self) -> str:
        at = f" at {self.omega:.6g} rad/s" if isfinite(self.omega) else ""
        doubt = "certified" if self.certified else f"not certified, at most {self.upper:.6g}"
        return f"NormCertificate: H-infinity norm {self.lower:.6g}{at}, {doubt}\n  {self.method}"

    @property
    def certified(self) -> bool:
        """Whether the bounds agree to one part in 1e5, or the norm is known to be infinite."""
        return self.lower == inf or self.upper <= self.lower * (1.0 + 1e-5) + np.finfo(float).tiny


def hinf_norm(system: "control.StateSpace") -> NormCertificate:
    """Return the certified H-infinity norm of a state-space system; infinite if it is not stable.

    Poles on the imaginary axis count only if they show in the response (undamped or integrating modes).

    Raises
    ------
    TypeError, ValueError
        Another kind of system (:func:`boomctl.sigma` takes structures as well), discrete time, not finite.
    """
    from boomctl.lti.python_control import control

    if not isinstance(system, control.StateSpace):
        raise TypeError(f"system: expected a StateSpace, got {type(system).__name__}")
    return matrices_norm(state_matrices(system))


def matrices_norm(system: Lti, response: Response | None = None) -> NormCertificate:
    """Return the certified norm of ``A, B, C, D``; ``response`` may offer a more accurate frequency response."""
    respond = system.response if response is None else response
    if min(system.D.shape) == 0 or not len(system.A):
        value = float(np.linalg.norm(system.D, 2)) if system.D.size else 0.0
        return NormCertificate(value, value, 0.0, "static gain")
    poles = linalg.eigvals(system.A)
    size = np.abs(poles).max()
    if (poles.real > _AXIS * np.maximum(np.abs(poles), 1e-3 * size)).any():
        return NormCertificate(inf, inf, float("nan"), "an unstable pole")
    on_axis = poles[np.abs(poles.real) <= _AXIS * np.maximum(np.abs(poles), 1e-6)]
    for omega in np.unique(np.abs(on_axis.imag)):
        if _blows_up(respond, float(omega), poles):
            return NormCertificate(inf, inf, float(omega), "a pole on the imaginary axis")
    screen = _by_eigenvectors(system) if response is None and len(system.A) > _SCREENED else respond
    peak, at = refined_peak(respond, poles, screen)
    static = float(np.linalg.norm(system.D, 2))
    return _raised(system, respond, max(peak, static), at if peak >= static else inf)


def _blows_up(respond: Response, omega: float, poles: Array) -> bool:
    others = np.abs(poles[np.abs(np.abs(poles.imag) - omega) > 1e-6 * np.abs(poles).max()])
    return grows_towards(respond, omega, omega if omega > 0.0 else float(others.min(initial=1.0)))


def grows_towards(respond: Response, omega: float, scale: float) -> bool:
    """Return whether the response grows without bound towards ``omega``, seen from a millionth of ``scale`` away."""
    near, far = (float(singular_values(respond(np.array([omega + w * scale])))[0, 0]) for w in (1e-6, 3e-5))
    return near > 5.0 * far


def _by_eigenvectors(system: Lti) -> Response:
    """Return a fast, less accurate response of a large system, good enough to see where its peaks are."""
    poles, V = linalg.eig(system.A)
    left, right = system.C @ V, np.linalg.solve(V, system.B.astype(complex))
    terms = left.T[:, :, None] * right[:, None, :]

    def respond(omega: Array) -> Array:
        shares = 1.0 / (1j * omega[None, :] - poles[:, None])
        return np.tensordot(terms, shares, axes=(0, 0)) + system.D[:, :, None]

    return respond


def refined_peak(respond: Response, poles: Array, screen: Response) -> tuple[float, float]:
    """Return the largest singular value near the poles and at the ends of the axis, and where it is.

    ``screen`` is asked at many frequencies, ``respond`` around the largest values found.
    """
    size = np.abs(poles)
    low, high = max(size.min(), _RESOLVED * size.max(), 1e-12), max(size.max(), 1e-12)
    ends = [0.0] if size.min() > _RESOLVED * size.max() else []
    grid = np.unique(np.concatenate([ends, np.geomspace(low / 10, high * 10, 60), _near(poles)]))
    values = singular_values(screen(grid))[0]
    best = int(np.argmax(values))
    peak, at = float(singular_values(respond(grid[[best]]))[0, 0]), float(grid[best])
    for i in np.argsort(values)[::-1][: _REFINED if screen is respond else 1]:
        a, b = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]
        found = optimize.minimize_scalar(
            lambda w: -float(singular_values(respond(np.array([w])))[0, 0]),
            bounds=(a, b),
            method="bounded",
            options={"xatol": 1e-10 * b},
        )
        if -found.fun > peak:
            peak, at = float(-found.fun), float(found.x)
    return peak, at


def _near(poles: Array) -> Array:
    """Return frequencies around each resonance, within a few half-power widths."""
    upper = poles[(poles.imag > 0) & (np.abs(poles.real) > _AXIS * np.abs(poles))]
    offsets = np.array([-3.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 3.0])
    cluster = (upper.imag[:, None] + np.abs(upper.real)[:, None] * offsets).ravel()
    return cluster[cluster > 0]


def _raised(system: Lti, respond: Response, peak: float, at: float) -> NormCertificate:
    """Raise a lower bound until no singular value reaches a level just above it."""
    for _ in range(_ROUNDS):
        level = peak * (1.0 + _LEVEL)
        if level == 0.0:
            return NormCertificate(0.0, 0.0, 0.0, "zero response")
        crossings, clear = level_crossings(system, level)
        if clear:
            return NormCertificate(peak, level, at, "no Hamiltonian eigenvalue on the imaginary axis")
        middles = np.concatenate([crossings, 0.5 * (crossings[1:] + crossings[:-1])])
        values = singular_values(respond(middles))[0]
        best = int(np.argmax(values))
        if values[best] <= level:
            return NormCertificate(peak, inf, at, "a Hamiltonian eigenvalue too close to the imaginary axis to tell")
        peak, at = float(values[best]), float(middles[best])
    return NormCertificate(peak, inf, at, "the level was raised too often")


def level_crossings(system: Lti, level: float) -> tuple[Array, bool]:
    """Return frequencies at which a singular value may equal ``level``, and whether there is none.

    Raises
    ------
    ValueError
        ``level`` does not exceed the largest singular value of ``D``.
    """
    if np.linalg.norm(system.D, 2) >= level:
        raise ValueError(f"level = {level:g}: expected more than the largest singular value of D")
    crossings = axis_eigenvalues(system, level)
    return crossings, len(crossings) == 0


def axis_eigenvalues(system: Lti, level: float) -> Array:
    """Return the frequencies at which a singular value may equal ``level``, which is none of those of ``D``.

    They are the imaginary parts, not below zero, of eigenvalues of the Hamiltonian matrix on the imaginary axis, or as
    near as rounding may have moved them: by a multiple of the norm of the balanced matrix, not of its eigenvalues.
    """
    A, B, C, D = system.A, system.B / np.sqrt(level), system.C / np.sqrt(level), system.D / level
    R, S = np.eye(D.shape[1]) - D.T @ D, np.eye(D.shape[0]) - D @ D.T
    shifted = A + B @ np.linalg.solve(R, D.T @ C)
    H = np.block([[shifted, B @ np.linalg.solve(R, B.T)], [-C.T @ np.linalg.solve(S, C), -shifted.T]])
    with np.errstate(invalid="ignore"):  # scipy casts what may be large scales to permutations, which are not used
        H = linalg.matrix_balance(H, permute=False)[0]
    values = linalg.eigvals(H)
    noise = 1e2 * np.finfo(float).eps * np.linalg.norm(H) + 1e-12 * np.abs(values)
    close = values[(np.abs(values.real) <= noise) & (values.imag >= 0.0)]
    return np.sort(close.imag)
