"""Prescribed hub motion without gyroscopic terms and damping: every mode in closed form, only its forces collocated.

With the mean of the speed squared over a step the beam's modes are decoupled, ``z'' + Omega^2 z = F(t)``. F contains the
hub's acceleration and the coupling of the modes by the deviation of the speed squared from its mean, at the Gauss points of
the step. The deviation is weak, so that the forces converge in a few sweeps; if they do not, a linear system is solved. A
mode too fast for the step is integrated exactly too, which a polynomial for its coordinate could not do. After the last
step the hub's speed is assumed constant: a free vibration without a polynomial follows.
"""

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.maneuvers import PrescribedMotion
from boomctl.rotating_beam.modal.equations import NormalForm
from boomctl.rotating_beam.motion.oscillators import responses, turning
from boomctl.rotating_beam.motion.refinement import Accuracy, halved
from boomctl.rotating_beam.motion.trajectory import SMOOTH, Vibrations

STAGES = 8  # Nodes of a step: forces of degree 7 over nearly a period of the lowest mode.
_PASSES = 10  # Most sweeps for the forces before a linear system is solved.
_FIRST_CHECK = 4  # Sweep after which convergence is first checked; an earlier check costs more than it saves.
_SETTLED = 1e-11  # Relative change of the forces at which sweeps stop; the remaining error is a tenth of it.
# Squared angle that scales a slow mode's response to a term of degree 8 in a step: 4 (2 8 - 1)(2 8 + 1), less.
_TERM_SCALE = 1000.0
# Angle in a step up to which polynomials resolve a vibration, so that its highest terms show the error.
_FOLLOWED = 12.0
_FRACTION = 0.25  # Fraction of the forces of unresolved vibrations that moves a displacement; 1/6 in random motions.
_REFINED = 6  # Levels of halved steps before plain collocation takes over: 32 times as many steps as at first.


@final
@dataclass(frozen=True, eq=False)
class ModalTrajectory:
    """Motion of hub and beam over m steps and beyond.

    Attributes
    ----------
    form : NormalForm
    maneuver : PrescribedMotion
    vibrations : Vibrations
        Vibrations in m windows of one step each, and after the last step.
    x : ndarray, (m + 1) x n
        Mass-normalized coordinates at the ends of the steps.
    error : ndarray, (m + 1) x 2 n
        Estimated errors of x and its rates at the ends: twice the effect of the two highest Legendre terms of the forces.
    deviation : ndarray, m
        Largest deviation of the speed squared from its mean on each step, rad^2/s^2.
    """

    form: NormalForm
    maneuver: PrescribedMotion
    vibrations: Vibrations
    x: Array
    error: Array
    deviation: Array

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.deviation.size

    def displacement(self, row: Array, timepts: Array) -> Array:
        """Return ``row q`` at times, k."""
        return self.vibrations.displacement(row @ self.form.to_q, timepts)

    def __call__(self, timepts: Array) -> tuple[Array, Array]:
        """Return coordinates and rates of hub and beam at times, k x N each."""
        z, rate, _ = self.vibrations.at(timepts)
        shapes = self.form.to_q @ self.vibrations.shapes[self.vibrations.located(timepts)[0]]
        q, v = ((shapes @ item[..., None])[..., 0] for item in (z, rate))
        return np.column_stack([self.maneuver.angle(timepts), q]), np.column_stack([self.maneuver.speed(timepts), v])

    def interior_error(self, rows: Array) -> float:
        """Estimate the error of displacements, rows r x n over x, by forces that the errors at the ends do not contain.

        Forces of a degree above the steps' excite the interior of a step more than its end; they are assumed to fall at the
        rate of the highest computed terms. A mode too fast for a polynomial vibrates after a jump of the hub's acceleration,
        and the deviation of the speed squared from its mean couples it to all others: these forces are assumed random.
        """
        known = self.vibrations
        omega, h, modes = known.rates.imag[:-1], known.h[:-1, None], known.shapes[:-1]
        weights = np.abs(rows @ modes).max(axis=1)
        terms = np.abs(known.force[:-1, :, 0] @ gauss_method(STAGES).terms[-4:].T)
        before, last = terms[..., 0] + terms[..., 1], terms[..., 2] + terms[..., 3]
        after = last * last / np.maximum(np.maximum(before, last), np.finfo(float).tiny)
        inside = float((weights * after / (omega * omega + _TERM_SCALE / (h * h))).sum(axis=1).max())
        fast = omega * h > _FOLLOWED
        if not fast.any():
            return inside
        vibrating = np.where(fast, np.abs(known.waves[:-1, :, 0]) / omega, 0.0)
        coupling = np.abs(modes.swapaxes(1, 2) @ self.form.slope @ modes)
        force = (coupling @ vibrating[..., None])[..., 0] * self.deviation[:, None]
        return inside + _FRACTION * float(np.linalg.norm((weights * h / omega * force).sum(axis=1)))


