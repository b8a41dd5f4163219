"""H-infinity norms between two bounds, of which each says how far it was checked.

The largest singular value is found in modal coordinates and computed from the system's own matrices.  What bounds it from
above is one of three, in this order:

1. The sum over the modes stays below a level at all frequencies, rounding of the entries included
   (:mod:`boomctl.analysis.sum_over_modes`): a proof that takes a millisecond.
2. No eigenvalue of the Hamiltonian matrix of a level lies on the imaginary axis (Boyd, Balakrishnan & Kabamba 1989; Bruinsma
   & Steinbuch 1990), in discrete time of the continuous image by the bilinear map: the norm is verified, and proved when
   `NormBounds.certified` is first read.
3. Where rounding of the entries may decide, exact arithmetic (:mod:`boomctl.lti.proof`), up to `EXACT_STATES` states.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from math import inf, isfinite, log2, nan
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
from boomctl.lti.rounding import CANCELLED, CERTIFIED, DIGIT, EPS, EXACT_STATES, LEVEL, SUMMED, TINY
from boomctl.lti.system import ClosedLoop, Lti, System, rates_of
from boomctl.printing import between

if TYPE_CHECKING:
    from boomctl.structure.model import SecondOrderModel

_ROUNDING = 1e2 * EPS  # Share of the norm of the Hamiltonian matrix by which its eigenvalues may be off the axis.
_LEAST_DAMPED = 10  # Poles at which rounding of the response is estimated.
# Times the change that rounding of the entries makes of the poles: nearer to the boundary of stability, exact arithmetic
# decides on which side they lie.
_NEAR = 100.0
# Share of the peak that rounding of the entries may change without exact arithmetic: twice that above it, once below, and the
# level leave bounds that agree to CERTIFIED.
_DOUBT = 0.28 * CERTIFIED
_TWICE = 2.0  # Times what rounding may change of a response: once of the system's own, once of the sum over its modes.
_BESIDE = [0.7, 1.0]  # times its frequency, where the response of a mode that may be undamped is looked at (a choice)
_BAND_START = 1e-6  # Where the grid of a band from zero begins, relative to its end.
_TINY = 1e-150  # Norms below which squares of responses are not numbers of full precision.

NAMES = {"hinf": "H-infinity", "h2": "H2"}  # Of the kinds of norm.
# Methods, in the order tried: one of these is `NormBounds.method`.
STATIC_GAIN = "static gain"  # No states: the norm of D.
UNSTABLE = "an unstable pole"  # Infinite.
UNDAMPED = "a pole on the imaginary axis"  # Infinite, if the pole shows in the response.
ON_CIRCLE = "a pole on the unit circle"  # The same in discrete time.
NO_RESPONSE = "zero response"
IN_MODES = "the sum over the modes stays below at all frequencies"  # Of a level just above the peak.
NO_CROSSING = "no Hamiltonian eigenvalue on the imaginary axis"  # Of such a level: verified.
PROVED = "proved in exact arithmetic, of the numbers as they are stored"
OF_DATA = "largest value on the grid of the data"  # No upper bound.
# No upper bound either:
NOT_TOLD = "an eigenvalue too close to the boundary of stability to tell"
LOST = "rounding of the entries may change the peak by more than a norm is certified to"
NOT_PROVED = "rounding of the entries may change it, and exact arithmetic takes too long"


@dataclass(frozen=True)
class NormBounds:
    """A norm between two bounds.

    Attributes
    ----------
    lower_bound : float
        The norm is at least this: of an H-infinity norm the largest singular value found, at ``peak_omega``, less
        the rounding of its computation.
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
    verified : bool
        Whether an independent numerical method confirms both bounds, or that the norm is infinite.  The bounds of a norm then
        agree to one part in 1e5, those of a reduction error to one in a hundred.
    certified : bool
        Whether both bounds are proved.  A proof may run when this is first read.
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
        """Yield what can be proved."""
        if isinstance(self._given, Lti):
            yield self._claim("the system", self._given)
        elif isinstance(self._given, ClosedLoop):
            yield self._claim("the loop", self._given.plant, self._given.controller)
        elif self._given is not None:
            stands = "the state space that stands for the structure"
            parts = tuple(part._modal_form for part in self._given._halves or (self._given,))
            yield replace(self._claim(stands, parts[0]), beside=parts[1:], rounded=stands)

    def _claim(self, what: str, system: Lti, controller: Lti | None = None) -> Claim:
        """Return the claim that these are bounds of the norm of a system, or of its loop with a controller.

        ``what`` is what messages call it.
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
        """The norm: of an H-infinity norm the lower bound, of an H2 norm a number between the bounds."""
        return self.lower_bound if self._value is None else self._value

    @cached_property
    def certified(self) -> bool:
        """Whether both bounds are proved.  A proof may run when this is first read."""
        if not self.verified or self._proved:
            return self.verified
        from boomctl.analysis.prove import is_proved

        return is_proved(self.__claims__())

    @property
    def status(self) -> str:
        """Whether the norm is "certified", "verified" or "not verified", as far as it is known without a proof."""
        if self.verified and (self._proved or self.__dict__.get("certified", False)):
            return "certified"
        return "verified" if self.verified else "not verified"


def agree(lower: float, upper: float) -> bool:
    """Return whether two bounds agree to what a norm is certified to; so do those of an infinite norm."""
    return lower == inf or upper <= lower * (1.0 + CERTIFIED) + TINY


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


def matrices_norm(given: System, response: Response | None = None, bounded: Bounded | None = None) -> NormBounds:
    """Return the H-infinity norm of ``A, B, C, D``, which are balanced; of a loop, that of its parts as they are stored.

    Parameters
    ----------
    given : Lti or ClosedLoop
    response : function, optional
        A more accurate response than that of the matrices, which stand for a structure.
    bounded : Bounded, optional
        What :func:`boomctl.analysis.sum_over_modes.bounds` says of the system, where it was asked already.
    """
    system = given.system
    if min(system.D.shape) == 0 or not len(system.A):
        value = largest_of(system.D)
        return NormBounds(value, value, 0.0, STATIC_GAIN, verified=True, _proved=True, _given=given)
    bounded = sum_over_modes.bounds(given) if bounded is None else bounded
    infinite, hidden = at_boundary(given, bounded)
    if infinite is not None:
        return infinite
    if hidden and len(system.A) <= EXACT_STATES:
        return exact_norm(given, 0.0, 0.0)
    respond = partial(_response, system) if response is None else response
    dt = system.dt
    modes, mapped = continuous_image_of_modes(partial_fractions(system), dt)

    def at_image(v: Array) -> Array:
        return respond(v if dt == 0.0 else omega_of_image(v, dt))

    last = system.D if dt == 0.0 else respond(np.array([system.nyquist]))[:, :, 0]
    peak, at, upper = peak_by_modes(modes, at_image, bounded.doubt + mapped, largest_of(last))
    omega = at if dt == 0.0 else float(omega_of_image(at, dt))
    if peak == 0.0:
        return NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, verified=True, _proved=not hidden, _given=given)
    if not isfinite(peak):  # Larger than any float.
        return NormBounds(0.0, inf, omega, NOT_TOLD, _given=given)
    seen = np.append(
        omega if isfinite(omega) else 0.0, [] if bounded.doubt <= _DOUBT * peak else least_damped(system.rates)
    )
    rounding = rounding_of(given, seen)
    lower = max(peak - rounding, 0.0)
    if upper < inf and peak >= _TINY:
        return NormBounds(lower, upper, omega, IN_MODES, verified=True, _proved=True, _given=given)
    if not hidden and rounding <= LEVEL * peak and peak >= _TINY:
        try:
            result = level_norm(continuous_image(system), at_image, (peak, at))
        except ValueError:  # A pole next to z = -1.
            result = NormBounds(peak, inf, at, NOT_TOLD)
        if result.verified:
            lower = max(result.lower_bound - rounding, 0.0)
            upper = result.upper_bound + (rounding if response is not None else 0.0)
            omega = float(omega_of_image(result.peak_omega, dt))
            return replace(result, lower_bound=lower, upper_bound=upper, peak_omega=omega, _given=given)
    if response is not None:  # The last digits of matrices that stand for a structure are not those of the structure.
        return NormBounds(lower, inf, omega, LOST, _given=given)
    return exact_norm(given, lower, omega)


def exact_norm(
    given: System, lower: float, omega: float, minus: Lti | None = None, band: tuple[float, float] | None = None
) -> NormBounds:
    """Compute the norm of a system in exact arithmetic, from a guess of the peak; not verified where that takes too long.

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
        return NormBounds(lower, inf, omega, NOT_PROVED, _given=given)
    return NormBounds(peak, level, exact.omega(square), PROVED, verified=True, _proved=True, _given=given)


