"""Norms between two bounds, and how those of H-infinity norms are found.

An H-infinity norm is reported with two bounds of its own: the largest singular value found (attained at a frequency, from the
system's own response), and a level that no singular value reaches at any frequency.  The sum over the modes proves it
(:mod:`boomctl.analysis.sum_over_modes`): over the eigenvectors, or, where these lose digits, in modal coordinates that
answer for themselves (:mod:`boomctl.lti.verified_modal_form`), whose largest value is then the lower bound, less what they
lose.  Where neither tells it, or that takes longer, as of a flat response or of many signals, no eigenvalue of the
Hamiltonian matrix lies on the imaginary axis (Boyd, Balakrishnan & Kabamba 1989, Bruinsma & Steinbuch 1990).

In discrete time the level is found by the continuous image of the bilinear map, which has the same norm.  The largest value
is then the system's own on the unit circle.  The sum over the modes, each at its own image, proves the level, or it is proved
without the map: no generalized eigenvalue of the symplectic pencil on the unit circle.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from math import inf, isfinite, log2
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg
from scipy.linalg import blas, lapack

from boomctl.analysis import sum_over_modes
from boomctl.analysis.marginal_poles import MarginalPoles, marginal_poles
from boomctl.analysis.prove import Claim
from boomctl.arrays import Array, balance, blocks, scaled_to_one
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.frequency import (
    RAISED,
    Resonances,
    Response,
    highest_peak,
    largest_gain,
    largest_of,
    resonance_grid,
    singular_values,
    top_of_a_mode,
)
from boomctl.lti.modal import ModalSystem, continuous_image_of_modes, partial_fractions
from boomctl.lti.rounding import CERTIFIED, DIGIT, EPS, LEVEL, SUMMED, TINY
from boomctl.lti.system import Lti, System, beside, of
from boomctl.lti.verified_modal_form import verified_modal_form
from boomctl.printing import between

if TYPE_CHECKING:
    from boomctl.structure.model import SecondOrderModel

_ROUNDING = 1e2 * EPS  # share of the Hamiltonian matrix's norm by which its eigenvalues may be off the axis

_LIGHTEST = 10  # resonances, those of least damping, at which the share of rounding is looked at (a choice)
# of a norm, a bound of rounding at all frequencies up to which no closer look is worth its time (a choice)
_CLEAR = 0.1 * LEVEL
# of a peak, what the sum over the modes may be off, or the response of entries that are: twice that above it, once below,
# and the level leave bounds that agree to CERTIFIED
_DOUBT = 0.28 * CERTIFIED
# how far above the peak, relative, a level is tried where rounding hides the first: the rest is for rounding of the peak
_HIGHER = 0.8 * CERTIFIED
_TWICE = 2.0  # times what rounding may change of a response: once of the system's own, once of the sum over its modes
# ratio of the distance of a level from the peak to rounding of the Hamiltonian matrix, above which its eigenvalues show
# whether the level is reached: four of them meet where two systems that cancel have nearly equal poles
_RESOLVED = 1e2
_TINY = 1e-150  # norms below which squares of responses are not numbers of full precision

NAMES = {"hinf": "H-infinity", "h2": "H2"}  # what the kinds of norm are called
# What tells a norm, in the order looked at: one of these is a certificate's ``method``.
STATIC_GAIN = "static gain"  # no states: the norm of D
UNSTABLE = "an unstable pole"  # infinite
UNDAMPED = "a pole on the imaginary axis"  # infinite, if the pole shows in the response
ON_CIRCLE = "a pole on the unit circle"  # the same in discrete time
NO_RESPONSE = "zero response"
IN_MODES = "the sum over the modes stays below at all frequencies"  # what is left: a level just above the largest value
NO_CROSSING = "no Hamiltonian eigenvalue on the imaginary axis"  # the same, where the sum does not tell
NO_CIRCLE_CROSSING = "no eigenvalue of the symplectic pencil on the unit circle"  # a level in discrete time
NOT_TOLD = "an eigenvalue too close to the boundary of stability to tell"  # no upper bound
OF_DATA = "largest value on the grid of the data"  # no upper bound
PROVED = "proved in ball arithmetic, of the numbers as they are stored"
LOST = "rounding of the entries changes the peak by more than can be certified"
NOT_PROVED = "rounding may change it, and a proof takes too long"  # no upper bound


@dataclass(frozen=True)
class NormBounds:
    """A norm between two bounds.

    Attributes
    ----------
    lower_bound : float
        The norm is at least this: of an H-infinity norm the largest singular value found, at ``peak_omega``, less
        what rounding may have added to it.
    upper_bound : float
        The norm is at most this; ``inf`` where that could not be shown.
    peak_omega : float
        Angular frequency of the peak [rad/s]; ``nan`` of an H2 norm, or if the norm is infinite at no single frequency.
    method : str
        How the bounds were obtained, or why there is none.
    stages : tuple of str
        What stood for a structure, from the first to the last; empty of a state-space system, which stands for itself.
    kind : str
        "hinf", the largest singular value over frequency, or "h2", the RMS of the outputs to white noise.
    """

    lower_bound: float
    upper_bound: float
    peak_omega: float
    method: str
    stages: tuple[str, ...] = ()
    kind: str = "hinf"
    _value: float | None = field(default=None, repr=False)
    _given: "Lti | SecondOrderModel | None" = field(default=None, repr=False, compare=False)

    def __float__(self) -> float:
        return self.value

    def __claims__(self) -> Iterator[Claim]:
        """Yield what can be proved."""
        if self._given is not None:
            stands = "" if isinstance(self._given, Lti) else "the state space that stands for the structure"
            system = of(self._given, sampled=True)
            yield replace(self._claim(stands or "the system", system), rounded=stands)

    def _claim(self, what: str, system: Lti, controller: Lti | None = None) -> Claim:
        """Return the claim that these are bounds of the norm of a system, or of its loop with a controller.

        Parameters
        ----------
        what : str
            What it is about, as messages call it.
        system, controller : Lti
            As they were handed in.

        Returns
        -------
        Claim
            For :func:`prove`.
        """
        if self.kind == "h2":
            return Claim(what, system, controller, energy=(self.lower_bound, self.upper_bound))
        return Claim(what, system, controller, norm=(self.lower_bound, self.upper_bound, self.peak_omega))

    def __repr__(self) -> str:
        at = f" at {self.peak_omega:.6g} rad/s" if isfinite(self.peak_omega) else ""
        at_least = f"at least {self.lower_bound:.6g}, " if self.lower_bound < self.value else ""
        at_most = f"at most {self.upper_bound:.6g}" if isfinite(self.upper_bound) else "no upper bound"
        doubt = "certified" if self.certified else f"not certified, {at_least}{at_most}"
        signals = "" if self._given is None else f"\n  {between(self._given.input_labels, self._given.output_labels)}"
        return f"NormBounds: {NAMES[self.kind]} norm {self.value:.6g}{at}, {doubt}{signals}\n  {self.method}"

    @property
    def value(self) -> float:
        """The norm: of an H-infinity norm the lower bound, of an H2 norm a number between the bounds."""
        return self.lower_bound if self._value is None else self._value

    @property
    def certified(self) -> bool:
        """Whether the bounds agree to one part in 1e5, or the norm is known to be infinite."""
        return self.lower_bound == inf or self.upper_bound <= self.lower_bound * (1.0 + CERTIFIED) + TINY


def norm_of_data(omega: Array, response: Array) -> NormBounds:
    """Return the largest singular value of a frequency response, outputs by inputs by frequencies, on its grid.

    Raises
    ------
    ValueError
        The response is not finite, or has no frequencies.
    """
    if not (np.isfinite(response).all() and response.size):
        raise ValueError("system: expected finite frequency response data")
    values = singular_values(response)[0]
    best = int(np.argmax(values))
    return NormBounds(float(values[best]), inf, float(omega[best]), OF_DATA)


def matrices_norm(given: System, response: Response | None = None, axis: MarginalPoles | None = None) -> NormBounds:
    """Return the certified norm of ``A, B, C, D``, which are balanced.

    ``response`` may be a more accurate one; ``axis`` is what is known of the poles, with a ``doubt`` of infinity where that
    of other inputs or outputs of the same ``A`` was found.  The norm of a loop is that of its parts as they are stored: its
    own matrices are rounded.
    """
    system = given.system
    if min(system.D.shape) == 0 or not len(system.A):
        value = largest_of(system.D)
        return NormBounds(value, value, 0.0, STATIC_GAIN)
    axis = marginal_poles(given) if axis is None else axis
    if axis.infinite is not None:
        grows, undamped = axis.infinite.real > 0.0, UNDAMPED if system.dt == 0.0 else ON_CIRCLE
        return NormBounds(inf, inf, float("nan") if grows else axis.infinite.imag, UNSTABLE if grows else undamped)
    if axis.doubtful is not None:
        peak, at = _largest_beyond_rounding(given)
        return NormBounds(peak, inf, at, f"a mode at {abs(axis.doubtful):.6g} rad/s {doubtful(system)}")
    if axis.hidden.any():
        return proved_norm(given, *_largest_beyond_rounding(given))
    if response is None and given is system and not axis.doubt <= _DOUBT * axis.bound:
        verified = verified_modal_form(system)  # takes longer, and loses less
        if verified is not None:
            modes, off = continuous_image_of_modes(verified.modal, system.dt)
            result = _by_modes(replace(system, D=modes.D), modes.response, verified.gap + off, modes)
            if result.certified and result.lower_bound >= _TINY:
                off += verified.gap + sum_over_modes.lost_by_floats(modes)
                return replace(
                    result,
                    lower_bound=result.lower_bound - off,
                    peak_omega=float(omega_of_image(result.peak_omega, system.dt)),
                )
    result = level_norm(system, response, axis.doubt) if system.dt == 0.0 else _by_circle(given, axis.doubt)
    if result.method == IN_MODES and result.lower_bound >= _TINY:
        return replace(
            result, lower_bound=max(result.lower_bound - _rounding_of_response(given, result.peak_omega, 0), 0.0)
        )
    clear = axis.doubt <= _CLEAR * result.lower_bound
    rounding = _rounding_of_response(given, result.peak_omega, 0 if clear else _LIGHTEST)
    sharp = (
        result.certified and rounding <= LEVEL * result.lower_bound and (result.lower_bound >= _TINY or rounding == 0.0)
    )
    if not sharp:
        result = proved_norm(given, max(result.lower_bound - rounding, 0.0), result.peak_omega)
    if sharp or response is not None:  # what is stored only stands for a structure: its last digits count
        upper = result.upper_bound + (_CLEAR * result.lower_bound if clear else rounding)
        result = replace(result, lower_bound=max(result.lower_bound - rounding, 0.0), upper_bound=upper)
    return result if sharp or response is None or result.certified else replace(result, method=LOST)


def proved_norm(
    given: System,
    lower: float,
    omega: float,
    minus: Lti | None = None,
    band: tuple[float, float] | None = None,
) -> NormBounds:
    """Compute the norm of a system in exact arithmetic, from a guess of the peak; no upper bound if undecided.

    With ``minus`` it is the norm of the difference of two systems; with ``band`` [rad/s] the largest singular value there.
    """
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact

    try:
        exact = Exact.of(given, OPERATIONS, minus)
        exact.check_norm()
        if exact.sides[0]:
            raise UndecidedError
        limits = (0.0, inf) if band is None else (exact.square(band[0]), exact.square(band[1]))
        peak, level, square = exact.norm(exact.square(omega), limits)
    except UndecidedError:
        return NormBounds(lower, inf, omega, NOT_PROVED)
    return NormBounds(peak, level, exact.omega(square), PROVED)


def level_norm(
    system: Lti, response: Response | None = None, doubt: float = inf, modes: ModalSystem | None = None
) -> NormBounds:
    """Return the norm of a stable system by levels proved not to be reached, as if ``A, B, C, D`` had no rounding.

    For those who answer for that rounding themselves; :func:`matrices_norm` does.  Where it and the sum over the modes are
    known to be off by ``doubt`` at most, and that is little, the sum proves a level; elsewhere the Hamiltonian matrix does.
    ``modes`` are its partial fractions, where they are known.
    """
    respond = partial(_response, system) if response is None else response
    result = _by_modes(system, respond, doubt, partial_fractions(system) if modes is None else modes)
    if result.certified or result.lower_bound == 0.0:
        return result
    peak, at = result.lower_bound, result.peak_omega
    above = LEVEL
    for _ in range(RAISED):
        level = peak * (1.0 + above)
        H = hamiltonian_matrix(system, level)
        crossings, near = near_axis(H[0])
        value, omega = _highest_at(respond, np.concatenate([crossings.imag, near.imag]))
        if not isfinite(value):
            break
        if value > level:
            peak, at, above = value, omega, LEVEL
        elif not len(crossings) and level_shows(system, level, peak, at, H):
            return NormBounds(peak, level, at, NO_CROSSING)
        elif above == LEVEL:
            above = _HIGHER
        else:
            break
    return NormBounds(peak, inf, at, NOT_TOLD)


def _by_modes(system: Lti, respond: Response, doubt: float, modes: ModalSystem) -> NormBounds:
    """Return the largest singular value near the modes, and what none exceeds, where the sum over the modes proves it.

    It, and the response itself where entries are off in their last places, are off by ``doubt`` at most.  Nearly always the
    mode that is highest alone is at the peak: where the proof says so, no other is searched for.
    """

    def highest(omega: Array) -> Array:
        return singular_values(respond(omega))[0]

    top = top_of_a_mode(modes) if doubt < inf else None
    if top is not None:
        result, _ = _proved(modes, float(highest(np.array(top[1:]))[0]), top[1], doubt)
        if result is not None:
            return result
    peak, at = largest_gain(system, respond, modes)
    static = largest_of(system.D)  # eigenvectors may have lost digits of that of the modes
    peak, at = (peak, at) if peak >= static else (static, inf)
    if peak == 0.0:
        return NormBounds(0.0, 0.0, 0.0, NO_RESPONSE)
    if not isfinite(peak):  # its square is no number, and nothing is known of it
        return NormBounds(0.0, inf, at, NOT_TOLD)
    for _ in range(RAISED):
        result, higher = _proved(modes, peak, at, doubt)
        if result is not None:
            return result
        value, omega = highest_peak(highest, higher) if len(higher) else (0.0, at)
        if value <= peak:
            break
        peak, at = value, omega
    return NormBounds(peak, inf, at, NOT_TOLD)


def _proved(modes: ModalSystem, peak: float, at: float, doubt: float) -> tuple[NormBounds | None, Array]:
    """Return a norm whose peak is at a frequency, if the sum over the modes proves it, and some where it is higher."""
    if not (doubt <= _DOUBT * peak < inf and isfinite(at)):
        return None, np.zeros(0)
    level = peak * (1.0 + LEVEL)
    told, higher = sum_over_modes.stays_below(modes, level, at)
    return NormBounds(peak, level + _TWICE * doubt, at, IN_MODES) if told else None, higher


def stays_below(system: Lti, level: float, at: float, response: Response | None = None) -> bool:
    """Return whether no singular value of a stable system reaches a level, as far as eigenvalues tell it.

    None lies on the imaginary axis, and the response stays below where some lie near it, and between these.  Rounding does
    not hide the level where the response is high, at ``at``.
    """
    respond = partial(system.response, quiet=True) if response is None else response
    peak = float(singular_values(respond(np.array([at])))[0, 0]) if isfinite(at) else 0.0
    H = hamiltonian_matrix(system, level)
    crossings, near = near_axis(H[0])
    if len(crossings) or peak > level or not level_shows(system, level, peak, at, H):
        return False
    return _highest_at(respond, near.imag)[0] <= level


def _highest_at(respond: Response, omega: Array) -> tuple[float, float]:
    """Return the largest singular value at frequencies, between and on both sides of them, and where; zero without any."""
    if not len(omega):
        return 0.0, 0.0
    seen = np.sort(omega)
    seen = np.concatenate([seen, 0.5 * (seen[1:] + seen[:-1]), [0.5 * seen[0], 2.0 * seen[-1]]])
    values = singular_values(respond(seen))[0]
    return float(values.max()), float(seen[values.argmax()])


def _by_circle(given: System, doubt: float) -> NormBounds:
    """Return the norm of a stable discrete system, by its continuous image, as :func:`level_norm` does.

    Where eigenvectors have their digits, the sum over its modes, each at its own image, proves the level; elsewhere levels of
    the image are found, the last one proved without it.  Where rounding hides the image, no upper bound.
    """
    system = given.system
    try:
        image = continuous_image(system)
    except ValueError:
        peak, at = _largest_beyond_rounding(given)
        return NormBounds(peak, inf, at, NOT_TOLD)

    def respond(v: Array) -> Array:
        return system.response(omega_of_image(v, system.dt), quiet=True)

    modes, off = continuous_image_of_modes(partial_fractions(system), system.dt) if doubt < inf else (None, 0.0)
    result = level_norm(image, respond, doubt + off, modes)
    result = replace(result, peak_omega=float(omega_of_image(result.peak_omega, system.dt)))
    if not result.certified or result.lower_bound == 0.0 or result.method == IN_MODES:
        return result
    told = stays_below_on_circle(system, result.upper_bound)
    return replace(result, method=NO_CIRCLE_CROSSING) if told else replace(result, upper_bound=inf, method=NOT_TOLD)


def stays_below_on_circle(system: Lti, level: float) -> bool:
    """Return whether it is proved that no singular value of a discrete system reaches a level on the unit circle.

    With ``x+ = A x + B u``, ``p = A^T p+ + C^T y``, ``level^2 u = B^T p+ + D^T y`` a singular value equals the level at ``z``
    where ``z`` is an eigenvalue of this pencil, of which nothing is inverted (Pappas & Laub 1980); and at one frequency, the
    highest, all are below.  Eigenvalues as near to the circle as rounding may have moved them count as lying on it.  Where
    two crossings have nearly met, rounding moves them off it by its root: there, and between, the response is looked at.
    """
    B, C, D, _ = _at_level(system, level)
    at_the_end = system.response(np.array([system.nyquist]), quiet=True)
    if singular_values(at_the_end)[0, 0] >= level:
        return False
    left, right = circle_pencil(system.A, B, C, D)
    alpha, beta = linalg.eig(right, left, right=False, homogeneous_eigvals=True)
    angle = np.abs(np.angle(alpha * beta.conj()))
    alpha, beta = np.abs(alpha), np.abs(beta)
    noise = _ROUNDING * max(float(np.linalg.norm(left)), float(np.linalg.norm(right)))
    size = np.maximum(1.0, np.maximum(alpha, beta))
    off = np.abs(alpha - beta)
    if (off <= noise * size).any():
        return False
    return _highest_at(partial(system.response, quiet=True), angle[off <= np.sqrt(noise) * size] / system.dt)[0] < level


def _at_level(system: Lti, level: float, least: float = inf) -> tuple[Array, Array, Array, float]:
    """Return ``B``, ``C``, ``D`` with which the response at a level has the size one, and by how much states are larger.

    Where ``B`` or ``C`` is smaller than ``least``, or larger than its inverse, by default always, they are so by a power of
    two, without rounding, that makes both alike: their squares are numbers.
    """
    B, C = system.B / np.sqrt(level), system.C / np.sqrt(level)
    size_B, size_C = blas.dnrm2(B.ravel()), blas.dnrm2(C.ravel())
    small, large = sorted([float(size_B), float(size_C)])
    far = small > 0.0 and (small < least or large > 1.0 / least)
    up = 2.0 ** round(0.5 * (log2(size_C) - log2(size_B))) if far else 1.0
    return up * B, C / up, system.D / level, up


def circle_pencil(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array]:
    """Return ``L, R``, affine in ``A`` and ``B``: ``z L - R`` is singular on the circle where a singular value is one."""
    n, m = B.shape
    left, right = np.zeros((2 * n + m, 2 * n + m)), np.zeros((2 * n + m, 2 * n + m))
    left[:n, :n], left[n : 2 * n, n : 2 * n], left[2 * n :, n : 2 * n] = np.eye(n), A.T, B.T
    right[:n, :n], right[:n, 2 * n :] = A, B
    right[n : 2 * n, :n], right[n : 2 * n, n : 2 * n], right[n : 2 * n, 2 * n :] = -C.T @ C, np.eye(n), -C.T @ D
    right[2 * n :, :n], right[2 * n :, 2 * n :] = -D.T @ C, np.eye(m) - D.T @ D
    return left, right


def doubtful(system: Lti) -> str:
    """Return what is said of a mode that may be undamped."""
    boundary = "imaginary axis" if system.dt == 0.0 else "unit circle"
    return f"that the digits given do not tell from one on the {boundary}, where the norm would be infinite"


def _rounding_of_response(given: System, omega: float, count: int) -> float:
    """Return how much of the response at a frequency, and at so many of the lightest resonances, may be rounding."""
    asked = [omega if isfinite(omega) else 0.0]
    if count:
        rates = given.system.rates
        poles = rates[rates.imag > 0.0]
        asked += poles[np.argsort(np.abs(poles.real) / np.abs(poles))[:count]].imag.tolist()
    return max(_responded(given, at)[1] for at in asked)


def _largest_beyond_rounding(given: System) -> tuple[float, float]:
    """Return the largest singular value that is not rounding, near the poles and between them, and its frequency."""
    system = given.system
    top = 10.0 * float(np.abs(system.rates[np.isfinite(system.rates)]).max(initial=0.1))
    seen = Resonances.of_system(system, min(top, system.nyquist))
    grid = resonance_grid(seen.poles[seen.poles.imag > 0.0], seen.low, seen.high)
    if system.dt != 0.0:
        grid = beside(grid)  # a pole that rounding alone keeps from the circle is often hit to the last digit
    highest, best, at = singular_values(system.response(grid, quiet=True))[0], largest_of(system.D), inf
    for k in highest.argsort()[::-1]:
        if highest[k] <= best:
            break
        G, doubt = _responded(given, float(grid[k]))
        value = largest_of(G) - doubt if doubt < inf else 0.0
        if value > best:
            best, at = value, float(grid[k])
    return best, at


def _responded(given: System, omega: float) -> tuple[Array, float]:
    """Return the response at a frequency, and how much may be rounding: of the entries, and of solving; ``inf`` at a pole."""
    system, size, solved = given.system, given.magnitudes, _solved(given.system, omega)
    if solved is None:
        return np.zeros(system.D.shape), inf
    acting, reading = solved
    with np.errstate(invalid="ignore", over="ignore"):  # at a pole: what is not finite is doubtful altogether
        states = np.abs(acting)
        left = np.abs(system.B + system.A @ acting - system.boundary(omega) * acting)
        off = np.abs(reading).T @ (DIGIT * (size.A @ states + size.B) + left) + DIGIT * (size.C @ states + size.D)
        rounding = float(off.max()) * system.D.size**0.5  # no squares, which may be zero
        return system.C @ acting + system.D, rounding if isfinite(rounding) else inf


def _response(system: Lti, omega: Array) -> Array:
    """Return a system's response; of one frequency with what tells how much of it is rounding, which may be asked next."""
    solved = _solved(system, float(omega[0])) if len(omega) == 1 else None
    return system.response(omega, quiet=True) if solved is None else (system.C @ solved[0] + system.D)[:, :, None]


