"""Eigenvalues of structures with exact beams: undamped ones by counting, damped ones by Newton's method."""

from collections.abc import Sequence

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, DIGIT, ROOT, warn_of_rounding
from boomctl.structure.beams.exact import ExactModel
from boomctl.structure.displacement_input import prescribe_displacement
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import damped_poles

_SECTIONS = 24  # Intervals per decade of the first search, which separates all roots at once.
_AROUND = 1e-3  # Distance from the secant's root that is evaluated on both sides, as a fraction of the bracket.
_SLOWEST = 1e-30  # Lowest frequency, relative to the longest segment; below, double precision does not suffice.
_CONVERGED = 1e-11  # Last step relative to the eigenvalue; quadratic convergence leaves only rounding error.
_START = 1e-3  # Relative error of a start up to which Newton's method converges to the nearest eigenvalue.
_NEWTON_STEPS = 30  # Limit on the Newton steps; from starts accurate to 1e-3 about five suffice.


def undamped_frequencies(model: ExactModel, count: int) -> Array:
    """Return the ``count`` lowest undamped natural frequencies above zero [rad/s], without omission.

    Brackets are defined by the number of natural frequencies below their ends (Wittrick & Williams 1971), for all frequencies
    at once.  Where the eigenvalue that changes its sign is smooth, a secant step converges faster than bisection.
    """
    low, high, rigid = _bracket(model, count)
    wanted = rigid + np.arange(count)
    grid = np.geomspace(low, high, 2 + int(_SECTIONS * np.log10(high / low)))
    after = np.clip(np.searchsorted(model.count_below(grid), wanted, side="right"), 1, len(grid) - 1)
    a, b = grid[after - 1], grid[after]
    at_a, at_b = _deciding(model, np.array([a, b]), wanted)
    slope = np.zeros(count)
    # each round halves the brackets at least: 56 rounds without secants, six with them
    while (b - a > DIGIT * b).any():
        width = b - a
        with np.errstate(invalid="ignore", divide="ignore"):
            secant = b * (at_a - at_b) / width
            slope = np.where(np.isfinite(secant) & (width > ROOT * b), secant, slope)
            root = a + width * at_a / (at_a - at_b)
        root = np.where(np.isfinite(root), root, a + 0.5 * width)
        trial = np.sort([root - _AROUND * width, root + _AROUND * width, a + 0.5 * width], axis=0)
        x = np.vstack([a, np.clip(trial, a, b), b])
        values = np.vstack([at_a, _deciding(model, x[1:-1], wanted), at_b])
        k, last = np.arange(count), (values >= 0.0).sum(axis=0) - 1  # Descending through zero.
        last = np.clip(last, 0, len(x) - 2)
        a, b, at_a, at_b = x[last, k], x[last + 1, k], values[last, k], values[last + 1, k]
    lost = model.strains.at_rest.unit_rounding * model.layout.rigid.n
    with np.errstate(divide="ignore"):
        rounding = np.where(slope > 0.0, lost / slope, 0.0)
    _warn_of_worst(0.5 * (a + b), rounding)
    return 0.5 * (a + b)


def _warn_of_worst(values: Array, rounding: Array) -> None:
    """Warn if the error of an eigenfrequency may exceed the limit."""
    worst = int(np.argmax(rounding))
    warn_of_rounding(f"the exact beam's eigenfrequency of {values[worst]:.6g} rad/s", float(rounding[worst]), ALIKE)


def _deciding(model: ExactModel, omega: Array, wanted: Array) -> Array:
    """Return values that are negative where more than ``wanted`` natural frequencies are below ``omega``.

    They are the decisive eigenvalues of the dynamic stiffness; infinite where the count does not depend on these.
    """
    values, clamped = model.inertia(omega.ravel())
    values, index = values.reshape(*omega.shape, -1), wanted - clamped.reshape(omega.shape)
    n = values.shape[2]
    result = np.take_along_axis(values, np.clip(index, 0, n - 1)[:, :, None], axis=2)[:, :, 0]
    return np.where(index < 0, -np.inf, np.where(index >= n, np.inf, result))


def _bracket(model: ExactModel, count: int) -> tuple[float, float, int]:
    """Return a frequency below all elastic ones, one above ``count`` of them, and the number of zero frequencies."""
    longest = max(segment.length for segment in model.segments)
    scale = max(np.sqrt(s.bending_stiffness / s.mass_per_length) for s in model.segments) / longest**2
    low, high, rigid = 1e-6 * scale, scale, model.strains.at_rest.rigid
    while low > _SLOWEST * scale and int(model.count_below(np.array([low]))[0]) > rigid:
        low *= 1e-3
    while int(model.count_below(np.array([high]))[0]) < rigid + count:
        high *= 2.0
    return low, high, rigid


def damped_eigenvalues(model: ExactModel, start: SecondOrderModel, moved: Sequence[str], count: int) -> Array:
    """Return the ``count`` eigenvalues of lowest positive imaginary part, rad/s.

    Parameters
    ----------
    model : ExactModel
        Model with prescribed motions.
    start : SecondOrderModel
        A fine discretization of the same structure, driven by forces; its poles start Newton's method on ``det D(s)``.
    moved : sequence of str
        Force inputs whose motion is prescribed in ``model``.

    Raises
    ------
    ArithmeticError
        If an iteration did not converge or left its start, or if two of them converged to the same eigenvalue.
    """
    first = damped_poles(prescribe_displacement(start, moved).structure, count, _START)
    s = np.array(first, dtype=complex)
    step = np.full(len(s), np.inf + 0j)
    rounding = np.zeros(len(s))
    for _ in range(_NEWTON_STEPS):
        step, rounding = model.strains.newton_step(s)
        s = s - step
        if (np.abs(step) <= np.maximum(1e-13 * np.abs(s), 0.1 * rounding)).all():
            break
    residual = np.abs(step) / np.maximum(np.abs(s), rounding / ALIKE)
    worst = int(np.argmax(residual))
    if not residual[worst] <= _CONVERGED:
        raise ArithmeticError(f"Newton's method for the eigenvalue near {first[worst]:.6g} did not converge")
    if (np.abs(s - first) > _START * np.abs(first)).any():
        raise ArithmeticError("Newton's method left its start: refine the starting discretization")
    if len(s) > 1 and np.abs(np.diff(np.sort_complex(s))).min() < 1e-9 * np.abs(s).max() * 1e-3:
        raise ArithmeticError("two iterations came to the same eigenvalue")
    _warn_of_worst(np.abs(s), rounding / np.abs(s))
    return s
