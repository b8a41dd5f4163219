"""Verified errors: a level that the difference of two systems reaches at no frequency, or none within a band."""

from math import inf

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormCertificate, axis_eigenvalues, level_crossings, matrices_norm
from boomctl.arrays import Array
from boomctl.lti.frequency import singular_values
from boomctl.lti.modal import ModalSystem, diagonalized
from boomctl.lti.system import Lti

_LEVELS = (1.0 + 1e-6, 1.0 + 1e-5, 1.0001, 1.001, 1.01, 1.1, 2.0)
_POINTS = 200
_ROUNDS = 20
_PEAKS, _ZOOMS, _FINE = 3, 6, 11


def difference(full: Lti, reduced: Lti) -> Lti:
    """Return ``full - reduced``, states balanced."""
    A = linalg.block_diag(full.A, reduced.A) if len(reduced.A) else full.A
    B, C = np.vstack([full.B, reduced.B]), np.hstack([full.C, -reduced.C])
    if not len(A):
        return Lti(A, B, C, full.D - reduced.D)
    balanced, (scale, _) = linalg.matrix_balance(A, permute=False, separate=True)
    return Lti(balanced, B / scale[:, None], C * scale[None, :], full.D - reduced.D)


def verified_norm(
    full: Lti,
    modal: ModalSystem | None,
    reduced: Lti,
    band: tuple[float, float] | None = None,
    floor: float = 0.0,
) -> NormCertificate:
    """Return the norm of the difference of two stable systems, over all frequencies or over a band.

    A level barely above the largest value found is tried first; where rounding hides it, higher ones, up to twice
    that value, or up to ``floor``, below which errors are rounding.  The upper bound is a level proven not to be
    reached; ``inf`` where none could be proven.
    """
    gap = difference(full, reduced)
    small = None if modal is None else diagonalized(reduced)  # nearly equal poles lose digits in modal coordinates

    def respond(omega: Array) -> Array:
        first = full.response(omega) if modal is None else modal.response(omega)
        return first - (reduced.response(omega) if small is None else small.response(omega))

    if band is not None:
        return band_norm(gap, respond, band, floor)
    found = matrices_norm(gap, respond)
    if found.upper < inf or found.lower == inf:
        return found
    for level in sorted([*(found.lower * factor for factor in _LEVELS[1:]), floor]):
        if level > found.lower and level > np.linalg.norm(gap.D, 2) and level_crossings(gap, level)[1]:
            return NormCertificate(found.lower, level, found.omega, "no Hamiltonian eigenvalue on the imaginary axis")
    return found


def band_norm(gap: Lti, respond: object, band: tuple[float, float], floor: float = 0.0) -> NormCertificate:
    """Return the largest singular value within a band: attained, and not crossed by any Hamiltonian eigenvalue there.

    The level may lie below the largest singular value of ``D``: within the band none equals it, and at one frequency
    all are below.  Levels below ``floor`` are not tried.
    """
    low, high = band
    poles = linalg.eigvals(gap.A) if len(gap.A) else np.zeros(0)
    if (poles.real >= 0.0).any():
        return NormCertificate(inf, inf, float("nan"), "an unstable pole")
    start = low if low > 0.0 else 1e-6 * high
    near = poles.imag[:, None] + np.abs(poles.real)[:, None] * np.array([-1.0, -0.3, 0.0, 0.3, 1.0])
    grid = np.concatenate([[low, high], np.geomspace(start, high, _POINTS), near.ravel()])
    grid = np.unique(grid[(grid >= low) & (grid <= high)])
    values = singular_values(respond(grid))[0]  # type: ignore[operator]
    peak, at = _zoomed(respond, grid, values)
    for _ in range(_ROUNDS):
        for factor in _LEVELS:
            level = max(peak * factor, floor)
            if level == 0.0:
                return NormCertificate(0.0, 0.0, at, "zero response")
            crossings = axis_eigenvalues(gap, level)
            inside = crossings[(crossings > low) & (crossings < high)]
            if not len(inside):
                return NormCertificate(peak, level, at, "no Hamiltonian eigenvalue on the imaginary axis in the band")
            ends = np.concatenate([[low], inside, [high]])
            tried = np.concatenate([inside, 0.5 * (ends[1:] + ends[:-1])])
            values = singular_values(respond(tried))[0]  # type: ignore[operator]
            if values.max() > level:
                peak, at = float(values.max()), float(tried[int(np.argmax(values))])
                break
        else:
            break
    return NormCertificate(peak, inf, at, "a Hamiltonian eigenvalue too close to the imaginary axis to tell")


def _zoomed(respond: object, grid: Array, values: Array) -> tuple[float, float]:
    """Return the largest value around the highest points of a grid, and where it is, on ever finer grids."""
    peak, at = float(values.max()), float(grid[int(np.argmax(values))])
    for i in np.argsort(values)[::-1][:_PEAKS]:
        low, high = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]
        for _ in range(_ZOOMS):
            fine = np.linspace(low, high, _FINE)
            seen = singular_values(respond(fine))[0]  # type: ignore[operator]
            best = int(np.argmax(seen))
            if seen[best] > peak:
                peak, at = float(seen[best]), float(fine[best])
            low, high = fine[max(best - 1, 0)], fine[min(best + 1, _FINE - 1)]
    return peak, at