def level_norm(
    system: Lti,
    response: Response | None = None,
    peak: tuple[float, float] | None = None,
    *,
    above: float = LEVEL,
    band: tuple[float, float] = (0.0, inf),
) -> NormBounds:
    """Return the norm of a stable system verified by a level that no eigenvalue of its Hamiltonian matrix reaches.

    For those who answer for rounding of ``A, B, C, D`` themselves; :func:`matrices_norm` does.

    Parameters
    ----------
    system : Lti
        In continuous time.
    response : function, optional
        A more accurate response than that of the matrices.
    peak : (float, float), optional
        The largest singular value that is known, and its frequency; searched for by default.
    above : float, optional
        How far above the peak the level is, relative.
    band : (float, float), optional
        Frequencies within which the norm is meant [rad/s]; all by default.  The level may lie below the largest singular
        value of ``D``: within the band none equals it, and at one frequency all are below.
    """
    respond = partial(_response, system) if response is None else response
    low, high = band
    if peak is None and band == (0.0, inf):
        peak = peak_by_modes(partial_fractions(system), respond, inf, largest_of(system.D))[:2]
    elif peak is None:
        grid = resonance_grid(system.poles, max(low, _BAND_START * high), high, points=SEARCHED, also=[low, high])
        peak = highest_peak(lambda omega: singular_values(respond(omega))[0], grid)
    value, at = peak
    if value == 0.0:
        return NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, verified=True)
    if not isfinite(value):
        return NormBounds(0.0, inf, at, NOT_TOLD)
    for _ in range(RAISED):
        level = value * (1.0 + above)
        try:
            crossings, near = near_axis(hamiltonian_matrix(system, level))
        except np.linalg.LinAlgError:  # A singular value of D to the last digit.
            break
        crossings, near = (x.imag[(x.imag >= low) & (x.imag <= high)] for x in (crossings, near))
        higher, omega = _highest_at(respond, np.concatenate([crossings, near]), band)
        if not isfinite(higher) or (higher <= level and len(crossings)):
            break
        if higher <= level:
            return NormBounds(value, level, at, NO_CROSSING, verified=True)
        value, at = higher, omega
    return NormBounds(value, inf, at, NOT_TOLD)


