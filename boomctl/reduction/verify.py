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
    response_and_rounding,
    rounding_of,
)
from boomctl.analysis.sum_over_modes import stays_below
from boomctl.arrays import Array
from boomctl.exceptions import ReductionError
from boomctl.lti.bilinear import continuous_image, discrete_image, image_of_omega, omega_of_image
from boomctl.lti.frequency import largest_gain, largest_of, singular_values
from boomctl.lti.modal import ModalSystem, diagonalized, partial_fractions, side_of_axis, spectral_parts
from boomctl.lti.rounding import DIGIT, EXACT_STATES, ROOT
from boomctl.lti.system import Lti, parallel

Band = tuple[float, float]

# Relative distance of the checked level above the largest computed error.  Nearly equal eigenvalues of full and reduced
# system prevent closer levels.
_ABOVE = 1e-2
_COARSE = 2.0  # Multiple of the error for a second level if rounding prevents the first.
_SLACK = 1e-3  # Fraction by which an error may exceed its a priori bound, for rounding.
# Fraction of the largest response below which an error may exceed its bound: Hankel singular values are products of factors
# of Gramians, which are accurate to the square root of rounding.
GRAMIANS = float(np.sqrt(DIGIT))


@dataclass(frozen=True)
class SystemParts:
    """A system as a stable part, whose continuous image is reduced, and a retained part.

    Attributes
    ----------
    original : Lti
        The stable part in the coordinates and the time of the system, including its ``D``.
    stable : Lti
        Its image in continuous time, in real modal coordinates if these are accurate.
    modal : ModalSystem or None
        The image in complex modal coordinates.
    retained : Lti
        Unstable, undamped and rigid-body states in the time of the system, without ``D``.
    largest : float
        The largest response of the stable part, or of one of its modes.
    omega : ndarray
        Frequencies of the image at which rounding is evaluated [rad/s]: of the least damped poles, within a range if there
        is one.
    rounding : float
        Bound on the rounding error of the response, by the matrices, the image and the modal coordinates.
    """

    original: Lti
    stable: Lti
    modal: ModalSystem | None
    retained: Lti
    largest: float
    omega: Array
    rounding: float

    @classmethod
    def of(cls, system: Lti, band: Band = (0.0, inf)) -> "SystemParts":
        """Return the balanced parts of a system; ``band`` is a frequency range of its image."""
        system = system.balanced()
        _ = system.eigensystem  # Cached: it separates the parts and provides their modes.
        parts = spectral_parts(system)
        original = parts.rest
        image = continuous_image(original).balanced() if original.dt else original
        if not (len(original.A) and original.D.size):
            return cls(original, image, None, parts.retained, largest_of(original.D), np.zeros(0), 0.0)
        ends = [band[0], band[1] if band[1] < inf else 0.0]
        omega = np.unique(np.append(least_damped(image.poles, band), ends))
        system_omega = omega_of_image(omega, original.dt)
        response, rounding = response_and_rounding(original, system_omega, parts.error_bound)
        largest = max(float(singular_values(response)[0].max()), largest_of(original.D))
        mapped = image.response(omega, quiet=True) if original.dt else response
        rounding += _gap(response, mapped)
        modal = diagonalized(image)
        lost = inf if modal is None else _gap(mapped, modal.response(omega))
        if modal is None or not lost <= ROOT * largest:
            return cls(original, image, None, parts.retained, largest, omega, rounding)
        largest = max(largest, float(modal.sizes.max()))  # Modes that cancel are larger than the response.
        return cls(original, modal.blocks, modal, parts.retained, largest, omega, rounding + lost)


Verified = tuple[float, NormBounds]
"""An a priori bound on the error of a reduction, and the bounds of the verified error."""