def modal_refine(
    form: NormalForm,
    maneuver: PrescribedMotion,
    edges: Array,
    start: tuple[Array, Array],
    accuracy: Accuracy,
    *,
    vibrates_on: bool,
) -> tuple[ModalTrajectory, float] | None:
    """Solve on steps halved until the estimated error is within the tolerance.

    Parameters
    ----------
    form, maneuver, edges, start
        As for `modal_march`; `edges` are the first, coarsest steps.
    accuracy : Accuracy
        Its first group is the free end.
    vibrates_on : bool
        Apply the tolerance also to the vibration after the last step.

    Returns
    -------
    trajectory, error : ModalTrajectory, float
        Motion, and error of the free end's displacement, m. None instead of both if the tolerance is not reached.
    """
    n, rows = form.push.size, accuracy.rows[0] @ form.to_q
    for _ in range(_REFINED):
        trajectory = modal_march(form, maneuver, edges, start)
        allowed = accuracy.atol + accuracy.rtol * float(np.abs(trajectory.x @ rows.T).max())
        error = float(np.abs(trajectory.error[:, :n] @ rows.T).max())
        if vibrates_on:
            shapes, omega = trajectory.vibrations.shapes[-1], trajectory.vibrations.rates.imag[-1]
            z, rate = trajectory.error[-1].reshape(2, n) @ shapes
            amplitudes = rows @ shapes * np.hypot(z, rate / omega)
            error = max(error, float(np.abs(amplitudes).sum(axis=1).max()))
        if error <= allowed:
            error += trajectory.interior_error(rows)
            if error <= allowed:
                return trajectory, error
        edges = halved(edges)
    return None


