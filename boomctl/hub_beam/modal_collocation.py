"""Prescribed hub motion without gyroscopic terms and damping: every mode vibrates exactly, only the rest is collocated.

Over a step the speed squared is split into its mean and a remainder. With the mean the beam's modes are decoupled,
``z'' + Omega^2 z = F(t)``, and are solved in closed form for a polynomial F: a polynomial and a free vibration. F holds
the hub's acceleration and the remainder's coupling and is interpolated in the Gauss points of the step. A mode too fast
for the step is thus followed all the same, which a polynomial for z itself could not do. After the last step the hub's
speed is taken to be constant: what follows is a free vibration without a polynomial.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import perm
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.hub_beam.equations import NormalForm
from boomctl.hub_beam.gauss import gauss_method
from boomctl.hub_beam.manoeuvres import PrescribedMotion
from boomctl.hub_beam.refinement import Accuracy, halved

_STAGES, _KEPT = 8, 6
_SLOW = 0.5
"""Angle below which a mode turns slowly in a step: there polynomial and vibration would cancel; a series does not."""
_TERMS = 7
"""Of that series; what is left out is below 1e-16."""
_LEVELS = 6
_PLACES = (*gauss_method(_STAGES).nodes, 1.0)


@dataclass(frozen=True)
class ModalTrajectory:
    """Motion of n mass-normalised coordinates over m steps and beyond.

    Attributes
    ----------
    form : NormalForm
    edges : ndarray, m + 1
        Ends of the steps, s.
    x, v : ndarray, (m + 1) x n
        Coordinates and rates at the ends.
    omega : ndarray, (m + 1) x n
        Frequencies of the modes of each step and of what follows, rad/s.
    shapes : ndarray, (m + 1) x n x n
        ``x = shapes z``.
    force : ndarray, m x n x s
        Modal forces at the nodes.
    error : ndarray, (m + 1) x 2 n
        Estimated errors of x and v at the ends: twice what the two highest Legendre terms of the forces do to them.
    """

    form: NormalForm
    edges: np.ndarray
    x: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    shapes: np.ndarray
    force: np.ndarray
    error: np.ndarray

    def displacement(self, row: np.ndarray, timepts: np.ndarray) -> np.ndarray:
        """``row q`` at ascending instants from the first edge on, k."""
        weights = ((row @ self.form.to_q) @ self.shapes)[:, None]
        step, place, cosine, sine = self._turned(timepts)
        waves = weights * self._waves
        result = np.einsum("kn,kn->k", cosine, waves[:, 0].take(step, 0))
        result -= np.einsum("kn,kn->k", sine, waves[:, 1].take(step, 0))
        early = int(np.searchsorted(step, self.edges.size - 1))
        coefficients = (weights[:-1] @ self._polynomials)[:, 0]
        result[:early] += np.einsum("kj,kj->k", place[:early], coefficients.take(step[:early], 0))
        return result

    def __call__(self, timepts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates q and rates at ascending instants from the first edge on, each k x n."""
        step, place, cosine, sine = self._turned(timepts)
        cosine_part, sine_part = self._waves[step].swapaxes(0, 1)
        z = cosine * cosine_part - sine * sine_part
        rate = -self.omega[step] * (sine * cosine_part + cosine * sine_part)
        early = int(np.searchsorted(step, self.edges.size - 1))
        polynomials, place = self._polynomials[step[:early]], place[:early]
        z[:early] += np.einsum("kj,knj->kn", place, polynomials)
        slopes = np.arange(1, place.shape[1]) * place[:, :-1] / np.diff(self.edges)[step[:early], None]
        rate[:early] += np.einsum("kj,knj->kn", slopes, polynomials[..., 1:])
        both = self.shapes[step] @ np.stack([z, rate], axis=-1)
        return both[..., 0] @ self.form.to_q.T, both[..., 1] @ self.form.to_q.T

    def _turned(self, timepts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Steps in which instants lie, powers of the place on them, and how far the modes have turned since."""
        step = np.searchsorted(self.edges, timepts, side="right") - 1
        elapsed = timepts - self.edges.take(step)
        length = np.append(np.diff(self.edges), 1.0)
        place = np.vander(elapsed / length.take(step), self._polynomials.shape[-1], increasing=True)
        angle = self.omega.take(step, 0) * elapsed[:, None]
        return step, place, np.cos(angle), np.sin(angle)

    @cached_property
    def _polynomials(self) -> np.ndarray:
        """Coefficients of the polynomial part of each mode in powers of the place on a step, m x n x s or more."""
        table, omega = _table(), self.omega[:-1]
        phase, powers = omega * np.diff(self.edges)[:, None], self.force @ table.to_powers.T
        derivatives = (powers @ table.derivatives).reshape(*omega.shape, -1, _STAGES)
        result: np.ndarray = (_scales(omega, phase)[:, :, None] @ derivatives)[:, :, 0]
        slow = phase < _SLOW
        if not slow.any():
            return result
        width = _STAGES + 2 * _TERMS
        wide = np.zeros((*omega.shape, width))
        wide[..., :_STAGES] = result
        integrals = (powers[slow] @ table.integrals).reshape(-1, _TERMS, width)
        wide[slow] = (_slow_scales(omega[slow], phase[slow])[:, None] @ integrals)[:, 0]
        return wide

    @cached_property
    def _waves(self) -> np.ndarray:
        """Amplitudes of the cosine and, negative, of the sine in the vibration of each mode, (m + 1) x 2 x n."""
        z, rate = ((each[:, None] @ self.shapes)[:, 0] for each in (self.x, self.v))
        z[:-1] -= self._polynomials[..., 0]
        rate[:-1] -= self._polynomials[..., 1] / np.diff(self.edges)[:, None]
        return np.stack([z, -rate / self.omega], axis=1)


def modal_march(
    form: NormalForm, motion: PrescribedMotion, edges: np.ndarray, start: tuple[np.ndarray, np.ndarray]
) -> ModalTrajectory:
    """Solve the beam's equations over all steps.

    The error is estimated by leaving the two highest Legendre terms of the forces out.

    Parameters
    ----------
    form : NormalForm
    motion : PrescribedMotion
    edges : ndarray, m + 1
        Ends of the steps, s.
    start : pair of ndarray, n
        Coordinates q and rates at ``edges[0]``.
    """
    method, n = gauss_method(_STAGES), form.push.size
    h = edges[1:] - edges[:-1]
    nodes = (edges[:-1, None] + h[:, None] * method.nodes).ravel()
    square = motion.speed(np.append(nodes, edges[-1])) ** 2
    at_nodes = square[:-1].reshape(h.size, _STAGES)
    mean = np.append(at_nodes @ method.weights, square[-1])
    values, shapes = np.linalg.eigh(form.stiffness + mean[:, None, None] * form.slope)
    omega, modes = np.sqrt(values), shapes[:-1]
    push = (form.push @ modes)[..., None] * motion.acceleration(nodes).reshape(h.size, 1, _STAGES)
    coupling = modes.swapaxes(1, 2) @ form.slope @ modes
    steps = _steps(omega[:-1], h, push, at_nodes - mean[:-1, None], coupling)
    turned, pushed = _in_common(steps.transition, modes), _in_common(steps.push[..., None], modes)[..., 0]
    state = _run_through(turned, pushed, np.concatenate([form.to_x @ start[0], form.to_x @ start[1]]))
    modal = np.ones((h.size, 2 * n + 1))
    modal[:, : 2 * n] = (state[:-1].reshape(-1, 2, n) @ modes).reshape(-1, 2 * n)
    force = (steps.force @ modal[:, None, :, None])[..., 0]
    lost = (steps.end_by_force @ (force @ _table().highest.T)[..., None])[..., 0]
    lost = lost.swapaxes(1, 2).reshape(-1, 2 * n, 1)
    error = _run_through(turned, 2.0 * _in_common(lost, modes)[..., 0], np.zeros(2 * n))
    return ModalTrajectory(form, edges, state[:, :n], state[:, n:], omega, shapes, force, error)


def modal_refine(
    form: NormalForm,
    motion: PrescribedMotion,
    edges: np.ndarray,
    start: tuple[np.ndarray, np.ndarray],
    accuracy: Accuracy,
    vibrates_on: bool,
) -> tuple[ModalTrajectory, float] | None:
    """Solve on steps halved until the estimated error is as small as asked for.

    Parameters
    ----------
    form, motion, edges, start
        As for `modal_march`; `edges` are the first, coarsest steps.
    accuracy : Accuracy
        Its first group is the free end.
    vibrates_on : bool
        Whether the vibration after the last step is to be as exact.

    Returns
    -------
    trajectory, error : ModalTrajectory, float
        The error of the free end's displacement, m. None in place of both if it stays above what is asked for.
    """
    n, rows = form.push.size, accuracy.rows[0] @ form.to_q
    for _ in range(_LEVELS):
        trajectory = modal_march(form, motion, edges, start)
        error = float(np.abs(trajectory.error[:, :n] @ rows.T).max())
        if vibrates_on:
            shapes = trajectory.shapes[-1]
            z, rate = trajectory.error[-1].reshape(2, n) @ shapes
            amplitudes = rows @ shapes * np.hypot(z, rate / trajectory.omega[-1])
            error = max(error, float(np.abs(amplitudes).sum(axis=1).max()))
        if error <= accuracy.atol + accuracy.rtol * float(np.abs(trajectory.x @ rows.T).max()):
            return trajectory, error
        edges = halved(edges)
    return None


class _Steps(NamedTuple):
    """Answers of m steps, modal: to start coordinates, start rates and, last, the hub's acceleration.

    Attributes
    ----------
    force : ndarray, m x n x s x (2 n + 1)
        Modal forces at the nodes.
    transition : ndarray, m x 2 n x 2 n
    push : ndarray, m x 2 n
        Coordinates and rates at the end.
    end_by_force : ndarray, m x n x 2 x s
        Coordinates and rates at the end by the forces at the nodes.
    """

    force: np.ndarray
    transition: np.ndarray
    push: np.ndarray
    end_by_force: np.ndarray


def _steps(omega: np.ndarray, h: np.ndarray, push: np.ndarray, remainder: np.ndarray, coupling: np.ndarray) -> _Steps:
    """Solve every step for its answers.

    Parameters
    ----------
    omega : ndarray, m x n
    h : ndarray, m
    push : ndarray, m x n x s
        Modal forces at the nodes by the hub's acceleration.
    remainder : ndarray, m x s
        Speed squared at the nodes less its mean.
    coupling : ndarray, m x n x n
        Modal stiffness that goes with it.
    """
    (m, n), s = omega.shape, _STAGES
    angle = omega[..., None] * h[:, None, None] * _PLACES
    cosine, sine = np.cos(angle), np.sin(angle)
    to_place, end_by_force = _by_force(omega, angle[..., s], cosine, sine)
    to_nodes, index = to_place[:, :, :s], np.arange(n)
    free = np.zeros((m, n, s, 2 * n + 1))
    sine /= omega[..., None]
    free[:, index, :, index] = cosine[..., :s].swapaxes(0, 1)
    free[:, index, :, n + index] = sine[..., :s].swapaxes(0, 1)
    free[..., 2 * n] = (to_nodes @ push[..., None])[..., 0]
    system = (to_nodes * remainder[:, None, None])[:, :, :, None] * coupling[:, :, None, :, None]
    system = system.reshape(m, n * s, n * s)
    system.reshape(m, -1)[:, :: n * s + 1] += 1.0
    z = np.linalg.solve(system, free.reshape(m, n * s, 2 * n + 1))
    force = (coupling @ z.reshape(m, n, -1)).reshape(free.shape)
    force *= -remainder[:, None, :, None]
    force[..., 2 * n] += push
    ends = (end_by_force @ force).swapaxes(1, 2).reshape(m, 2 * n, 2 * n + 1)
    ends[:, index, index] += cosine[..., s]
    ends[:, index, n + index] += sine[..., s]
    ends[:, n + index, index] -= sine[..., s] * omega**2
    ends[:, n + index, n + index] += cosine[..., s]
    return _Steps(force, ends[..., : 2 * n], ends[..., 2 * n], end_by_force)


def _by_force(
    omega: np.ndarray, phase: np.ndarray, cosine: np.ndarray, sine: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What forces at the nodes do to a mode from rest: at the places, m x n x (s + 1) x s, and at the end, m x n x 2 x s.

    To each power of the place belongs a polynomial motion, less the free vibration that starts as it does.
    """
    s, table, slow = _STAGES, _table(), phase < _SLOW
    motions = _scales(omega, phase) @ table.motions
    if slow.any():
        motions[slow] = _slow_scales(omega[slow], phase[slow]) @ table.slow_motions
    motions = motions.reshape(*omega.shape, s + 4, s)
    start, start_slope = motions[:, :, s + 1], motions[:, :, s + 2] / phase[..., None]
    to_place = motions[:, :, : s + 1] - cosine[..., None] * start[:, :, None]
    to_place -= sine[..., None] * start_slope[:, :, None]
    rate = motions[:, :, s + 3] / phase[..., None] + sine[..., s, None] * start - cosine[..., s, None] * start_slope
    ends = np.stack([to_place[:, :, s], omega[..., None] * rate], axis=2)
    return to_place @ table.to_powers, ends @ table.to_powers


def _scales(omega: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Factors ``(-1)^i / (Omega^2 phase^2i)`` of the even derivatives of a force in its polynomial motion, ... x s/2."""
    return _geometric(1.0 / (omega * omega), -1.0 / (phase * phase), _STAGES // 2)


def _slow_scales(omega: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Factors ``h^2 (-phase^2)^i`` of the integrals, taken 2 i + 2 times, of a force in its motion from rest."""
    return _geometric((phase / omega) ** 2, -phase * phase, _TERMS)


def _geometric(first: np.ndarray, ratio: np.ndarray, count: int) -> np.ndarray:
    """Geometric series along a new last axis."""
    result = np.empty((*first.shape, count))
    result[..., 0] = first
    for i in range(1, count):
        np.multiply(result[..., i - 1], ratio, out=result[..., i])
    return result


class _Table(NamedTuple):
    """Constants of the method with s stages.

    Attributes
    ----------
    to_powers : ndarray, s x s
        From values at the nodes to coefficients of powers.
    highest : ndarray, s x s
        Leaves the two highest Legendre terms of what is given at the nodes.
    derivatives : ndarray, s x (s/2 s)
        From coefficients of powers to those of the even derivatives.
    motions : ndarray, s/2 x ((s + 4) s)
        Even derivatives of the powers: at the places, at 0, their slopes at 0 and at 1.
    integrals : ndarray, s x (r (s + 2 r))
        From coefficients of powers to those of their integrals from 0, taken 2, 4, ... 2 r times.
    slow_motions : ndarray, r x ((s + 4) s)
        As `motions`, of these integrals.
    """

    to_powers: np.ndarray
    highest: np.ndarray
    derivatives: np.ndarray
    motions: np.ndarray
    integrals: np.ndarray
    slow_motions: np.ndarray


@lru_cache(maxsize=1)
def _table() -> _Table:
    s, nodes = _STAGES, gauss_method(_STAGES).nodes
    derivatives = np.zeros((s, s // 2, s))
    integrals = np.zeros((s, _TERMS, s + 2 * _TERMS))
    for k in range(s):
        for i in range(k // 2 + 1):
            derivatives[k, i, k - 2 * i] = perm(k, 2 * i)
        for i in range(_TERMS):
            integrals[k, i, k + 2 * i + 2] = 1.0 / perm(k + 2 * i + 2, 2 * i + 2)
    vandermonde = legendre.legvander(2.0 * nodes - 1.0, s - 1)
    highest = vandermonde[:, _KEPT:] @ np.linalg.inv(vandermonde)[_KEPT:]
    to_powers = np.linalg.inv(np.vander(nodes, s, increasing=True))
    flat = derivatives.reshape(s, -1), integrals.reshape(s, -1)
    return _Table(to_powers, highest, flat[0], _evaluated(derivatives), flat[1], _evaluated(integrals))


def _evaluated(polynomials: np.ndarray) -> np.ndarray:
    """Polynomials (s x r x degree + 1) at the places and at 0, and their slopes at 0 and 1; r x ((s + 4) s)."""
    degree = polynomials.shape[2] - 1
    values = np.vander([*_PLACES, 0.0], degree + 1, increasing=True)
    slopes = np.zeros((2, degree + 1))
    slopes[0, 1], slopes[1] = 1.0, np.arange(degree + 1)
    rows = np.concatenate([values, slopes])
    return (polynomials @ rows.T).transpose(1, 2, 0).reshape(polynomials.shape[1], -1)


def _in_common(modal: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Transitions (m x 2 n x 2 n) or pushes (m x 2 n x 1) of the steps, from each one's modes to common coordinates."""
    m, n = shapes.shape[:2]
    left = (shapes[:, None] @ modal.reshape(m, 2, n, -1)).reshape(m, 2 * n, -1)
    if modal.shape[2] == 1:
        return left
    return (left.reshape(m, 2 * n, 2, n) @ shapes.swapaxes(1, 2)[:, None]).reshape(m, 2 * n, 2 * n)


def _run_through(transition: np.ndarray, push: np.ndarray, start: np.ndarray) -> np.ndarray:
    """States at the ends of the steps, (m + 1) x 2 n."""
    states = [start]
    for turn, gain in zip(transition, push, strict=True):
        states.append(turn @ states[-1] + gain)
    return np.array(states)