@lru_cache(maxsize=1)  # at the peak the response, a level, and then the share of rounding are looked at
def _solved(system: Lti, omega: float) -> tuple[Array, Array] | None:
    """Return ``(s - A)^-1 B`` and ``(s - A)^-T C^T`` at a frequency; None at a pole that rounding keeps from the axis."""
    pencil = -system.A.astype(complex)
    pencil.flat[:: len(pencil) + 1] += system.boundary(omega)
    factors, swapped, singular = lapack.zgetrf(pencil)
    if singular:
        return None
    return lapack.zgetrs(factors, swapped, system.B)[0], lapack.zgetrs(factors, swapped, system.C.T, trans=1)[0]


def hamiltonian_matrix(system: Lti, level: float) -> tuple[Array, Array]:
    """Return the balanced Hamiltonian matrix of a level, and the scales of its coordinates."""
    # where squares are numbers states stay as they are: others hide levels of stiff structures in rounding (measured)
    A, n, (B, C, D, up) = system.A, len(system.A), _at_level(system, level, _TINY)
    if D.any():
        fed = np.linalg.solve(np.eye(D.shape[1]) - D.T @ D, np.concatenate([D.T @ C, B.T], axis=1))
        A, C_, B_ = A + B @ fed[:, :n], C + D @ fed[:, :n], fed[:, n:]
    else:
        C_, B_ = C, B.T
    H, scale = balance(blocks([[A, B @ B_], [-C.T @ C_, -A.T]]))
    return H, scale * np.repeat([1.0 / up, up], n)