def modal_march(
    form: NormalForm, maneuver: PrescribedMotion, edges: Array, start: tuple[Array, Array]
) -> ModalTrajectory:
    """Solve the beam's equations over all steps.

    The error is estimated by omitting the two highest Legendre terms of the forces.

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
    rates, lengths = 1j * omega, np.append(h, 1.0)
    answers = responses(rates, lengths, STAGES, SMOOTH)
    push = (form.push @ modes)[..., None] * maneuver.acceleration(nodes).reshape(h.size, 1, STAGES)
    remainder = at_nodes - mean[:-1, None]
    steps = _solve_steps(omega[:-1], h, answers[:-1], push, remainder, modes.swapaxes(1, 2) @ form.slope @ modes)
    turned = modes[:, None] @ steps.transition.swapaxes(1, 2).reshape(h.size, 2, n, 2 * n)
    turned = (turned.reshape(h.size, 2 * n, 2, n) @ modes.swapaxes(1, 2)[:, None]).reshape(h.size, 2 * n, 2 * n)
    gained = (modes @ steps.pushed).swapaxes(1, 2).reshape(h.size, 2 * n)
    start_state = np.concatenate([form.to_x @ start[0], form.to_x @ start[1]])
    state = _run_through(turned, gained, start_state)
    modal = state.reshape(-1, 2, n) @ shapes
    known = np.ones((h.size, 2 * n + 1))
    known[:, :-1] = modal[:-1].reshape(h.size, 2 * n)
    force = np.zeros((h.size + 1, n, 1, STAGES))
    force[:-1, :, 0] = (steps.force @ known[:, None, :, None])[..., 0]
    lost = 2.0 * (steps.end_by_force @ (force[:-1, :, 0] @ method.highest.T)[..., None])[..., 0]
    lost = lost.swapaxes(1, 2) @ modes.swapaxes(1, 2)
    vibrations = Vibrations(
        begin=edges,
        h=lengths,
        steps=np.ones_like(lengths, dtype=int),
        rates=rates,
        shapes=shapes,
        force=force,
        starts=(modal[:, 1] + 1j * omega * modal[:, 0])[..., None],
        answers=answers,
    )
    error = _run_through(turned, lost.reshape(h.size, 2 * n), np.zeros(2 * n))
    return ModalTrajectory(form, maneuver, vibrations, state[:, :n], error, np.abs(remainder).max(axis=1))


class _Steps(NamedTuple):
    """Answers of m steps, modal: to start coordinates, start rates and, last, the hub's acceleration.

    Attributes
    ----------
    force : ndarray, m x n x s x (2 n + 1)
        Modal forces at the nodes.
    transition : ndarray, m x n x 2 x 2 x n
        Coordinates and rates at the end by those at the start.
    pushed : ndarray, m x n x 2
        By the hub's acceleration.
    end_by_force : ndarray, m x n x 2 x s
        Coordinates and rates at the end by the forces at the nodes.
    """

    force: Array
    transition: Array
    pushed: Array
    end_by_force: Array


def _solve_steps(omega: Array, h: Array, answers: Array, push: Array, remainder: Array, coupling: Array) -> _Steps:
    """Solve every step for its answers.

    Parameters
    ----------
    omega : ndarray, m x n
        Frequencies of the modes of each step, rad/s.
    h : ndarray, m
        Lengths of the steps, s.
    answers : complex ndarray, m x n x (s + 2) x s
        Responses to forces: see `responses`.
    push : ndarray, m x n x s
        Modal forces at the nodes by the hub's acceleration.
    remainder : ndarray, m x s
        Speed squared at the nodes less its mean.
    coupling : ndarray, m x n x n
        Modal stiffness per unit of speed squared.
    """
    (m, n), s = omega.shape, STAGES
    turned = turning(1j * omega, h[:, None] * np.append(gauss_method(s).nodes, 1.0))
    to_nodes, end_by_force = _from_rest(omega, answers, turned)
    cosine, sine = turned.real, turned.imag / omega[..., None]
    free = np.zeros((m, n, s, 2 * n + 1))
    np.einsum("mnsn->mns", free[..., :n])[...] = cosine[..., :s]
    np.einsum("mnsn->mns", free[..., n:-1])[...] = sine[..., :s]
    pushed = (to_nodes @ push[..., None])[..., 0]
    size = float(np.abs(pushed).max()) or 1.0
    np.divide(pushed, size, out=free[..., -1])
    force = _forces(to_nodes, remainder, coupling, free)
    force[..., -1] *= size
    force[..., -1] += push
    transition = (end_by_force @ force[..., :-1]).reshape(m, n, 2, 2, n)
    own = np.einsum("mnrcn->rcmn", transition)
    own += [[cosine[..., s], sine[..., s]], [-sine[..., s] * omega**2, cosine[..., s]]]
    return _Steps(force, transition, (end_by_force @ force[..., -1:])[..., 0], end_by_force)


def _from_rest(omega: Array, answers: Array, turned: Array) -> tuple[Array, Array]:
    """Return responses from rest to forces at the nodes: coordinates there, m x n x s x s, and `_Steps.end_by_force`."""
    u: Array = turned[..., None] * answers[:, :, :1]
    np.subtract(answers[:, :, 1:], u, out=u)
    z = u.imag / omega[..., None, None]
    return z[:, :, :-1] @ gauss_method(STAGES).terms, np.stack([z[:, :, -1], u.real[:, :, -1]], axis=2) @ gauss_method(
        STAGES
    ).terms


def _forces(to_nodes: Array, remainder: Array, coupling: Array, free: Array) -> Array:
    """Return the forces F by the coupling of the coordinates ``free + to_nodes F``, at the nodes; shape of `free`.

    The columns of `free`, motions without coupling, are to be of about one size.
    """
    m, n, s, columns = free.shape
    factor = -remainder[:, None, :, None]

    def forces(z: Array) -> Array:
        result = (coupling @ z.reshape(m, n, -1)).reshape(free.shape)
        result *= factor
        return result

    force = forces(free)
    for sweep in range(1, _PASSES):
        before, z = force, to_nodes @ force
        z += free
        force = forces(z)
        if sweep >= _FIRST_CHECK:
            before -= force
            if np.vdot(before, before) <= _SETTLED**2 * np.vdot(force, force):
                return force
    system = (to_nodes * remainder[:, None, None])[:, :, :, None] * coupling[:, :, None, :, None]
    system = system.reshape(m, n * s, n * s)
    system.reshape(m, -1)[:, :: n * s + 1] += 1.0
    return forces(np.linalg.solve(system, free.reshape(m, n * s, columns)))


def _run_through(transition: Array, push: Array, start: Array) -> Array:
    """States at the ends of the steps, (m + 1) x 2 n."""
    state = start
    states = [start]
    for turn, gain in zip(transition, push, strict=True):
        state = turn.dot(state)
        state += gain
        states.append(state)
    return np.array(states)