def verified(parts: SystemParts, reduced: Lti, bound: float, band: Band | None) -> tuple[Lti, Verified]:
    """Return a reduced stable part in the time of the system, and its verified error.

    Raises
    ------
    ReductionError
        If the error exceeds its bound or could not be verified.
    """
    original, small = parts.original, discrete_image(reduced, parts.original.dt)
    norm = error_norm(parts, reduced, band)
    at_image = np.append(parts.omega, norm.peak_omega if norm.peak_omega < inf else 0.0)
    omega = omega_of_image(at_image, original.dt)
    lost = _gap(small.response(omega, quiet=True), reduced.response(at_image, quiet=True)) if original.dt else 0.0
    rounding = error_bound = parts.rounding + rounding_of(small, omega[-1:]) + lost
    if len(original.A) + len(small.A) <= EXACT_STATES and not (
        norm.verified
        and norm.upper_bound <= norm.lower_bound * (1.0 + 2.0 * _ABOVE)
        and (rounding <= _ABOVE * norm.upper_bound or len(parts.retained.A))
    ):
        ends = None if band is None else tuple(omega_of_image(band, original.dt).tolist())
        exact = exact_norm(original, norm.lower_bound, float(omega[-1]), small, ends)
        if exact.verified:
            norm = replace(exact, peak_omega=float(image_of_omega(exact.peak_omega, original.dt)))
            rounding = parts.rounding if len(parts.retained.A) else 0.0
    if norm.lower_bound > max(bound * (1.0 + _SLACK) + error_bound, GRAMIANS * parts.largest):
        raise ReductionError(
            f"the error, {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, exceeds its bound {bound:.4g}: the Gramians"
            " were not solved accurately"
        )
    if not norm.verified or rounding == inf:
        raise ReductionError(
            f"the error, at least {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, could not be verified"
            f" ({norm.method if rounding < inf else 'rounding of the matrices may change the response without bound'})"
        )
    lower, upper = max(norm.lower_bound - rounding, 0.0), norm.upper_bound + rounding
    norm = replace(norm, lower_bound=lower, upper_bound=upper)
    if band is not None:  # Weighted Gramians may be inaccurate elsewhere.
        omega = omega_of_image(np.append(0.0, least_damped(parts.stable.poles)), original.dt)
        everywhere, elsewhere = error_norm(parts, reduced, None), lost + rounding_of(original, omega)
        if everywhere.lower_bound + elsewhere > bound:
            bound = everywhere.upper_bound + elsewhere
    return small, (max(bound, norm.upper_bound), norm)


def error_norm(parts: SystemParts, reduced: Lti, band: Band | None) -> NormBounds:
    """Return the norm of the difference of a stable system and a reduced one, over a range if there is one."""
    gap = parallel(parts.stable, reduced, -1).balanced()
    if not (len(gap.A) and gap.D.size):
        value = largest_of(gap.D)
        return NormBounds(value, value, 0.0, STATIC_GAIN, verified=True)
    if (side_of_axis(reduced.poles) >= 0).any():
        return NormBounds(inf, inf, float("nan"), UNSTABLE, verified=True)
    full = parts.stable if parts.modal is None else parts.modal

    def respond(omega: Array) -> Array:
        return full.response(omega) - reduced.response(omega, quiet=True)

    peak_point, limits = None, (0.0, inf) if band is None else band
    if band is None and parts.modal is not None:
        modes, own = parts.modal, partial_fractions(reduced)
        both = ModalSystem(
            np.append(modes.poles, own.poles), np.vstack([modes.B, own.B]), np.hstack([modes.C, -own.C]), gap.D
        )
        peak_point = peak, at = max(largest_gain(both, respond), (largest_of(gap.D), inf))
        level = peak * (1.0 + _ABOVE)
        if 0.0 < peak < inf and at < inf and stays_below(both, level, at, sizes_of_difference(modes, own)):
            return NormBounds(peak, level, at, IN_MODES, verified=True)
    result = level_norm(gap, respond, peak_point, above=_ABOVE, band=limits)
    if result.verified:
        return result
    coarse = max(_COARSE * result.lower_bound, GRAMIANS * parts.largest)  # Errors below are rounding.
    looser = level_norm(gap, respond, (coarse, result.peak_omega), above=_ABOVE, band=limits)
    return replace(looser, lower_bound=result.lower_bound)


def sizes_of_difference(full: ModalSystem, reduced: ModalSystem) -> Array:
    """Return bounds ``c`` of the modes of a difference: their second derivatives are at most ``2 c/d^3`` at a distance ``d``.

    For a mode ``R/(s - p)`` less its equivalent ``R'/(s - p')`` in the reduced system, ``c`` is at most
    ``|R - R'| + 3 |R'| |p - p'|/d``.
    """
    partners, own = np.unique(np.abs(reduced.poles[:, None] - full.poles).argmin(axis=1), return_index=True)
    residues, other = full.terms[partners], reduced.terms[own]
    nearest = np.minimum(-full.poles.real[partners], -reduced.poles.real[own])
    moved = np.abs(full.poles[partners] - reduced.poles[own]) / nearest
    pair = np.linalg.norm(residues - other, axis=1) + 3.0 * np.linalg.norm(other, axis=1) * moved
    sizes = [np.linalg.norm(modes.terms, axis=1) for modes in (full, reduced)]
    better = pair < sizes[0][partners] + sizes[1][own]
    for size, k in zip(sizes, (partners, own), strict=True):
        size[k[better]] = pair[better]
    return np.concatenate(sizes)


def _gap(one: Array, other: Array) -> float:
    """Return a bound on the largest singular value of the difference of responses; ``inf`` if it is not finite."""
    off = np.linalg.norm(one - other, axis=(0, 1)).max()
    return float(off) if off < inf else inf