def peak_by_modes(
    modes: ModalSystem, respond: Response, doubt: float, last: float, above: float = LEVEL
) -> tuple[float, float, float]:
    """Return the largest singular value near the modes, its frequency, and a bound that the sum over the modes proves.

    ``last`` is that at infinite frequency.  The sum, and the response itself where entries are off in their last places, are
    off by ``doubt`` at most; the bound is infinite where the sum proves none.  Nearly always the mode that is highest alone
    is at the peak: where the proof says so, no other is searched for.  The bound is ``above`` the peak, relative.
    """

    def bounded(peak: float, at: float) -> tuple[float, float, float]:
        level = peak * (1.0 + above)
        told = doubt <= _DOUBT * peak < inf and isfinite(at) and sum_over_modes.stays_below(modes, level, at)
        return peak, at, level + _TWICE * doubt if told else inf

    top = top_of_a_mode(modes) if doubt < inf else None
    if top is not None:
        result = bounded(float(singular_values(respond(np.array([top[1]])))[0, 0]), top[1])
        if result[2] < inf:
            return result
    peak, at = largest_gain(modes, respond)
    return bounded(peak, at) if peak >= last else (last, inf, inf)


def _movable(system: Lti, times: float) -> Array:
    """Return which poles rounding of the entries of ``A``, so many times, may move across the boundary of stability.

    To first order, by the eigenvectors; of those, no change of ``|E| <= e |A|`` moves one across where ``e |s - A|^-1 |A|``
    has a spectral radius below one there.
    """
    inside, moved = system.distances
    movable = ~(inside > times * moved)
    if not movable.any() or (inside <= 0.0).any():
        return movable
    poles = system.eigensystem[0][movable]
    beside = 1j * poles.imag if system.dt == 0.0 else np.exp(1j * np.angle(poles))
    try:
        resolvents = np.abs(np.linalg.inv(beside[:, None, None] * np.eye(len(system.A)) - system.A))
        reach = np.abs(np.linalg.eigvals(times * CANCELLED * resolvents @ np.abs(system.A))).max(axis=1)
    except np.linalg.LinAlgError:
        return movable
    movable[movable] = reach >= 1.0
    return movable


