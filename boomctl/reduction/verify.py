"""Verified errors: a level that the difference of two systems reaches at no frequency, or none within a band."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import (
    NO_CROSSING,
    NO_RESPONSE,
    NOT_TOLD,
    PROVED,
    STATIC_GAIN,
    UNSTABLE,
    NormBounds,
    hamiltonian_matrix,
    level_norm,
    level_shows,
    near_axis,
    proved_norm,
    stays_below,
)
from boomctl.arrays import Array
from boomctl.exceptions import ReductionError
from boomctl.lti.frequency import (
    RAISED,
    SEARCHED,
    Response,
    highest_peak,
    largest_of,
    resonance_grid,
    singular_values,
    triangular,
)
from boomctl.lti.modal import ModalSystem, resolved, side_of_axis
from boomctl.lti.rounding import ALIKE, CANCELLED, DIGIT, LEVEL, TINY
from boomctl.lti.system import Lti
from boomctl.lti.verified_modal_form import in_verified_modal_form
from boomctl.reduction.core import SystemCore

Band = tuple[float, float]

# Times the largest value found at which a level is tried, and times the size below which errors are rounding: where rounding
# hides the nearer levels, the error is stated so much more coarsely, or not at all (choices)
_ABOVE = (1.0 + LEVEL, 1.001, 1.1, 2.0)
_ABOVE_ROUNDING = (1.0, 10.0, 100.0, 1000.0)
START = 1e-6  # where the grid of a band from zero begins, relative to its end (a choice)
_LARGE = 100  # states beyond which a Schur form, once made, answers faster than solving (measured: ten times at 480)
SLACK = 1e-3  # share by which an error may exceed its bound, or one found otherwise, for rounding on the way (a choice)
# Of the largest response: an error below that may exceed its bound, since Hankel singular values are products of factors of
# Gramians, which keep the square root of rounding.
GRAMIANS = float(np.sqrt(DIGIT))
_ROUNDING = 1e-2  # relative uncertainty of an error, by rounding or between its bounds, above which a proof is computed


@dataclass(frozen=True)
class Verified:
    """The bound of a reduction and its verified error, both with ``truncation``, what the core leaves out."""

    bound: float
    measured: float
    certificate: NormBounds
    truncation: float


def verified(core: SystemCore, reduced: Lti, bound: float, band: Band | None) -> Verified:
    """Return how a reduced stable part compares with that of the core.

    Raises
    ------
    ReductionError
        Its error exceeds its bound, or could not be verified.
    """
    D, modal = core.stable.D, core.modal
    own_form, own = in_verified_modal_form(reduced)
    first = (0.0, 0.0)  # the largest error at the poles and where it lies: what is far off is told at once
    if modal is not None:
        sharpness = np.abs(modal.poles) / np.abs(modal.poles.real)  # a pole that moves takes its peak along
        largest = float((modal.sizes * np.maximum(1.0, CANCELLED / ALIKE * sharpness)).max(initial=0.0))
    else:
        largest, first = _at_poles(core.stable, reduced, band)
    largest = max(largest_of(D), largest)
    floor, rounding = ALIKE * largest, own + core.tail

    def compare(error: float, omega: float) -> None:
        if error > max((bound + own) * (1.0 + SLACK) + floor, GRAMIANS * largest):
            raise ReductionError(
                f"the error, {error:.4g} at {omega:.4g} rad/s, exceeds its bound {bound:.4g}: the Gramians were not "
                "solved accurately"
            )

    compare(first[0] - core.tail, first[1])

    def error(within: Band | None) -> NormBounds:
        return verified_norm(core.stable, modal, reduced, within, floor, own_form, given=core.given, rounding=rounding)

    result = error(band)
    exact = core.given is not None and result.method == PROVED
    compare(result.lower_bound, result.peak_omega)
    if result.upper_bound == inf:
        raise ReductionError(
            f"the error, at least {result.lower_bound:.4g} at {result.peak_omega:.4g} rad/s, could not be verified "
            f"({result.method})"
        )
    if rounding == inf and not exact:
        raise ReductionError(
            "rounding of the system's matrices may change its response without bound: nothing is verified"
        )
    if (
        band is not None and len(core.stable.A) and D.size
    ):  # the bound has the digits of the Gramians: it may be too low elsewhere
        omega = np.unique(np.abs(core.stable.poles.imag))
        full, small = core.stable if modal is None else modal, reduced if own_form is None else own_form
        if singular_values(full.response(omega) - small.response(omega))[0].max(initial=0.0) > bound:
            bound = error(None).upper_bound
    # a bound knows neither of rounding nor of the distance of the proved level from the largest value
    if not exact:
        return Verified(max(bound, result.upper_bound) + rounding, result.upper_bound + rounding, result, core.tail)
    beyond = 0.0 if band is None else rounding  # outside of the band nothing was proved
    return Verified(max(bound + beyond, result.upper_bound), result.upper_bound, result, 0.0)


def _at_poles(system: Lti, reduced: Lti, band: Band | None) -> tuple[float, tuple[float, float]]:
    """Return the largest response at the poles, without modal coordinates; the largest error there in a band, and where."""
    if not len(system.A) or not system.D.size:
        return 0.0, (0.0, 0.0)
    omega = np.unique(np.abs(system.poles))
    G = system.response(omega, quiet=True)
    off = singular_values(G - reduced.response(omega, quiet=True))[0]
    if band is not None:
        off = np.where((band[0] <= omega) & (omega <= band[1]), off, 0.0)
    return float(singular_values(G)[0].max()), (float(off.max()), float(omega[off.argmax()]))


def difference(full: Lti, reduced: Lti) -> Lti:
    """Return ``full - reduced``, states balanced."""
    A = linalg.block_diag(full.A, reduced.A) if len(reduced.A) else full.A
    B, C = np.vstack([full.B, reduced.B]), np.hstack([full.C, -reduced.C])
    return Lti(A, B, C, full.D - reduced.D).balanced()


def verified_norm(
    full: Lti,
    modal: ModalSystem | None,
    reduced: Lti,
    band: Band | None = None,
    floor: float = 0.0,
    small: ModalSystem | None = None,
    *,
    given: Lti | None = None,
    rounding: float = 0.0,
) -> NormBounds:
    """Return the norm of the difference of two stable systems, over all frequencies or over a band.

    ``modal`` and ``small`` are the two in modal coordinates, where these keep their digits.

    A level barely above the largest value found is tried first; where rounding hides it, or poles lie too far apart, a proof
    in exact arithmetic, of ``given`` in place of ``full`` where there is one; then higher levels.  The proof of ``given`` is
    also computed where ``rounding`` of ``full`` and ``small`` is not small beside the error.  Errors below ``floor`` are
    rounding.  The upper bound is a level proven not to be reached; ``inf`` where none could be proven.
    """
    gap = difference(full, reduced if small is None else small.blocks)
    whole = modal if modal is not None else triangular(full) if len(full.A) > _LARGE else full

    def respond(omega: Array) -> Array:
        first = whole.response(omega)
        return first - (reduced.response(omega) if small is None else small.response(omega))

    if (side_of_axis(gap.poles) >= 0).any():
        return NormBounds(inf, inf, float("nan"), UNSTABLE)
    if not (len(gap.A) and gap.D.size):
        value = float(np.linalg.norm(gap.D, 2)) if gap.D.size else 0.0
        return NormBounds(value, value, 0.0, STATIC_GAIN)
    result = level_norm(gap, respond) if band is None else band_norm(gap, respond, band, floor)
    # matrices do not show what is slower than rounding of the fastest pole
    seen = band is not None or bool(resolved(gap.poles).all())
    near = result.upper_bound <= result.lower_bound * (1.0 + _ROUNDING) and (
        given is None or rounding <= _ROUNDING * result.lower_bound
    )
    if seen and near:
        return result
    minus = None if given is None else reduced
    exact = proved_norm(gap if given is None else given, result.lower_bound, result.peak_omega, minus, band)
    if exact.upper_bound < inf or not seen:
        return exact
    least = float(np.linalg.norm(gap.D, 2))
    for level in _levels(result.lower_bound, floor) if result.upper_bound == inf and band is None else []:
        if level > least and stays_below(gap, level, result.peak_omega, respond):
            result = NormBounds(result.lower_bound, level, result.peak_omega, NO_CROSSING)
            break
    # eigenvalues show a peak above the level unless it is much nearer to it than the level to the largest value
    return replace(
        result, upper_bound=result.upper_bound * min(result.upper_bound / max(result.lower_bound, TINY), _ABOVE[2])
    )


def _levels(peak: float, floor: float) -> list[float]:
    """Return the levels that are tried above the largest value found, in this order: the closest that rounding allows."""
    levels = {max(factor * peak, floor) for factor in _ABOVE} | {factor * floor for factor in _ABOVE_ROUNDING}
    return sorted(level for level in levels if level > peak)


def band_norm(gap: Lti, respond: Response, band: Band, floor: float = 0.0) -> NormBounds:
    """Return the largest singular value within a band: attained, and not crossed by any Hamiltonian eigenvalue there.

    The level may lie below the largest singular value of ``D``: within the band none equals it, and at one frequency
    all are below.  Levels below ``floor`` are not tried.
    """
    low, high = band
    if (side_of_axis(gap.poles) >= 0).any():
        return NormBounds(inf, inf, float("nan"), UNSTABLE)
    grid = resonance_grid(gap.poles, max(low, START * high), high, points=SEARCHED, also=[low, high])
    peak, at = highest_peak(lambda omega: singular_values(respond(omega))[0], grid)
    if max(peak, floor) == 0.0:
        return NormBounds(0.0, 0.0, at, NO_RESPONSE)
    for _ in range(RAISED):
        for level in _levels(peak, floor):
            try:
                H = hamiltonian_matrix(gap, level)
            except np.linalg.LinAlgError:  # a singular value of D to the last digit, of which the matrix is not defined
                continue
            near = (result.imag for result in near_axis(H[0]))
            crossings, beside = (result[(result > low) & (result < high)] for result in near)
            seen = np.sort(np.concatenate([[low], crossings, beside, [high]]))
            tried = np.concatenate([seen[1:-1], 0.5 * (seen[1:] + seen[:-1])])
            values = singular_values(respond(tried))[0]
            if values.max() > level:
                peak, at = float(values.max()), float(tried[int(np.argmax(values))])
                break
            if not len(crossings) and level_shows(gap, level, peak, at, H):
                return NormBounds(peak, level, at, f"{NO_CROSSING} in the band")
        else:
            break
    return NormBounds(peak, inf, at, NOT_TOLD)
