"""Prescribed hub motion without gyroscopic terms and damping: every mode vibrates exactly, only the rest is collocated.

The modes are those of the mean speed squared of each step, see `modal_steps`. A mode too fast for the step is followed
all the same, which a polynomial for its coordinate could not do. After the last step the hub's speed is taken to be
constant: what follows is a free vibration without a polynomial.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.maneuvers import PrescribedMotion
from boomctl.rotating_beam.modal.equations import NormalForm
from boomctl.rotating_beam.motion.modal_steps import (
    STAGES,
    highest_terms,
    leading_terms,
    polynomial_motion,
    solve_steps,
)
from boomctl.rotating_beam.motion.refinement import Accuracy, halved

_AFTER = (
    1000.0  # square of the angle in which a step's slow mode answers a term of degree 8: 4 (2 8 - 1)(2 8 + 1), less
)
_FOLLOWED = 12.0  # angle in a step up to which polynomials follow a vibration: its highest terms tell of those left out
_SHARE = 0.25  # of such forces that moves a displacement: a sixth and less (measured, 490 random motions)
_LEVELS = 6  # of halved steps, before plain collocation takes over: a choice, 32 times as many steps as at first


@dataclass(frozen=True)
class ModalTrajectory:
    """Motion of n mass-normalized coordinates over m steps and beyond.

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
    deviation : ndarray, m
        Largest deviation of the speed squared from its mean on each step, rad^2/s^2.
    """

    form: NormalForm
    edges: Array
    x: Array
    v: Array
    omega: Array
    shapes: Array
    force: Array
    error: Array
    deviation: Array

    def displacement(self, row: Array, timepts: Array) -> Array:
        """``row q`` at ascending instants from the first edge on, k."""
        weights = ((row @ self.form.to_q) @ self.shapes)[:, None]
        waves = weights * self._waves
        step, elapsed = self._placed(timepts)
        item = np.stack([self.omega, np.arctan2(waves[:, 1], waves[:, 0]), np.hypot(waves[:, 0], waves[:, 1])])
        omega, phase, amplitude = item.take(step, 1)
        omega *= elapsed[:, None]
        omega += phase
        result: Array = np.einsum("kn,kn->k", np.cos(omega), amplitude)
        early = int(np.searchsorted(step, self.edges.size - 1))
        coefficients = (weights[:-1] @ self._polynomials)[:, 0].take(step[:early], 0)
        result[:early] += np.einsum("kj,kj->k", self._powers(step[:early], elapsed[:early]), coefficients)
        return result

    def __call__(self, timepts: Array) -> tuple[Array, Array]:
        """Coordinates q and rates at ascending instants from the first edge on, each k x n."""
        step, elapsed = self._placed(timepts)
        angle = self.omega[step] * elapsed[:, None]
        cosine, sine = np.cos(angle), np.sin(angle)
        cosine_part, sine_part = self._waves[step].swapaxes(0, 1)
        z = cosine * cosine_part - sine * sine_part
        rate = -self.omega[step] * (sine * cosine_part + cosine * sine_part)
        early = int(np.searchsorted(step, self.edges.size - 1))
        first = step[:early]
        polynomials, place = self._polynomials[first], self._powers(first, elapsed[:early])
        z[:early] += np.einsum("kj,knj->kn", place, polynomials)
        slopes = np.arange(1, place.shape[1]) * place[:, :-1] / self._lengths[first, None]
        rate[:early] += np.einsum("kj,knj->kn", slopes, polynomials[..., 1:])
        both = self.shapes[step] @ np.stack([z, rate], axis=-1)
        return both[..., 0] @ self.form.to_q.T, both[..., 1] @ self.form.to_q.T

    def unseen(self, rows: Array) -> float:
        """How far forces that the ends' errors do not tell of may move displacements r of rows r x n over x.

        Those of a degree above the steps' move the inside of a step more than its end; they are taken to fall as the
        highest terms that there are. A mode too fast for a polynomial vibrates after a jump of the hub's acceleration, and
        the speed's deviation from its mean couples it to all others: these forces are taken to come at random, step by step.
        """
        omega, h, modes = self.omega[:-1], self._lengths[:, None], self.shapes[:-1]
        weights = np.abs(rows @ modes).max(axis=1)
        before, last = leading_terms(self.force)
        after = last * last / np.maximum(np.maximum(before, last), np.finfo(float).tiny)
        inside = float((weights * after / (omega * omega + _AFTER / (h * h))).sum(axis=1).max())
        fast = omega * h > _FOLLOWED
        if not fast.any():
            return inside
        vibrations = np.where(fast, np.hypot(*self._waves[:-1].swapaxes(0, 1)), 0.0)
        coupling = np.abs(modes.swapaxes(1, 2) @ self.form.slope @ modes)
        force = (coupling @ vibrations[..., None])[..., 0] * self.deviation[:, None]
        return inside + _SHARE * float(np.linalg.norm((weights * h / omega * force).sum(axis=1)))

    @cached_property
    def _lengths(self) -> Array:
        return self.edges[1:] - self.edges[:-1]

    def _placed(self, timepts: Array) -> tuple[Array, Array]:
        """Steps in which instants lie, m for what follows them, and the time since each began."""
        step = self.edges.searchsorted(timepts, side="right")
        step -= 1
        return step, timepts - self.edges.take(step)

    def _powers(self, step: Array, elapsed: Array) -> Array:
        """Powers of the place on a step, k x s or more."""
        powers = np.empty((step.size, self._polynomials.shape[-1]))
        powers[:, 0] = 1.0
        powers[:, 1:] = (elapsed / self._lengths.take(step))[:, None]
        return np.multiply.accumulate(powers, axis=1)

    @cached_property
    def _polynomials(self) -> Array:
        """Coefficients of the polynomial part of each mode in powers of the place on a step, m x n x s or more."""
        return polynomial_motion(self.omega[:-1], self._lengths, self.force)

    @cached_property
    def _waves(self) -> Array:
        """Amplitudes of the cosine and, negative, of the sine in the vibration of each mode, (m + 1) x 2 x n."""
        waves = np.stack([self.x, self.v], axis=1) @ self.shapes
        waves[:-1, 0] -= self._polynomials[..., 0]
        waves[:-1, 1] -= self._polynomials[..., 1] / self._lengths[:, None]
        waves[:, 1] /= -self.omega
        return waves


def modal_march(
    form: NormalForm, maneuver: PrescribedMotion, edges: Array, start: tuple[Array, Array]
) -> ModalTrajectory:
    """Solve the beam's equations over all steps.

    The error is estimated by leaving the two highest Legendre terms of the forces out.

    Parameters
    ----------
    form : NormalForm
    maneuver : PrescribedMotion
    edges : ndarray, m + 1
        Ends of the steps, s.
    start : pair of ndarray, n
        Coordinates q and rates at ``edges[0]``.
    """
    method, n = gauss_method(STAGES), form.push.size
    h = edges[1:] - edges[:-1]
    nodes = (edges[:-1, None] + h[:, None] * method.nodes).ravel()
    square = maneuver.speed(np.append(nodes, edges[-1])) ** 2
    at_nodes = square[:-1].reshape(h.size, STAGES)
    mean = np.append(at_nodes @ method.weights, square[-1])
    values, shapes = np.linalg.eigh(form.stiffness + mean[:, None, None] * form.slope)
    omega, modes = np.sqrt(values), shapes[:-1]
    push = (form.push @ modes)[..., None] * maneuver.acceleration(nodes).reshape(h.size, 1, STAGES)
    coupling = modes.swapaxes(1, 2) @ form.slope @ modes
    remainder = at_nodes - mean[:-1, None]
    steps = solve_steps(omega[:-1], h, push, remainder, coupling)
    ends = modes[:, None] @ steps.ends.swapaxes(1, 2)
    turned = ends[..., :-1].reshape(h.size, 2 * n, 2, n) @ modes.swapaxes(1, 2)[:, None]
    turned = turned.reshape(h.size, 2 * n, 2 * n)
    start_state = np.concatenate([form.to_x @ start[0], form.to_x @ start[1]])
    state = _run_through(turned, ends[..., -1].reshape(h.size, 2 * n), start_state)
    modal = np.ones((h.size, 2 * n + 1))
    modal[:, :-1] = (state[:-1].reshape(-1, 2, n) @ modes).reshape(-1, 2 * n)
    force = (steps.force @ modal[:, None, :, None])[..., 0]
    lost = (steps.end_by_force @ highest_terms(force)[..., None])[..., 0]
    lost = lost.swapaxes(1, 2) @ modes.swapaxes(1, 2)
    error = _run_through(turned, 2.0 * lost.reshape(h.size, 2 * n), np.zeros(2 * n))
    deviation = np.abs(remainder).max(axis=1)
    return ModalTrajectory(form, edges, state[:, :n], state[:, n:], omega, shapes, force, error, deviation)


def modal_refine(
    form: NormalForm,
    maneuver: PrescribedMotion,
    edges: Array,
    start: tuple[Array, Array],
    accuracy: Accuracy,
    *,
    vibrates_on: bool,
) -> tuple[ModalTrajectory, float] | None:
    """Solve on steps halved until the estimated error is as small as asked for.

    Parameters
    ----------
    form, maneuver, edges, start
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
        trajectory = modal_march(form, maneuver, edges, start)
        allowed = accuracy.atol + accuracy.rtol * float(np.abs(trajectory.x @ rows.T).max())
        error = float(np.abs(trajectory.error[:, :n] @ rows.T).max())
        if vibrates_on:
            shapes = trajectory.shapes[-1]
            z, rate = trajectory.error[-1].reshape(2, n) @ shapes
            amplitudes = rows @ shapes * np.hypot(z, rate / trajectory.omega[-1])
            error = max(error, float(np.abs(amplitudes).sum(axis=1).max()))
        if error <= allowed:
            error += trajectory.unseen(rows)
            if error <= allowed:
                return trajectory, error
        edges = halved(edges)
    return None


def _run_through(transition: Array, push: Array, start: Array) -> Array:
    """States at the ends of the steps, (m + 1) x 2 n."""
    state = start
    states = [start]
    for turn, gain in zip(transition, push, strict=True):
        state = turn.dot(state)
        state += gain
        states.append(state)
    return np.array(states)
