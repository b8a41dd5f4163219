"""Gauss collocation in coordinates and momenta: symplectic, of order 2 s, stable however stiff the axial part.

The unknowns of a step are the velocities ``V_i`` at the stages; with ``Q_i = q_0 + h sum_j a_ij V_j``,

    p(Q_i, V_i) - p_0 - h sum_j a_ij g(Q_j, V_j, t_j) = 0,

where ``p`` is the momentum and ``g`` the force. Because positions and *momenta* are collocated, angular momentum is
conserved to rounding error and energy without drift (Hairer, Lubich & Wanner 2006, IV.2.1 and IX.8); accelerations never
appear. The steps are of equal length between the times at which the drive is not smooth.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import CollocationMethod, gauss_method
from boomctl.lti.rounding import DEPENDENT
from boomctl.maneuvers import Maneuver, PrescribedMotion
from boomctl.progress import tell
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.result import CHUNK

STAGES = 4  # Stages of the collocation, order 8.
_MAX_ITERATIONS = 15  # Iterations of Newton's method.
_SETTLED = 1e-15  # last correction times contraction, relative to the motion, at which a step is solved
_STALLED = 0.5  # contraction above which corrections no longer shrink
_SLOW = 0.05  # contraction above which the frozen Jacobian is updated
_HOPELESS = 0.7  # contraction above which a frozen Jacobian is given up for a fresh one


class StepFailedError(Exception):
    """No convergence in one step: the step is too long."""


@final
@dataclass(frozen=True, eq=False)
class Trajectory:
    """States at the ends of equal steps: ``time`` (k,), ``q`` and ``v`` (k, coordinates)."""

    time: Array
    q: Array
    v: Array


def march(
    dynamics: ExactBeamDynamics,
    maneuver: Maneuver,
    times: Array,
    state: tuple[Array, Array],
) -> Trajectory:
    """Integrate in equal steps.

    Parameters
    ----------
    dynamics : ExactBeamDynamics
    maneuver : PrescribedMotion or TorqueDriven
        Smooth over the steps.
    times : ndarray, k
        Ends of the steps, equally spaced, s.
    state : pair of ndarray, n
        Coordinates and velocities at ``times[0]``.

    Returns
    -------
    Trajectory
        States at ``times``.

    Raises
    ------
    StepFailedError
        If Newton's method does not converge in a step.
    """
    rule, (q, v) = gauss_method(STAGES), state
    h = (times[-1] - times[0]) / (times.size - 1)
    nodes = times[:-1, None] + h * rule.nodes
    prescribed = isinstance(maneuver, PrescribedMotion)
    hub = np.stack([maneuver.angle(nodes), maneuver.speed(nodes)], 1) if prescribed else None
    torque = None if prescribed else maneuver.torque(nodes)
    p = dynamics.momentum_and_force(q, v)[0]
    guess = np.tile(v, (rule.stages, 1))
    states, momenta = np.tile(q, (times.size, 1)), np.tile(p, (times.size, 1))
    frozen: Array | None = None
    stage = f"steps of {h:.2g} s"
    for k in range(times.size - 1):
        tell(stage, k, times.size - 1)
        step = _Step(
            dynamics=dynamics,
            rule=rule,
            h=h,
            q=q,
            p=p,
            torque=None if torque is None else torque[k],
            hub=None if hub is None else hub[k],
            first=1 if prescribed else 0,
        )
        frozen = step.frozen_inverse(guess) if frozen is None else frozen
        # in this order: the inexpensive Jacobian of an earlier step; a new one in each iteration; a calm start
        solved = step.solve(guess, frozen) or step.solve(guess, None) or step.solve(step.calm_guess(), None)
        if solved is None:
            raise StepFailedError(f"a step of {h:.3g} s at t = {times[k]:.6g} s did not converge")
        frozen = frozen if solved.contraction < _SLOW else None
        q, p = q + h * (rule.weights @ solved.velocities), p + h * (rule.weights @ solved.force)
        states[k + 1], momenta[k + 1] = q, p
        guess = rule.onward @ solved.velocities
    if prescribed:
        states[:, 0] = maneuver.angle(times)
    speed = maneuver.speed(times) if prescribed else None
    return Trajectory(times, states, _velocities(dynamics, speed, states, momenta))


@final
@dataclass(frozen=True, eq=False)
class _Solved:
    """Velocities and forces at the stages, and how fast the iteration contracted."""

    velocities: Array
    force: Array
    contraction: float


@final
@dataclass(frozen=True, eq=False)
class _Step:
    """The nonlinear equations of one step: ``q`` and ``p`` at its start; at its stages the torque, or the hub's motion.

    ``first`` is the index of the first free coordinate: 0 if the hub is free, else 1.
    """

    dynamics: ExactBeamDynamics
    rule: CollocationMethod
    h: float
    q: Array
    p: Array
    torque: Array | None
    hub: Array | None
    first: int

    def stages(self, velocities: Array) -> tuple[Array, Array]:
        """Coordinates and velocities at the stages, the prescribed ones as prescribed."""
        if self.hub is None:
            return self.q + self.h * (self.rule.A @ velocities), velocities
        velocities[:, 0] = self.hub[1]
        q = self.q + self.h * (self.rule.A @ velocities)
        q[:, 0] = self.hub[0]
        return q, velocities

    def residual(self, velocities: Array) -> tuple[Array, Array]:
        """Residual at the free coordinates, and the forces at the stages."""
        momentum, force = self.dynamics.momentum_and_force(*self.stages(velocities))
        if self.torque is not None:
            force[:, 0] += self.torque
        return (momentum - self.p - self.h * (self.rule.A @ force))[:, self.first :], force

    def solve(self, guess: Array, frozen: Array | None) -> _Solved | None:
        """Newton's method from ``guess``, with a frozen Jacobian or a fresh one each time; None if it fails."""
        velocities, last, contraction = guess.copy(), np.inf, 0.0
        for iteration in range(_MAX_ITERATIONS):
            residual, _ = self.residual(velocities)
            inverse = self.jacobian_inverse(velocities) if frozen is None else frozen
            change = (inverse @ residual.ravel()).reshape(residual.shape)
            size, motion = _size(self.dynamics, change, self.first), _size(self.dynamics, velocities, 0)
            if not np.isfinite(size):
                return None
            contraction = size / last if iteration and last > 0.0 else 0.0
            noise = size <= DEPENDENT * motion and contraction > _STALLED
            if size == 0.0 or noise or (iteration and contraction * size <= _SETTLED * motion):
                velocities[:, self.first :] -= 0.0 if noise else change
                return _Solved(velocities, self.residual(velocities)[1], 0.0 if noise else contraction)
            if frozen is not None and iteration > 2 and contraction > _HOPELESS:
                return None
            velocities[:, self.first :] -= change
            last = size
        return None

    def frozen_inverse(self, guess: Array) -> Array:
        """Inverse of the Jacobian with the same matrices at all stages: those in the middle of the step."""
        middle = guess.mean(axis=0)
        one = self.dynamics.linearization(self.q + 0.5 * self.h * middle, middle)
        return self._inverse(*(np.broadcast_to(m, (self.rule.stages, *m.shape)) for m in one))

    def jacobian_inverse(self, velocities: Array) -> Array:
        """Inverse of the exact Jacobian over all stages."""
        return self._inverse(*self.dynamics.linearization(*self.stages(velocities)))

    def _inverse(self, mass: Array, coupling: Array, stiffness: Array) -> Array:
        a, h, own = self.rule.A, self.h, slice(self.first, None)
        back = np.swapaxes(coupling, -1, -2)
        if self.dynamics.damping is not None:
            back = back - self.dynamics.damping
        blocks = h * (a[:, :, None, None] * (coupling[:, None] - back[None, :]))
        blocks += h**2 * np.einsum("il,lj,lxy->ijxy", a, a, stiffness)
        for i in range(a.shape[0]):
            blocks[i, i] += mass[i]
        size = a.shape[0] * (mass.shape[-1] - self.first)
        return np.linalg.inv(blocks[:, :, own, own].transpose(0, 2, 1, 3).reshape(size, size))

    def calm_guess(self) -> Array:
        """Return the velocity at the start of the step, at every stage."""
        speed = None if self.hub is None else self.hub[1, :1]
        return np.tile(_velocities(self.dynamics, speed, self.q[None], self.p[None]), (self.rule.stages, 1))


def _size(dynamics: ExactBeamDynamics, velocities: Array, first: int) -> float:
    """Length of stage velocities (from coordinate ``first`` on) in the mass matrix of the undeformed beam."""
    return float(np.sqrt(np.vdot(velocities @ dynamics.rest_mass[first:, first:], velocities)))


def _velocities(dynamics: ExactBeamDynamics, speed: Array | None, q: Array, p: Array) -> Array:
    """Velocities from momenta, ``M(q) v = p``, the hub's speed as given if it is."""
    v, first = np.empty_like(q), 0 if speed is None else 1
    for chunk in np.array_split(np.arange(len(q)), max(1, len(q) // CHUNK)):
        mass, right = dynamics.mass_matrix(q[chunk]), p[chunk]
        if speed is not None:
            v[chunk, 0] = speed[chunk]
            right = right[:, 1:] - mass[:, 1:, 0] * v[chunk, :1]
        v[chunk, first:] = np.linalg.solve(mass[:, first:, first:], right[..., None])[..., 0]
    return v