def level_shows(system: Lti, level: float, peak: float, omega: float, hamiltonian: tuple[Array, Array]) -> bool:
    """Return whether the eigenvalues of the Hamiltonian matrix would show that a level just below this one is reached.

    With ``v`` the input of the largest gain ``g`` at the peak, ``x = (j w - A)^-1 B v``, ``p = -(j w + A^T)^-1 C^T y`` make
    ``(j w - H)[x; p]`` zero but for ``(1 - g^2/level^2) B v``.  Where that is not well above rounding of the matrix times
    its size, as where modes cancel, eigenvalues show nothing.  The gain ``peak`` is that of an accurate response: of modes
    that cancel, ``A, B, C`` give another one.
    """
    if not isfinite(omega):
        return True
    n, solved = len(system.A), _solved(system, omega)
    if solved is None:
        return False
    states, adjoint = solved
    v = lapack.zgesdd(system.C @ states + system.D)[2][0].conj()
    x = states @ v
    y = system.C @ x + system.D @ v
    p = adjoint.conj() @ y / level
    H, scale = hamiltonian
    gap = (1.0 - (peak / level) ** 2) * blas.dznrm2((system.B @ v) / scale[:n])
    return bool(gap > _RESOLVED * DIGIT * blas.dnrm2(H.ravel()) * blas.dznrm2(np.concatenate([x, p]) / scale))


