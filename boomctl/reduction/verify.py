"""Split a system into the part that is reduced and the rest, and verify the error of a reduction by a level above it."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import (
    IN_MODES,
    STATIC_GAIN,
    UNSTABLE,
    NormBounds,
    exact_norm,
    least_damped,
    level_norm,
    peak_by_modes,
    rounding_of,
)
from boomctl.arrays import Array
from boomctl.exceptions import ReductionError
from boomctl.lti.bilinear import continuous_image, discrete_image, image_of_omega, omega_of_image
from boomctl.lti.frequency import largest_of, singular_values
from boomctl.lti.modal import ModalSystem, diagonalized, partial_fractions, side_of_axis, spectral_parts
from boomctl.lti.rounding import DIGIT, EXACT_STATES
from boomctl.lti.system import Lti

Band = tuple[float, float]

# Above the largest error found, at which a level is checked: eigenvalues of full and reduced system nearly coincide, and hide
# levels that are closer.
_ABOVE = 1e-2
_COARSE = 2.0  # Times the error, a level that is checked where rounding hides the first.
_SLACK = 1e-3  # Share by which an error may exceed its a priori bound, for rounding on the way.
# Share of the largest response below which an error may exceed its bound: Hankel singular values are products of factors of
# Gramians, which keep the square root of rounding.
GRAMIANS = float(np.sqrt(DIGIT))
_LOST = 1e-7  # Share of the largest response that modal coordinates may lose; otherwise the given ones are taken.
# Times what the bilinear map is seen to change of a response at some frequencies, for what it changes between them.
_BETWEEN = 2.0


@dataclass(frozen=True)
class SystemParts:
    """A continuous system, or the image of a discrete one, as a stable part and a part that is kept.

    Attributes
    ----------
    whole : Lti
        The system itself, balanced.
    given : Lti
        The stable part in the coordinates given; ``D`` of the system included.
    stable : Lti
        The same in real modal coordinates, where these keep its digits.
    modal : ModalSystem or None
        The same in complex modal coordinates.
    kept : Lti
        Unstable, undamped and rigid-body states, without ``D``.
    largest : float
        The largest response of the stable part, or of one of its modes.
    rounding : float
        How much of its response may be rounding of its matrices, of modal coordinates included.
    """

    whole: Lti
    given: Lti
    stable: Lti
    modal: ModalSystem | None
    kept: Lti
    largest: float
    rounding: float

    @classmethod
    def of(cls, system: Lti, band: Band = (0.0, inf)) -> "SystemParts":
        """Return the parts of a system, balanced; in discrete time, of its image, as is the band that is looked at."""
        whole = system.balanced()
        image = continuous_image(whole).balanced()
        _ = image.eigensystem  # Whose eigenvalues tell the parts apart, and whose vectors are their modes.
        parts = spectral_parts(image)
        given = parts.rest
        if not (len(given.A) and given.D.size):
            return cls(whole, given, given, None, parts.kept, largest_of(given.D), 0.0)
        omega = _looked_at(given, band)
        response = given.response(omega, quiet=True)
        largest = max(float(singular_values(response)[0].max()), largest_of(given.D))
        rounding = rounding_of(given, omega, parts.doubt)
        modal, lost = diagonalized(given), inf
        if modal is not None:
            off = response - modal.response(omega)
            lost = float(singular_values(off)[0].max()) if np.isfinite(off).all() else inf
        if modal is None or not lost <= _LOST * largest:
            return cls(whole, given, given, None, parts.kept, largest, rounding)
        largest = max(largest, float(modal.sizes.max()))  # Modes that cancel are larger than the response.
        return cls(whole, given, modal.blocks, modal, parts.kept, largest, rounding + lost)


@dataclass(frozen=True)
class Verified:
    """A bound of the error of a reduction known beforehand, and its verified error."""

    bound: float
    error: float
    certificate: NormBounds


def verified(parts: SystemParts, reduced: Lti, bound: float, band: Band | None) -> Verified:
    """Return how a reduced stable part compares with the full one.

    Raises
    ------
    ReductionError
        The error exceeds its bound, or could not be verified.
    """
    norm = error_norm(parts, reduced, band)
    rounding = parts.rounding + rounding_of(reduced, np.array([norm.peak_omega if norm.peak_omega < inf else 0.0]))
    own = not len(parts.kept.A) and parts.whole.dt == 0.0  # The stable part is the system itself.
    if len(parts.given.A) + len(reduced.A) <= EXACT_STATES and not (
        norm.verified
        and norm.upper_bound <= norm.lower_bound * (1.0 + 2.0 * _ABOVE)
        and (rounding <= _ABOVE * norm.upper_bound or not own)
    ):
        exact = exact_norm(parts.given, norm.lower_bound, norm.peak_omega, reduced, band)
        if exact.verified:
            norm, rounding = exact, 0.0 if own else rounding
    if norm.lower_bound > max(bound * (1.0 + _SLACK) + rounding, GRAMIANS * parts.largest):
        raise ReductionError(
            f"the error, {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, exceeds its bound {bound:.4g}: the Gramians"
            " were not solved accurately"
        )
    if not norm.verified or rounding == inf:
        raise ReductionError(
            f"the error, at least {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, could not be verified"
            f" ({norm.method if rounding < inf else 'rounding of the matrices may change the response without bound'})"
        )
    error = norm.upper_bound + rounding
    if band is not None:  # Weighted Gramians may have lost digits elsewhere.
        everywhere, elsewhere = error_norm(parts, reduced, None), rounding_of(parts.given, _looked_at(parts.given))
        if everywhere.lower_bound + elsewhere > bound:
            bound = everywhere.upper_bound + elsewhere
    return Verified(max(bound, error), error, norm)


def error_norm(parts: SystemParts, reduced: Lti, band: Band | None) -> NormBounds:
    """Return the norm of the difference of a stable system and a reduced one, over a band if there is one."""
    gap = difference(parts.given if parts.modal is None else parts.stable, reduced)
    if not (len(gap.A) and gap.D.size):
        value = largest_of(gap.D)
        return NormBounds(value, value, 0.0, STATIC_GAIN, verified=True)
    if (side_of_axis(reduced.poles) >= 0).any():
        return NormBounds(inf, inf, float("nan"), UNSTABLE, verified=True)
    full: ModalSystem | Lti = parts.given if parts.modal is None else parts.modal

    def respond(omega: Array) -> Array:
        return full.response(omega) - reduced.response(omega, quiet=True)

    peak, limits = None, (0.0, inf) if band is None else band
    if band is None and parts.modal is not None:
        modes, own = parts.modal, partial_fractions(reduced)
        both = ModalSystem(
            np.append(modes.poles, own.poles), np.vstack([modes.B, own.B]), np.hstack([modes.C, -own.C]), gap.D
        )
        value, at, upper = peak_by_modes(both, respond, 0.0, largest_of(gap.D), _ABOVE)
        if 0.0 < upper < inf:
            return NormBounds(value, upper, at, IN_MODES, verified=True)
        peak = value, at
    result = level_norm(gap, respond, peak, above=_ABOVE, band=limits)
    if result.verified:
        return result
    coarse = max(_COARSE * result.lower_bound, GRAMIANS * parts.largest)  # Errors below are rounding.
    looser = level_norm(gap, respond, (coarse, result.peak_omega), above=_ABOVE, band=limits)
    return replace(looser, lower_bound=result.lower_bound)


def on_circle(parts: SystemParts, image: Lti, result: Verified, band: Band | None) -> tuple[Lti, Verified]:
    """Return the discrete system of a reduced image; what the map there and back changes is added to its errors.

    Where that is not little, up to `EXACT_STATES` states of both are compared in exact arithmetic.
    """
    dt = parts.whole.dt
    small = discrete_image(image, dt)
    poles = parts.given.poles[parts.given.poles.imag >= 0.0]
    beside = (poles.imag[:, None] + poles.real[:, None] * np.array([-1.0, 0.0, 1.0])).ravel()
    seen = np.concatenate([beside[beside >= 0.0], np.abs(parts.given.poles), np.abs(parts.kept.poles), [0.0]])
    seen = seen[seen < inf]
    omega = omega_of_image(seen, dt)
    there = parts.whole.response(omega, quiet=True) - small.response(omega, quiet=True)
    before = continuous_image(parts.whole).response(seen, quiet=True) - image.response(seen, quiet=True)
    lost = _BETWEEN * float(singular_values(there - before)[0].max()) if there.size else 0.0
    norm = result.certificate
    clear = result.error - norm.upper_bound + lost <= _ABOVE * norm.upper_bound
    if not clear and not len(parts.kept.A) and len(parts.whole.A) + len(small.A) <= EXACT_STATES:
        ends = None if band is None else (float(omega_of_image(band[0], dt)), float(omega_of_image(band[1], dt)))
        exact = exact_norm(parts.whole, norm.lower_bound, float(omega_of_image(norm.peak_omega, dt)), small, ends)
        if exact.verified:
            exact = replace(exact, peak_omega=float(image_of_omega(exact.peak_omega, dt)))
            return small, Verified(max(result.bound + lost, exact.upper_bound), exact.upper_bound, exact)
    return small, Verified(result.bound + lost, result.error + lost, result.certificate)


def difference(full: Lti, reduced: Lti) -> Lti:
    """Return ``full - reduced``, states balanced."""
    A = linalg.block_diag(full.A, reduced.A) if len(reduced.A) else full.A
    B, C = np.vstack([full.B, reduced.B]), np.hstack([full.C, -reduced.C])
    return Lti(A, B, C, full.D - reduced.D).balanced()


def _looked_at(system: Lti, band: Band = (0.0, inf)) -> Array:
    """Return the frequencies of the least damped poles in a band, and its ends [rad/s]; zero for an infinite one."""
    return np.unique(np.append(least_damped(system.poles, band), [band[0], band[1] if band[1] < inf else 0.0]))
