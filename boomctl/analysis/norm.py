"""Verified lower and upper bounds of H-infinity norms.

The frequency of the largest singular value is computed in modal coordinates, the value from the system's own matrices, or
from the sum over the modes if its error is bounded by a relative 1e-9.  One of three methods yields an upper bound, in this
order:

1. The sum over the modes stays below a level at all frequencies, rounding error of the entries included
   (:mod:`boomctl.analysis.sum_over_modes`): a proof that takes a millisecond.
2. No eigenvalue of the Hamiltonian matrix of a level is on the imaginary axis (Boyd, Balakrishnan & Kabamba 1989; Bruinsma
   & Steinbuch 1990); in discrete time the matrix is that of the image under the bilinear transformation.  The norm is
   verified, and proved on first access to `NormBounds.certified`.
3. If rounding error of the entries may decide, exact arithmetic (:mod:`boomctl.lti.proof`), up to `EXACT_STATES` states.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import inf, isfinite, log2, nan
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack

from boomctl.analysis import sum_over_modes
from boomctl.analysis.claim import Claim
from boomctl.analysis.sum_over_modes import Bounded
from boomctl.arrays import Array, balance, blocks, scaled_to_one
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.frequency import (
    RAISED,
    SEARCHED,
    Response,
    highest_peak,
    largest_gain,
    largest_of,
    resonance_grid,
    singular_values,
    top_of_a_mode,
)
from boomctl.lti.modal import ModalSystem, continuous_image_of_modes, partial_fractions, sides
from boomctl.lti.rounding import (
    ALIKE,
    CANCELLED,
    CERTIFIED,
    DIGIT,
    EPS,
    EXACT_STATES,
    LEVEL,
    SUMMED,
    TINY,
    UNDERFLOW,
)
from boomctl.lti.system import ClosedLoop, Lti, System, rates_of
from boomctl.printing import between

if TYPE_CHECKING:
    from boomctl.structure.model import SecondOrderModel

_ROUNDING = 1e2 * EPS  # Rounding error of eigenvalues of a Hamiltonian matrix, relative to its norm.
_LEAST_DAMPED = 10  # Number of poles at which the rounding error of the response is estimated.
# Distance of a pole from the stability boundary, relative to its change by rounding errors of the entries, below which exact
# arithmetic decides on its stability.
_NEAR = 100.0
# Largest change of the peak by rounding errors of the entries, relative, without exact arithmetic: twice this value above,
# once below, and the level leave bounds that agree to CERTIFIED.
_ROUNDING_LIMIT = 0.28 * CERTIFIED
_NEARBY = [0.7, 1.0]  # Relative frequencies at which the response is evaluated for a mode that may be undamped.
_BAND_START = 1e-6  # First frequency of the grid of a band from zero, relative to the last one.

NAMES = {"hinf": "H-infinity", "h2": "H2"}  # Names of the norms.
# Methods in order of preference: values of `NormBounds.method`.
STATIC_GAIN = "static gain"  # No states: the norm of D.
UNSTABLE = "an unstable pole"  # Infinite.
UNDAMPED = "a pole on the imaginary axis"  # Infinite, if the pole contributes to the response.
ON_CIRCLE = "a pole on the unit circle"  # The same in discrete time.
NO_RESPONSE = "zero response"
IN_MODES = "upper bound by modal sum"  # For a level just above the peak.
NO_CROSSING = "no Hamiltonian eigenvalue on the imaginary axis"  # For such a level: verified.
PROVED = "proved in exact arithmetic, of the numbers as they are stored"
OF_DATA = "largest value on the grid of the data"  # No upper bound.
# Without an upper bound as well:
UNDECIDED = "an eigenvalue too close to the stability boundary to decide"
LOST = "rounding of the entries may change the peak by more than the certified tolerance"
NOT_PROVED = "rounding of the entries may change it, and exact arithmetic takes too long"


@dataclass(frozen=True)
class NormBounds:
    """Lower and upper bound of a norm.

    Attributes
    ----------
    lower_bound : float
        Lower bound of the norm: for an H-infinity norm the largest computed singular value, at ``peak_omega``, minus its
        rounding error.
    upper_bound : float
        Upper bound of the norm; ``inf`` if none was obtained.
    peak_omega : float
        Angular frequency of the peak [rad/s]; NaN for an H2 norm, or if the norm is infinite at no single frequency.
    method : str
        Method of the bounds, or the reason why there is no upper bound.
    stages : tuple of str
        Representations of a structure, in order; empty for a state-space system, which is used directly.
    kind : str
        "hinf", the largest singular value over frequency, or "h2", the RMS of the outputs to white noise.
    verified : bool
        True if an independent numerical method confirms both bounds, or that the norm is infinite.  The bounds of a norm then
        agree to a relative 1e-5, those of a reduction error to 1e-2.
    certified : bool
        True if both bounds are proved.  A proof may run on first access.
    """

    lower_bound: float
    upper_bound: float
    peak_omega: float
    method: str
    stages: tuple[str, ...] = ()
    kind: str = "hinf"
    verified: bool = False
    _proved: bool = field(default=False, repr=False)
    _value: float | None = field(default=None, repr=False)
    _given: "System | SecondOrderModel | None" = field(default=None, repr=False, compare=False)

    def __float__(self) -> float:
        return self.value

    def __claims__(self) -> Iterator[Claim]:
        """Yield the claims that can be proved."""
        if isinstance(self._given, Lti):
            yield self._claim("the system", self._given)
        elif isinstance(self._given, ClosedLoop):
            yield self._claim("the loop", self._given.plant, self._given.controller)
        elif self._given is not None:
            what = "the state space that represents the structure"
            parts = tuple(part._modal_form for part in self._given._halves or (self._given,))
            yield replace(self._claim(what, parts[0]), others=parts[1:], rounded=what)

    def _claim(self, what: str, system: Lti, controller: Lti | None = None) -> Claim:
        """Return the claim that these are bounds of the norm of a system, or of its loop with a controller.

        ``what`` is the name of the subject in messages.
        """
        if self.kind == "h2":
            return Claim(what, system, controller, energy=(self.lower_bound, self.upper_bound))
        return Claim(what, system, controller, norm=(self.lower_bound, self.upper_bound, self.peak_omega))

    def __repr__(self) -> str:
        at = f" at {self.peak_omega:.6g} rad/s" if isfinite(self.peak_omega) else ""
        at_least = f"at least {self.lower_bound:.6g}, " if self.lower_bound < self.value else ""
        at_most = f"at most {self.upper_bound:.6g}" if isfinite(self.upper_bound) else "no upper bound"
        status = self.status if self.verified else f"not verified, {at_least}{at_most}"
        named = self._given.system if isinstance(self._given, ClosedLoop) else self._given
        signals = "" if named is None else f"\n  {between(named.input_labels, named.output_labels)}"
        return f"NormBounds: {NAMES[self.kind]} norm {self.value:.6g}{at}, {status}{signals}\n  {self.method}"

    @property
    def value(self) -> float:
        """The norm: for an H-infinity norm the lower bound, for an H2 norm a value between the bounds."""
        return self.lower_bound if self._value is None else self._value

    @cached_property
    def certified(self) -> bool:
        """True if both bounds are proved.  A proof may run on first access."""
        if not self.verified or self._proved:
            return self.verified
        from boomctl.analysis.prove import is_proved

        return is_proved(self.__claims__())

    @property
    def status(self) -> str:
        """Status "certified", "verified" or "not verified", without running a proof."""
        if self.verified and (self._proved or self.__dict__.get("certified", False)):
            return "certified"
        return "verified" if self.verified else "not verified"


def norm_of_data(omega: Array, response: Array) -> NormBounds:
    """Return the largest singular value of a frequency response, outputs by inputs by frequencies, on its grid.

    Raises
    ------
    ValueError
        If the response is not finite, or has no frequencies.
    """
    if not (np.isfinite(response).all() and response.size):
        raise ValueError("system: expected finite frequency response data")
    values = singular_values(response)[0]
    best = int(np.argmax(values))
    return NormBounds(float(values[best]), inf, float(omega[best]), OF_DATA)


def matrices_norm(original: System, response: Response | None = None, bounded: Bounded | None = None) -> NormBounds:
    """Return the H-infinity norm of balanced ``A, B, C, D``; of a loop, the norm of its parts as stored.

    Parameters
    ----------
    original : Lti or ClosedLoop
        System or loop.
    response : function, optional
        A more accurate response than that of the matrices, if they represent a structure.
    bounded : Bounded, optional
        Result of :func:`boomctl.analysis.sum_over_modes.bounds` for the system, if already computed.
    """
    system = original.system
    if min(system.D.shape) == 0 or not len(system.A):
        value = largest_of(system.D)
        return NormBounds(value, value, 0.0, STATIC_GAIN, verified=True, _proved=True, _given=original)
    bounded = sum_over_modes.bounds(original) if bounded is None else bounded
    infinite, hidden = at_boundary(original, bounded)
    if infinite is not None:
        return infinite
    if hidden and len(system.A) <= EXACT_STATES:
        return exact_norm(original, 0.0, 0.0)
    respond, dt = response or partial(system.response, quiet=True), system.dt
    modes, mapped = continuous_image_of_modes(partial_fractions(system), dt)
    error = bounded.error + mapped
    at_image = respond if dt == 0.0 else lambda v: respond(omega_of_image(v, dt))
    peak, at, in_modes = _highest(system, at_image, error, modes, response is not None)
    omega = at if dt == 0.0 else float(omega_of_image(at, dt))
    if peak == 0.0 or not isfinite(peak):  # Infinite by overflow.
        none = NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, verified=True, _proved=not hidden, _given=original)
        return none if peak == 0.0 else NormBounds(0.0, inf, omega, UNDECIDED, _given=original)
    if in_modes and response is None and error <= ALIKE * peak:
        rounding = error
    else:
        points = [] if bounded.error <= _ROUNDING_LIMIT * peak else least_damped(system.rates)
        rounding = rounding_of(original, [omega if isfinite(omega) else 0.0, *points])
    lower = max(peak - rounding, 0.0)
    if in_modes:
        upper = peak * (1.0 + LEVEL) + 2.0 * error  # Of the system, and of the sum over its modes.
        return NormBounds(lower, upper, omega, IN_MODES, verified=True, _proved=True, _given=original)
    if not hidden and rounding <= LEVEL * peak and peak >= UNDERFLOW:
        try:
            result = level_norm(continuous_image(system), at_image, (peak, at))
        except ValueError:  # A pole next to z = -1.
            result = NormBounds(peak, inf, at, UNDECIDED)
        if result.verified:
            lower = max(result.lower_bound - rounding, 0.0)
            upper = result.upper_bound + (rounding if response is not None else 0.0)
            omega = float(omega_of_image(result.peak_omega, dt))
            return replace(result, lower_bound=lower, upper_bound=upper, peak_omega=omega, _given=original)
    if response is not None:  # Matrices that represent a structure have other rounding errors than the structure.
        return NormBounds(lower, inf, omega, LOST, _given=original)
    return exact_norm(original, lower, omega)


def _highest(
    system: Lti, respond: Response, error: float, modes: ModalSystem, direct: bool
) -> tuple[float, float, bool]:
    """Return the largest singular value found, its frequency, and whether the sum over the modes stays just below it.

    Usually it is that of the mode that is highest alone: if this is proved, no further search is made.  ``error`` bounds the
    error of the sum.  If it is small, the sum itself is the response, except with ``direct``.
    """

    def stays_below(peak: float, at: float) -> bool:
        is_accurate = error <= _ROUNDING_LIMIT * peak < inf and peak >= UNDERFLOW and isfinite(at)
        return is_accurate and sum_over_modes.stays_below(modes, peak * (1.0 + LEVEL), at)

    top = top_of_a_mode(modes) if error < inf else None
    if top is not None:
        if direct or error > ALIKE * top[0]:
            top = largest_of(respond(np.array([top[1]]))[:, :, 0]), top[1]
        if stays_below(*top):
            return *top, True
    last = largest_of(system.D if system.dt == 0.0 else respond(np.array([inf]))[:, :, 0])
    top = max(largest_gain(modes, respond), (last, inf), key=itemgetter(0))
    return *top, stays_below(*top)


def exact_norm(
    original: System, lower: float, omega: float, minus: Lti | None = None, band: tuple[float, float] | None = None
) -> NormBounds:
    """Compute the norm of a system in exact arithmetic, from an estimate of the peak; not verified if it takes too long.

    With ``minus`` it is the norm of the difference of two systems; with ``band`` [rad/s] the largest singular value there.
    """
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact

    try:
        exact = Exact.of(original, OPERATIONS, minus)
        exact.check_norm()
        if exact.sides[0]:
            raise UndecidedError
        limits = (0.0, inf) if band is None else (exact.square(band[0]), exact.square(band[1]))
        peak, level, square = exact.norm(exact.square(omega), limits)
    except UndecidedError:
        return NormBounds(lower, inf, omega, NOT_PROVED, _given=original)
    return NormBounds(peak, level, exact.omega(square), PROVED, verified=True, _proved=True, _given=original)


def level_norm(
    system: Lti,
    response: Response | None = None,
    peak: tuple[float, float] | None = None,
    *,
    above: float = LEVEL,
    band: tuple[float, float] = (0.0, inf),
) -> NormBounds:
    """Return the norm of a stable system, verified by a level whose Hamiltonian matrix has no imaginary eigenvalue.

    Rounding error of ``A, B, C, D`` is not included; :func:`matrices_norm` adds it.

    Parameters
    ----------
    system : Lti
        System in continuous time.
    response : function, optional
        A more accurate response than that of the matrices.
    peak : (float, float), optional
        Largest known singular value and its frequency; computed by default.
    above : float, optional
        Relative distance of the level above the peak.
    band : (float, float), optional
        Frequency range of the norm [rad/s]; all frequencies by default.  The level may be below the largest singular value of
        ``D``: within the band no singular value equals the level, and at one frequency all are below it.
    """
    respond = response or partial(system.response, quiet=True)
    low, high = band
    if peak is None and band == (0.0, inf):
        found = largest_gain(partial_fractions(system), respond)
        peak = max(found, (largest_of(system.D), inf), key=itemgetter(0))
    elif peak is None:
        grid = resonance_grid(system.poles, max(low, _BAND_START * high), high, points=SEARCHED, also=[low, high])
        peak = highest_peak(lambda omega: singular_values(respond(omega))[0], grid)
    value, at = peak
    if value == 0.0:
        return NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, verified=True)
    if not isfinite(value):
        return NormBounds(0.0, inf, at, UNDECIDED)
    for _ in range(RAISED):
        level = value * (1.0 + above)
        try:
            crossings, near = near_axis(hamiltonian_matrix(system, level))
        except np.linalg.LinAlgError:  # The level equals a singular value of D to rounding error.
            break
        crossings, near = (x.imag[(x.imag >= low) & (x.imag <= high)] for x in (crossings, near))
        higher, omega = _highest_at(respond, np.concatenate([crossings, near]), band)
        if not isfinite(higher) or (higher <= level and len(crossings)):
            break
        if higher <= level:
            return NormBounds(value, level, at, NO_CROSSING, verified=True)
        value, at = higher, omega
    return NormBounds(value, inf, at, UNDECIDED)


def _movable(system: Lti, times: float) -> Array:
    """Return a mask of poles that ``times`` the rounding error of ``A`` may move across the stability boundary.

    First by perturbation of the eigenvectors to first order.  Of the remaining poles, no change ``|E| <= e |A|`` moves one
    across if ``e |s - A|^-1 |A|`` has a spectral radius below one at the nearest point of the boundary.
    """
    inside, moved = system.distances
    movable = ~(inside > times * moved)
    if not movable.any() or (inside <= 0.0).any():
        return movable
    poles = system.eigensystem[0][movable]
    nearest = 1j * poles.imag if system.dt == 0.0 else np.exp(1j * np.angle(poles))
    try:
        resolvents = np.abs(np.linalg.inv(nearest[:, None, None] * np.eye(len(system.A)) - system.A))
        reach = np.abs(np.linalg.eigvals(times * CANCELLED * resolvents @ np.abs(system.A))).max(axis=1)
    except np.linalg.LinAlgError:
        return movable
    movable[movable] = reach >= 1.0
    return movable


def at_boundary(original: System, bounded: Bounded) -> tuple[NormBounds | None, bool]:
    """Return the norm that poles near the stability boundary determine, or None, and a flag for hidden undamped poles.

    Hidden poles are on the boundary and do not contribute to the response.  Up to `EXACT_STATES` states, exact arithmetic
    decides for the matrices as stored; for more states, floating-point arithmetic decides if the distance of the poles from
    the boundary exceeds rounding error.  A pole that is not on the boundary, but that rounding errors of the entries may move
    across, is reported and leaves no upper bound.
    """
    system = original.system
    if bounded.unstable:
        return NormBounds(inf, inf, nan, UNSTABLE, verified=True, _proved=True, _given=original), False
    if bounded.error < inf or not _movable(system, _NEAR).any():
        return None, False
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact

    is_small, side = len(system.A) <= EXACT_STATES, sides(system.poles, system.dt)
    try:
        growing, on_axis, shown = Exact.of(original, OPERATIONS).sides if is_small else _sides_in_floats(system, side)
    except UndecidedError:
        return NormBounds(0.0, inf, 0.0, NOT_PROVED, _given=original), False
    if growing and (side > 0).any():
        return NormBounds(inf, inf, nan, UNSTABLE, verified=True, _proved=is_small, _given=original), False
    if shown and not growing:
        at, method = np.abs(rates_of(np.array(shown), system.dt).imag).min(), ON_CIRCLE if system.dt else UNDAMPED
        return NormBounds(inf, inf, float(at), method, verified=True, _proved=is_small, _given=original), False
    hidden = np.zeros(len(system.A), bool)
    for pole in on_axis:
        hidden[np.where(hidden, inf, np.abs(system.poles - pole)).argmin()] = True
    if not growing and not (_movable(system, 1.0 if is_small else _NEAR) & ~hidden).any():
        return None, bool(on_axis)
    worst = float(np.abs(system.rates[system.rates.real.argmax()]))
    points = np.outer(_NEARBY, np.abs(system.rates[np.isfinite(system.rates)])).ravel()
    pairs = zip(singular_values(system.response(points, quiet=True))[0], points, strict=True)
    peak, at = max((float(x) - rounding_of(original, np.array([w])), float(w)) for x, w in pairs)
    reason = f"a mode at {worst:.6g} rad/s that rounding error does not distinguish from one on the "
    reason += f"{'unit circle' if system.dt else 'imaginary axis'}, where the norm would be infinite"
    return NormBounds(max(peak, 0.0), inf, at, reason, _given=original), False


def _sides_in_floats(system: Lti, side: Array) -> tuple[bool, list[complex], list[complex]]:
    """Return whether poles are unstable beyond rounding error, the undamped poles, and those that contribute."""
    inside, moved = system.distances
    poles, reads, right = system.eigensystem
    acts = (np.abs(reads @ system.B) > SUMMED * (np.abs(reads) @ np.abs(system.B))).any(axis=1)
    read = (np.abs(system.C @ right) > SUMMED * (np.abs(system.C) @ np.abs(right))).any(axis=0)
    undamped = side == 0
    return bool((-inside > _NEAR * moved).any()), poles[undamped].tolist(), poles[undamped & acts & read].tolist()


def _highest_at(respond: Response, omega: Array, band: tuple[float, float]) -> tuple[float, float]:
    """Return the largest singular value at, between and next to frequencies in a band, and its frequency."""
    if not len(omega):
        return 0.0, 0.0
    points = np.sort(omega)
    ends = [max(0.5 * points[0], band[0]), min(2.0 * points[-1], band[1])]
    points = np.concatenate([points, 0.5 * (points[1:] + points[:-1]), ends])
    values = singular_values(respond(points))[0]
    return float(values.max()), float(points[values.argmax()])


def least_damped(rates: Array, band: tuple[float, float] = (0.0, inf)) -> Array:
    """Return the frequencies of the least damped poles within a band, from poles as rates, all [rad/s]."""
    poles = rates[np.isfinite(rates) & (rates.imag >= 0.0)]
    size = np.abs(poles)
    omega = np.where(poles.imag > 0.0, poles.imag, size)[np.argsort(np.abs(poles.real) / np.maximum(size, TINY))]
    return omega[(omega >= band[0]) & (omega <= band[1])][:_LEAST_DAMPED]


def rounding_of(original: System, omega: Array | list[float], error: float = 0.0) -> float:
    """Return a bound on the rounding error of the response at frequencies, of entries and solution; ``inf`` at a pole.

    ``error`` is an additional error of each entry of ``A``.
    """
    return response_and_rounding(original, omega, error)[1]


def response_and_rounding(original: System, omega: Array | list[float], error: float = 0.0) -> tuple[Array, float]:
    """Return the response at frequencies, and the bound of :func:`rounding_of`; the response is NaN from a pole on."""
    system, size, worst = original.system, original.magnitudes, 0.0
    response = np.full((*system.D.shape, len(omega)), np.nan + 0j)
    for k, w in enumerate(omega if len(system.A) and system.D.size else []):
        pencil, point = np.negative(system.A, dtype=complex), system.boundary(w)
        pencil.flat[:: len(pencil) + 1] += point
        factors, swapped, singular = lapack.zgetrf(pencil)
        if singular:
            return response, inf
        acting, reading = (lapack.zgetrs(factors, swapped, X, trans=k)[0] for k, X in enumerate((system.B, system.C.T)))
        with np.errstate(invalid="ignore", over="ignore"):
            response[:, :, k] = system.C @ acting + system.D
            states = np.abs(acting)
            left = np.abs(system.B + system.A @ acting - point * acting)
            change = DIGIT * (size.A @ states + size.B + abs(point) * states) + left + error * states.sum(axis=0)
            off = np.abs(reading).T @ change + DIGIT * (size.C @ states + size.D)
            rounding = float(off.max()) * system.D.size**0.5
        if not isfinite(rounding):
            return response, inf
        worst = max(worst, rounding)
    return response, worst


def hamiltonian_matrix(system: Lti, level: float) -> Array:
    """Return the balanced Hamiltonian matrix of a level."""
    A, n, D = system.A, len(system.A), system.D / level
    B, C = system.B / np.sqrt(level), system.C / np.sqrt(level)
    sizes = blas.dnrm2(B.ravel()), blas.dnrm2(C.ravel())
    # Scale the states only if squares overflow or underflow: otherwise rounding error hides levels of stiff structures.
    if 0.0 < min(sizes) < UNDERFLOW or max(sizes) * UNDERFLOW > 1.0:
        up = 2.0 ** round(0.5 * (log2(sizes[1]) - log2(sizes[0])))
        B, C = up * B, C / up
    fed = np.linalg.solve(np.eye(D.shape[1]) - D.T @ D, np.concatenate([D.T @ C, B.T], axis=1))
    A, C_ = A + B @ fed[:, :n], C + D @ fed[:, :n]
    return balance(blocks([[A, B @ fed[:, n:]], [-C.T @ C_, -A.T]]))[0]


def near_axis(H: Array) -> tuple[Array, Array]:
    """Return the eigenvalues on the imaginary axis, and those near it, both with nonnegative imaginary part.

    If two crossings nearly coincide, rounding moves their eigenvalues off the axis by the square root of the rounding error:
    eigenvalues within this distance are near, one of the two suffices.  An eigenvalue is also near if its distance from the
    axis is at most that from the nearest mirror image of any eigenvalue: eigenvalues off the axis occur in such pairs, so
    that this one may be off it by rounding error.
    """
    scaled, power = scaled_to_one(H)
    values = 2.0**power * np.linalg.eigvals(scaled).astype(complex)
    values = values[values.imag >= 0.0]
    size, off = np.abs(values), np.abs(values.real)
    noise = _ROUNDING * blas.dnrm2(H.ravel()) + SUMMED * size
    close = off <= noise
    alone = off <= np.abs(values[:, None] + values.conj()).min(axis=1)
    met = (values.real <= 0.0) & (off <= 2.0 * np.sqrt(noise * size))  # its mirror image is up to twice as far off
    return values[close], values[~close & (alone | met)]