def axis_eigenvalues(system: Lti, level: float) -> Array:
    """Return the frequencies at which a singular value may equal ``level``, which is none of those of ``D``.

    They are the imaginary parts, not below zero, of eigenvalues of the Hamiltonian matrix on the imaginary axis, or so near
    to it that rounding may have moved them off it.
    """
    return np.concatenate([result.imag for result in near_axis(hamiltonian_matrix(system, level)[0])])


def near_axis(H: Array) -> tuple[Array, Array]:
    """Return the eigenvalues, not below the real axis, on the imaginary axis, and those that lie so near to it.

    Where two crossings have nearly met, rounding moves their eigenvalues off the axis by its root: what lies so near is
    worth a look, once for the two.  So is an eigenvalue that lies no farther from the axis than from the nearest mirror
    image of another: eigenvalues off the axis come in such pairs, and this one may be off it by rounding.
    """
    scaled, power = scaled_to_one(H)
    re, im, _, _, failed = lapack.dgeev(
        scaled, compute_vl=0, compute_vr=0, lwork=int(lapack.dgeev_lwork(len(H), 0, 0)[0])
    )
    if failed:
        raise np.linalg.LinAlgError("eigenvalues of a Hamiltonian matrix were not found")
    values = np.ldexp(re, power)[im >= 0.0] + 1j * np.ldexp(im, power)[im >= 0.0]
    size, off = np.abs(values), np.abs(values.real)
    noise = _ROUNDING * blas.dnrm2(H.ravel()) + SUMMED * size
    close = off <= noise
    alone = off <= np.abs(values[:, None] + values.conj()).min(axis=1)
    met = (values.real <= 0.0) & (off <= 2.0 * np.sqrt(noise * size))  # its mirror image lies up to twice as far off
    return values[close], values[~close & (alone | met)]