def at_boundary(given: System, bounded: Bounded) -> tuple[NormBounds | None, bool]:
    """Return what poles near the boundary of stability make of a norm, None if they decay, and whether some do not show.

    Exact arithmetic decides of up to `EXACT_STATES` states, of the numbers as they are stored, and floats of more, where
    poles are clear of what rounding may move.  A pole that is not found on the boundary, and that rounding of the entries
    may move across, is reported and leaves no upper bound.
    """
    system = given.system
    if bounded.unstable:
        return NormBounds(inf, inf, nan, UNSTABLE, verified=True, _proved=True, _given=given), False
    if bounded.doubt < inf or not _movable(system, _NEAR).any():
        return None, False
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact

    is_small, side = len(system.A) <= EXACT_STATES, sides(system.poles, system.dt)
    try:
        growing, on_axis, shown = Exact.of(given, OPERATIONS).sides if is_small else _sides_in_floats(system, side)
    except UndecidedError:
        return NormBounds(0.0, inf, 0.0, NOT_PROVED, _given=given), False
    if growing and (side > 0).any():
        return NormBounds(inf, inf, nan, UNSTABLE, verified=True, _proved=is_small, _given=given), False
    if shown and not growing:
        at, method = np.abs(rates_of(np.array(shown), system.dt).imag).min(), ON_CIRCLE if system.dt else UNDAMPED
        return NormBounds(inf, inf, float(at), method, verified=True, _proved=is_small, _given=given), False
    hidden = np.zeros(len(system.A), bool)
    for pole in on_axis:
        hidden[np.where(hidden, inf, np.abs(system.poles - pole)).argmin()] = True
    if not growing and not (_movable(system, 1.0 if is_small else _NEAR) & ~hidden).any():
        return None, bool(on_axis)
    worst = float(np.abs(system.rates[system.rates.real.argmax()]))
    seen = np.outer(_BESIDE, np.abs(system.rates[np.isfinite(system.rates)])).ravel()
    values = singular_values(system.response(seen, quiet=True))[0]
    peak, at = max((float(x) - rounding_of(given, np.array([w])), float(w)) for x, w in zip(values, seen, strict=True))
    said = f"a mode at {worst:.6g} rad/s that the digits given do not tell from one on the "
    said += f"{'unit circle' if system.dt else 'imaginary axis'}, where the norm would be infinite"
    return NormBounds(max(peak, 0.0), inf, at, said, _given=given), False


def _sides_in_floats(system: Lti, side: Array) -> tuple[bool, list[complex], list[complex]]:
    """Return whether poles are unstable by more than rounding may move them, the undamped ones, and those that show."""
    inside, moved = system.distances
    poles, reads, right = system.eigensystem
    acts = (np.abs(reads @ system.B) > SUMMED * (np.abs(reads) @ np.abs(system.B))).any(axis=1)
    read = (np.abs(system.C @ right) > SUMMED * (np.abs(system.C) @ np.abs(right))).any(axis=0)
    undamped = side == 0
    return bool((-inside > _NEAR * moved).any()), poles[undamped].tolist(), poles[undamped & acts & read].tolist()


