"""Eigenvalues of structures with exact beams: undamped ones by counting, damped ones by Newton's method."""

from collections.abc import Sequence

import numpy as np

from boomctl.arrays import Array
from boomctl.structure.beams.exact import ExactModel
from boomctl.structure.displacement_input import prescribe_displacement
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import damped_poles

_BISECTIONS = 60  # the first few bring decades down to octaves, 52 more halve down to the last digit
_NEWTON_STEPS = 30  # from starts good to 1e-3 some five are taken; many more mean that it does not converge (a choice)


def undamped_frequencies(model: ExactModel, count: int) -> Array:
    """Return the ``count`` lowest undamped natural frequencies above zero [rad/s], none missed.

    Bisection on the number of natural frequencies below (Wittrick & Williams 1971), for all of them at once.
    """
    low, high = _bracket(model, count)
    rigid = int(model.count_below(np.array([low]))[0])
    wanted = rigid + np.arange(count)
    a, b = np.full(count, low), np.full(count, high)
    for _ in range(_BISECTIONS):
        middle = np.where(b > 4.0 * a, np.sqrt(a * b), 0.5 * (a + b))
        above = model.count_below(middle) > wanted
        a, b = np.where(above, a, middle), np.where(above, middle, b)
        if (b - a <= 4 * np.finfo(float).eps * b).all():
            break
    return 0.5 * (a + b)


def _bracket(model: ExactModel, count: int) -> tuple[float, float]:
    """Return a frequency below all elastic ones and one above ``count`` of them."""
    longest = max(segment.length for segment in model.segments)
    scale = max(np.sqrt(s.bending_stiffness / s.mass_per_length) for s in model.segments) / longest**2
    low, high = 1e-6 * scale, scale
    rigid = int(model.count_below(np.array([low]))[0])
    while int(model.count_below(np.array([high]))[0]) < rigid + count:
        high *= 2.0
    return low, high


def damped_eigenvalues(model: ExactModel, start: SecondOrderModel, moved: Sequence[str], count: int) -> Array:
    """Return the ``count`` eigenvalues of lowest positive imaginary part, rad/s.

    Parameters
    ----------
    model : ExactModel
        Its motions prescribed.
    start : SecondOrderModel
        A fine discretisation of the same structure, driven by forces; its poles start Newton's method on ``det D(s)``.
    moved : sequence of str
        Force inputs whose motion is prescribed in ``model``.

    Raises
    ------
    ArithmeticError
        An iteration did not converge, left its start, or two of them met.
    """
    first = damped_poles(prescribe_displacement(start, moved).structure, count)
    s = np.array(first, dtype=complex)
    step = np.full(len(s), np.inf + 0j)
    for _ in range(_NEWTON_STEPS):
        step = _newton_step(model, s)
        s = s - step
        if (np.abs(step) <= 1e-13 * np.abs(s)).all():
            break
    worst = int(np.argmax(np.abs(step) / np.abs(s)))
    if not np.abs(step[worst]) <= 1e-11 * np.abs(s[worst]):
        raise ArithmeticError(f"Newton's method for the eigenvalue near {first[worst]:.6g} did not converge")
    if (np.abs(s - first) > 1e-3 * np.abs(first)).any():
        raise ArithmeticError("Newton's method left its start: refine the starting discretisation")
    if len(s) > 1 and np.abs(np.diff(np.sort_complex(s))).min() < 1e-9 * np.abs(s).max() * 1e-3:
        raise ArithmeticError("two iterations came to the same eigenvalue")
    return s


def _newton_step(model: ExactModel, s: Array) -> Array:
    """Return ``det D/(det D)'`` at each ``s``: one over the trace of ``D^-1 D'``."""
    h = 1e-6 * np.abs(s)
    D, up, down = (np.moveaxis(model.dynamic_stiffness(x), 2, 0) for x in (s, s + h, s - h))
    slope = (up - down) / (2.0 * h)[:, None, None]
    return 1.0 / np.einsum("fii->f", np.linalg.solve(D, slope))
