"""The H-infinity norm of a system in modal coordinates, proved cell by cell: light damping costs no digits.

In a cell of frequencies, ``|w - w0| <= h``, each mode is expanded about the middle:
``1/(jw - p) = 1/x - j(w - w0)/x^2 - (w - w0)^2/(x^2 (jw - p))`` with ``x = j w0 - p``.  The first two terms together are
linear in ``w``, and the norm of what is linear is largest at an end of the cell; the third is at most
``h^2 |c||b| / (|x|^2 d)``, with ``d`` the distance of the pole from the cell.  Cells that reach a level are halved.
Far out the same is done in ``1/w``.
"""

from dataclasses import dataclass
from math import inf

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.frequency import LEVEL, SOUGHT, highest_peak, resonance_grid, singular_values
from boomctl.lti.modal import ModalSystem

BY_MODES = "cells of frequencies, each proved in modal coordinates"
_EPS = float(np.finfo(float).eps)
_CELLS = 60  # spread evenly in the logarithm of the frequency, beside those around the resonances (a choice)
_HALVINGS = 60  # of a cell, at most: 1e-18 of it
_MOST = 4_000_000  # modes times cells, in all: about half a second (a choice of patience)
_AT_ONCE = 2**18  # entries, modes times cells, that are evaluated at once: what stays in the cache
_RAISED = 10  # levels tried: each rises to a higher peak
_BEYOND = 4.0  # times the fastest pole: from there on in the inverse of the frequency (a choice)
_TERMS = 16.0  # roundings of a term of a response, beside one for each that it is added to


@dataclass(frozen=True)
class ModalNorm:
    """The norm of a modal system: ``lower`` is attained at ``omega``, and no singular value is above ``upper``."""

    lower: float
    upper: float
    omega: float


def modal_norm(modal: ModalSystem, floor: float = 0.0) -> ModalNorm:
    """Return the norm of a stable system in modal coordinates; ``upper`` is ``inf`` where a proof takes too long.

    A norm below ``floor`` is of no interest: then that is ``upper``.
    """

    def value(omega: Array) -> Array:
        return singular_values(modal.response(omega))[0]

    poles, static = modal.poles, float(np.linalg.norm(modal.D, 2))
    size = np.abs(poles)
    low, high = 0.1 * float(size.min()), _BEYOND * float(size.max())
    grid = resonance_grid(poles[poles.imag > 0.0], low, high, points=_CELLS, places=SOUGHT, also=[0.0])
    peak, at = highest_peak(value, grid)
    peak, at = (peak, at) if peak >= static else (static, inf)
    far = 1.0 / high
    near = 0.5 * (grid[1:] + grid[:-1]), 0.5 * np.diff(grid)
    beyond = np.array([0.5 * far]), np.array([0.5 * far])
    for _ in range(_RAISED):
        level = max(peak * (1.0 + LEVEL), floor)
        if level == 0.0:
            return ModalNorm(0.0, 0.0, 0.0)
        found = [_highest(modal, *near, level, inverse=False), _highest(modal, *beyond, level, inverse=True)]
        top, where = max(found)
        if top <= level:
            doubt = _rounding(modal, at)
            return ModalNorm(peak - doubt, level, at)
        if top == inf:
            return ModalNorm(peak - _rounding(modal, at), inf, at)
        around = where * (1.0 + np.linspace(-LEVEL, LEVEL, 5))
        better, place = highest_peak(value, np.unique(np.concatenate([around, [where]])))
        peak, at = (better, place) if better >= top else (top, where)
    return ModalNorm(peak - _rounding(modal, at), inf, at)


def _rounding(modal: ModalSystem, omega: float) -> float:
    """Return what rounding may change of a response at one frequency."""
    weights = np.linalg.norm(modal.C, axis=0) * np.linalg.norm(modal.B, axis=1)
    terms = float(np.sum(weights / np.abs(1j * omega - modal.poles))) if omega < inf else 0.0
    return _EPS * (_TERMS + len(modal.poles)) * (terms + float(np.linalg.norm(modal.D)))


def _highest(modal: ModalSystem, middle: Array, half: Array, level: float, inverse: bool) -> tuple[float, float]:
    """Return a value above the level and its frequency, or a value not above it if none is; ``inf`` if neither is shown.

    Cells of frequencies, or with ``inverse`` of their inverses.
    """
    tried = 0
    for _ in range(_HALVINGS):
        tried += len(middle) * len(modal.poles)
        if tried > _MOST:
            return inf, inf
        value, bound = _cells(modal, middle, half, inverse)
        best = int(np.argmax(value))
        if value[best] > level:
            return float(value[best]), 1.0 / float(middle[best]) if inverse else float(middle[best])
        open_ = bound > level
        if not open_.any():
            return 0.0, 0.0
        half = 0.5 * half[open_]
        middle = np.concatenate([middle[open_] - half, middle[open_] + half])
        half = np.concatenate([half, half])
    return inf, inf


def _cells(modal: ModalSystem, middle: Array, half: Array, inverse: bool) -> tuple[Array, Array]:
    """Return the largest singular values in the middle of cells, and bounds of them in the cells."""
    step = max(1, _AT_ONCE // max(1, len(modal.poles)))
    parts = [_few(modal, middle[k : k + step], half[k : k + step], inverse) for k in range(0, len(middle), step)]
    return np.concatenate([value for value, _ in parts]), np.concatenate([bound for _, bound in parts])


def _few(modal: ModalSystem, middle: Array, half: Array, inverse: bool) -> tuple[Array, Array]:
    p, weights = modal.poles, np.linalg.norm(modal.C, axis=0) * np.linalg.norm(modal.B, axis=1)
    residues = (modal.C.T[:, :, None] * modal.B[:, None, :]).reshape(len(p), modal.D.size)
    w, h = middle[:, None], half[:, None]
    if inverse:  # t/(j - p t), t = 1/w: its derivatives are j/(j - p t)^2 and 2 j p/(j - p t)^3
        x = 1j - p * w
        value, slope = w / x, 1j / x**2
        nearest = np.abs(np.abs(p) * w - 1.0) - np.abs(p) * h  # of |j - p t|, at least: | |p| t - 1 |
        bend = np.abs(p) / (np.abs(x) ** 2 * np.where(nearest > 0.0, nearest, np.finfo(float).tiny))
    else:
        x = 1j * w - p
        value, slope = 1.0 / x, -1j / x**2
        nearest = np.hypot(p.real, np.maximum(np.abs(w - p.imag) - h, 0.0))
        bend = 1.0 / (np.abs(x) ** 2 * nearest)
    shape = (len(middle), *modal.D.shape)
    at, along = (value @ residues).reshape(shape) + modal.D, (slope @ residues).reshape(shape) * half[:, None, None]
    rounding = _EPS * (_TERMS + len(p)) * ((np.abs(value) + np.abs(slope) * h) @ weights + np.linalg.norm(modal.D))
    ends = np.maximum(_largest(at + along), _largest(at - along))
    return _largest(at) - rounding, ends + half**2 * (bend @ weights) + rounding


def _largest(G: Array) -> Array:
    return singular_values(np.moveaxis(G, 0, 2))[0]
