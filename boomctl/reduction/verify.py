"""Split a system into the part that is reduced and the rest, and verify the error of a reduction by a level above it."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from boomctl.analysis.norm import (
    IN_MODES,
    STATIC_GAIN,
    UNSTABLE,
    NormBounds,
    exact_norm,
    least_damped,
    level_norm,
    rounding_of,
)
from boomctl.analysis.sum_over_modes import stays_below
from boomctl.arrays import Array
from boomctl.exceptions import ReductionError
from boomctl.lti.bilinear import continuous_image, discrete_image, image_of_omega, omega_of_image
from boomctl.lti.frequency import largest_gain, largest_of, singular_values
from boomctl.lti.modal import ModalSystem, diagonalized, partial_fractions, side_of_axis, spectral_parts
from boomctl.lti.rounding import DIGIT, EXACT_STATES
from boomctl.lti.system import Lti, parallel

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


@dataclass(frozen=True)
class SystemParts:
    """A system as a stable part, of which that in continuous time is reduced, and a part that is kept.

    Attributes
    ----------
    given : Lti
        The stable part in the coordinates and the time given; ``D`` of the system included.
    stable : Lti
        Its image in continuous time, in real modal coordinates where these keep its digits.
    modal : ModalSystem or None
        The same in complex modal coordinates.
    kept : Lti
        Unstable, undamped and rigid-body states in the time given, without ``D``.
    largest : float
        The largest response of the stable part, or of one of its modes.
    seen : ndarray
        Frequencies of the image at which rounding is looked at [rad/s]: of the least damped poles, within a band if there is
        one.
    rounding : float
        How much of its response may be rounding of its matrices, of its image and of modal coordinates included.
    """

    given: Lti
    stable: Lti
    modal: ModalSystem | None
    kept: Lti
    largest: float
    seen: Array
    rounding: float

    @classmethod
    def of(cls, system: Lti, band: Band = (0.0, inf)) -> "SystemParts":
        """Return the parts of a system, balanced; the band that is looked at is one of its image."""
        system = system.balanced()
        _ = system.eigensystem  # Whose eigenvalues tell the parts apart, and whose vectors are their modes.
        parts = spectral_parts(system)
        given = parts.rest
        image = continuous_image(given).balanced() if given.dt else given
        if not (len(given.A) and given.D.size):
            return cls(given, image, None, parts.retained, largest_of(given.D), np.zeros(0), 0.0)
        seen = _looked_at(image, band)
        omega = omega_of_image(seen, given.dt)
        response = given.response(omega, quiet=True)
        largest = max(float(singular_values(response)[0].max()), largest_of(given.D))
        mapped = image.response(seen, quiet=True) if given.dt else response
        rounding = rounding_of(given, omega, parts.error_bound) + _apart(response, mapped)
        modal = diagonalized(image)
        lost = inf if modal is None else _apart(mapped, modal.response(seen))
        if modal is None or not lost <= _LOST * largest:
            return cls(given, image, None, parts.retained, largest, seen, rounding)
        largest = max(largest, float(modal.sizes.max()))  # Modes that cancel are larger than the response.
        return cls(given, modal.blocks, modal, parts.retained, largest, seen, rounding + lost)


Verified = tuple[float, NormBounds]
"""A bound of the error of a reduction known beforehand, and the verified one."""


def verified(parts: SystemParts, reduced: Lti, bound: float, band: Band | None) -> tuple[Lti, Verified]:
    """Return a reduced stable part in the time of the system, and how it compares with the full one.

    Raises
    ------
    ReductionError
        The error exceeds its bound, or could not be verified.
    """
    given, small = parts.given, discrete_image(reduced, parts.given.dt)
    norm = error_norm(parts, reduced, band)
    seen = np.append(parts.seen, norm.peak_omega if norm.peak_omega < inf else 0.0)
    omega = omega_of_image(seen, given.dt)
    lost = _apart(small.response(omega, quiet=True), reduced.response(seen, quiet=True)) if given.dt else 0.0
    rounding = doubt = parts.rounding + rounding_of(small, omega[-1:]) + lost
    if len(given.A) + len(small.A) <= EXACT_STATES and not (
        norm.verified
        and norm.upper_bound <= norm.lower_bound * (1.0 + 2.0 * _ABOVE)
        and (rounding <= _ABOVE * norm.upper_bound or len(parts.kept.A))
    ):
        ends = None if band is None else tuple(omega_of_image(band, given.dt).tolist())
        exact = exact_norm(given, norm.lower_bound, float(omega[-1]), small, ends)
        if exact.verified:
            norm = replace(exact, peak_omega=float(image_of_omega(exact.peak_omega, given.dt)))
            rounding = parts.rounding if len(parts.kept.A) else 0.0
    if norm.lower_bound > max(bound * (1.0 + _SLACK) + doubt, GRAMIANS * parts.largest):
        raise ReductionError(
            f"the error, {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, exceeds its bound {bound:.4g}: the Gramians"
            " were not solved accurately"
        )
    if not norm.verified or rounding == inf:
        raise ReductionError(
            f"the error, at least {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, could not be verified"
            f" ({norm.method if rounding < inf else 'rounding of the matrices may change the response without bound'})"
        )
    norm = replace(norm, upper_bound=norm.upper_bound + rounding)
    if band is not None:  # Weighted Gramians may have lost digits elsewhere.
        omega = omega_of_image(_looked_at(parts.stable), given.dt)
        everywhere, elsewhere = error_norm(parts, reduced, None), lost + rounding_of(given, omega)
        if everywhere.lower_bound + elsewhere > bound:
            bound = everywhere.upper_bound + elsewhere
    return small, (max(bound, norm.upper_bound), norm)


def error_norm(parts: SystemParts, reduced: Lti, band: Band | None) -> NormBounds:
    """Return the norm of the difference of a stable system and a reduced one, over a band if there is one."""
    gap = parallel(parts.stable, reduced, -1).balanced()
    if not (len(gap.A) and gap.D.size):
        value = largest_of(gap.D)
        return NormBounds(value, value, 0.0, STATIC_GAIN, verified=True)
    if (side_of_axis(reduced.poles) >= 0).any():
        return NormBounds(inf, inf, float("nan"), UNSTABLE, verified=True)
    full = parts.stable if parts.modal is None else parts.modal

    def respond(omega: Array) -> Array:
        return full.response(omega) - reduced.response(omega, quiet=True)

    found, limits = None, (0.0, inf) if band is None else band
    if band is None and parts.modal is not None:
        modes, own = parts.modal, partial_fractions(reduced)
        both = ModalSystem(
            np.append(modes.poles, own.poles), np.vstack([modes.B, own.B]), np.hstack([modes.C, -own.C]), gap.D
        )
        found = peak, at = max(largest_gain(both, respond), (largest_of(gap.D), inf))
        level = peak * (1.0 + _ABOVE)
        if 0.0 < peak < inf and at < inf and stays_below(both, level, at):
            return NormBounds(peak, level, at, IN_MODES, verified=True)
    result = level_norm(gap, respond, found, above=_ABOVE, band=limits)
    if result.verified:
        return result
    coarse = max(_COARSE * result.lower_bound, GRAMIANS * parts.largest)  # Errors below are rounding.
    looser = level_norm(gap, respond, (coarse, result.peak_omega), above=_ABOVE, band=limits)
    return replace(looser, lower_bound=result.lower_bound)


def _looked_at(system: Lti, band: Band = (0.0, inf)) -> Array:
    """Return the frequencies of the least damped poles in a band, and its ends [rad/s]; zero for an infinite one."""
    return np.unique(np.append(least_damped(system.poles, band), [band[0], band[1] if band[1] < inf else 0.0]))


def _apart(one: Array, other: Array) -> float:
    """Return a bound of the largest singular value of the difference of responses; ``inf`` where it is no number."""
    off = np.linalg.norm(one - other, axis=(0, 1)).max()
    return float(off) if off < inf else inf