def _highest_at(respond: Response, omega: Array, band: tuple[float, float]) -> tuple[float, float]:
    """Return the largest singular value at frequencies, between and on both sides of them in a band, and where."""
    if not len(omega):
        return 0.0, 0.0
    seen = np.sort(omega)
    ends = [max(0.5 * seen[0], band[0]), min(2.0 * seen[-1], band[1])]
    seen = np.concatenate([seen, 0.5 * (seen[1:] + seen[:-1]), ends])
    values = singular_values(respond(seen))[0]
    return float(values.max()), float(seen[values.argmax()])


def least_damped(rates: Array, band: tuple[float, float] = (0.0, inf)) -> Array:
    """Return the frequencies of the poles of least damping, of poles as rates, within a band, all [rad/s]."""
    poles = rates[np.isfinite(rates) & (rates.imag >= 0.0)]
    size = np.abs(poles)
    omega = np.where(poles.imag > 0.0, poles.imag, size)[np.argsort(np.abs(poles.real) / np.maximum(size, TINY))]
    return omega[(omega >= band[0]) & (omega <= band[1])][:_LEAST_DAMPED]


def rounding_of(given: System, omega: Array, doubt: float = 0.0) -> float:
    """Return how much of the response at frequencies may be rounding, of the entries and of solving; ``inf`` at a pole.

    ``doubt`` is an error of each entry of ``A`` beside that.
    """
    system, size, worst = given.system, given.magnitudes, 0.0
    for w in omega if len(system.A) and system.D.size else []:
        solved = _solved(system, w)
        if solved is None:
            return inf
        acting, reading = solved
        with np.errstate(invalid="ignore", over="ignore"):
            states, point = np.abs(acting), system.boundary(w)
            left = np.abs(system.B + system.A @ acting - point * acting)
            change = DIGIT * (size.A @ states + size.B + abs(point) * states) + left + doubt * states.sum(axis=0)
            off = np.abs(reading).T @ change + DIGIT * (size.C @ states + size.D)
            rounding = float(off.max()) * system.D.size**0.5
        if not isfinite(rounding):
            return inf
        worst = max(worst, rounding)
    return worst


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


def hamiltonian_matrix(system: Lti, level: float) -> Array:
    """Return the balanced Hamiltonian matrix of a level."""
    A, n, D = system.A, len(system.A), system.D / level
    B, C = system.B / np.sqrt(level), system.C / np.sqrt(level)
    sizes = blas.dnrm2(B.ravel()), blas.dnrm2(C.ravel())
    # where squares are numbers states stay as they are: others hide levels of stiff structures in rounding (measured)
    if 0.0 < min(sizes) < _TINY or max(sizes) * _TINY > 1.0:
        up = 2.0 ** round(0.5 * (log2(sizes[1]) - log2(sizes[0])))
        B, C = up * B, C / up
    fed = np.linalg.solve(np.eye(D.shape[1]) - D.T @ D, np.concatenate([D.T @ C, B.T], axis=1))
    A, C_ = A + B @ fed[:, :n], C + D @ fed[:, :n]
    return balance(blocks([[A, B @ fed[:, n:]], [-C.T @ C_, -A.T]]))[0]


def near_axis(H: Array) -> tuple[Array, Array]:
    """Return the eigenvalues, not below the real axis, on the imaginary axis, and those that lie so near to it.

    Where two crossings have nearly met, rounding moves their eigenvalues off the axis by its root: what lies so near is
    worth a look, once for the two.  So is an eigenvalue that lies no farther from the axis than from the nearest mirror
    image of another: eigenvalues off the axis come in such pairs, and this one may be off it by rounding.
    """
    scaled, power = scaled_to_one(H)
    values = 2.0**power * np.linalg.eigvals(scaled).astype(complex)
    values = values[values.imag >= 0.0]
    size, off = np.abs(values), np.abs(values.real)
    noise = _ROUNDING * blas.dnrm2(H.ravel()) + SUMMED * size
    close = off <= noise
    alone = off <= np.abs(values[:, None] + values.conj()).min(axis=1)
    met = (values.real <= 0.0) & (off <= 2.0 * np.sqrt(noise * size))  # its mirror image lies up to twice as far off
    return values[close], values[~close & (alone | met)]
