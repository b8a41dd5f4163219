"""Least effort of a plant within its limits: a torque held on equal intervals.

Torques u lead to a terminal state e(u), with limits at the nodes of the mesh. For the linearization about a torque, the
least effort is a closed form, clipped at the torque limit, with one unknown per terminal condition and active limit. It is
iterated (Gauss-Newton method) and converges fast, since the nonlinearity of a slew is weak. At convergence ``u = clip(G^T
c)`` leads to the target: these are the exact optimality conditions on the mesh. A nonlinear program takes ten times as long.
"""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.slew.end_map import CHORDS, MOST_STEPS, STEP_FRACTION, EndMap, Steps, end_map
from boomctl.slew.linear import Clipped, clipped, least_effort
from boomctl.slew.problem import RTOL, Limits, SlewProblem
from boomctl.slew.torque import TorqueProfile, held

_TURNS = 20  # Gauss-Newton iterations at most
_EXCHANGES = 100  # exchanges of the active set at most; 3 to 12 are usual
_CLOSED = 1e-3  # residual of the scaled terminal conditions at which they end, as a fraction of the tolerance


@dataclass(frozen=True, eq=False)
class _Local:
    """Linearized least effort: ``G u = d``, and ``|P u + rest| <= most`` at the inner nodes of the mesh, r x (N - 1) x N."""

    G: Array
    d: Array
    P: Array
    rest: Array
    most: Array

    def joined(self, first: Array) -> "_Local":
        """Return the problem for torques that begin with some of the intervals and are held until the next one begins."""
        root = np.sqrt(np.diff(np.append(first, self.G.shape[1])))
        inner = first[1:] - 1
        G, P = (np.add.reduceat(item, first, axis=-1) / root for item in (self.G, self.P[:, inner]))
        return _Local(G, self.d, P, self.rest[:, inner], self.most)

    def solve(self, limit: float | Array, met: Array) -> tuple[Clipped, Array] | None:
        """Return the torques and the active set of limits: 1 above, -1 below, 0 where inactive, r x (N - 1).

        Local maxima above a limit enter the active set, nodes whose multiplier has the wrong sign leave it, all at once.
        None if this does not converge, or not to the target.
        """
        for _ in range(_EXCHANGES):
            at = np.nonzero(met)
            rows, wanted = self.P[at], met[at] * self.most[at[0]] - self.rest[at]
            result = clipped(np.vstack([self.G, rows]), np.concatenate([self.d, wanted]), limit)
            if result.residual > ALIKE:
                return None
            if not len(self.P):
                return result, met
            values = self.P @ result.torques + self.rest
            size = np.pad(np.where(met == 0.0, np.abs(values), 0.0), ((0, 0), (1, 1)))
            peak = (size[:, 1:-1] >= size[:, :-2]) & (size[:, 1:-1] > size[:, 2:])
            following = np.where(peak & (size[:, 1:-1] > self.most[:, None] * (1.0 + SUMMED)), np.sign(values), met)
            following[at] = np.where(met[at] * result.weights[self.G.shape[0] :] <= 0.0, met[at], 0.0)
            if np.array_equal(following, met):
                return result, met
            met = following
        return None


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Equal intervals of a slew, and rows over the states, r x n, whose modulus is limited at the inner nodes."""

    ends: EndMap
    duration: float
    intervals: int
    lines: Array
    most: Array
    limit: float

    def steps(self, u: Array, parts: int) -> Steps:
        """Return steps: every interval in equal parts."""
        count = self.intervals * parts
        return Steps(np.repeat(u, parts), np.full(count, self.duration / count), np.zeros((count, 0)))

    def about(self, u: Array, parts: int) -> _Local:
        """Return the least effort linearized about torques."""
        reached = self.ends.sensitivity(self.steps(u, parts))
        G = reached.by_torque.reshape(-1, self.intervals, parts).sum(axis=2)
        shape = len(self.lines), self.intervals - 1
        values, P = np.zeros(shape), np.zeros((*shape, self.intervals))
        motions = reached.motions if len(self.lines) else ()
        for (z, jacobians), (plant, own) in zip(motions, self.ends.problem.parts, strict=False):
            values += self.lines[:, own] @ z[:, parts:-1:parts]
            moved = np.zeros((plant.n, self.intervals))
            for k in range(shape[1] * parts):
                moved = jacobians[k, :, : plant.n] @ moved
                moved[:, k // parts] += jacobians[k, :, plant.n]
                if (k + 1) % parts == 0:
                    P[:, k // parts] += self.lines[:, own] @ moved
        return _Local(G, G @ u + self.ends.target - reached.end, P, values - P @ u, self.most)

    def best(self, u: Array, met: Array, parts: int) -> tuple[_Local, Clipped, Array] | None:
        """Return the stationary torques with their linearization and active set; None if the iteration does not converge."""
        size = np.inf
        for _ in range(_TURNS):
            local = self.about(u, parts)
            answer = local.solve(self.limit, met) if np.isfinite(local.G).all() else None
            if answer is None:
                return None
            result, met = answer
            before, size = size, float(np.abs(result.torques - u).max()) / self.limit
            if size > before:
                return None
            u = result.torques
            if size * (size / before if before < np.inf else 1.0) <= RTOL:  # predicted next change
                return local, result, met
        return None

    def led(self, local: _Local, result: Clipped, met: Array, parts: int) -> tuple[Clipped, float, float]:
        """Correct torques for other steps by the same derivatives; return them and the end residual before and after."""
        at = np.nonzero(met)
        rows, values = np.vstack([local.G, local.P[at]]), met[at] * self.most[at[0]] - local.rest[at]
        defects = [self.ends.defect(self.steps(result.torques, parts))]
        while np.abs(defects[-1]).max() > _CLOSED * self.ends.problem.planning_rtol and len(defects) <= CHORDS:
            wanted = np.concatenate([local.G @ result.torques - defects[-1], values])
            result = clipped(rows, wanted, self.limit, result.weights)
            defects.append(self.ends.defect(self.steps(result.torques, parts)))
        return result, float(np.abs(defects[0]).max()), float(np.abs(defects[-1]).max())


@dataclass(frozen=True, eq=False)
class HeldEffort:
    """The torque of least effort on a mesh.

    Attributes
    ----------
    profile : TorqueProfile
    more : float
        Relative increase of the effort if the torque is held on pairs of intervals, by the derivatives along its motion;
        infinite if that does not lead to the terminal state.
    met : ndarray, r x (N - 1)
        Active set of limits at the nodes: 1 above, -1 below, 0 where inactive.
    """

    profile: TorqueProfile
    more: float
    met: Array


def effort_on_mesh(
    problem: SlewProblem, duration: float, intervals: int, limits: Limits, before: HeldEffort | None = None
) -> HeldEffort | None:
    """Compute the torque of least effort for a duration [s] on a mesh; None without convergence, or if a limit is too low.

    Steps are halved until the terminal state changes by less than the tolerance.

    Parameters
    ----------
    problem : SlewProblem
    duration : float
        s.
    intervals : int
    limits : Limits
        Limits that may be tighter than the problem's, to satisfy those between the nodes too.
    before : HeldEffort, optional
        Solution for other limits on the same mesh, as the starting point.
    """
    first = least_effort(problem, duration, intervals).profile if before is None else before.profile
    watched = [(kind, part) for kind in limits.without_torque for part in problem.parts]
    lines = np.zeros((len(watched), problem.start.size))
    for line, (kind, (plant, own)) in zip(lines, watched, strict=True):
        line[own] = plant.rows[kind]
    most = np.array([limits.most(kind) for kind, _ in watched])
    mesh = _Mesh(end_map(problem, first), duration, intervals, lines, most, limits.torque)
    parts = max(1, int(np.ceil(duration * mesh.ends.step_frequency / intervals)))
    met = np.zeros((len(lines), intervals - 1)) if before is None else before.met
    answer = mesh.best(first.start_values, met, parts)
    if answer is None:
        return None
    local, result, met = answer
    error = np.inf
    while error > STEP_FRACTION * problem.planning_rtol:
        parts *= 2
        if parts * intervals > MOST_STEPS:
            return None
        result, error, left = mesh.led(local, result, met, parts)
        if not left <= STEP_FRACTION * problem.planning_rtol:
            return None
    pairs = np.arange(0, intervals, 2)
    joined = replace(local, d=local.G @ result.torques).joined(pairs)
    root = np.sqrt(np.diff(np.append(pairs, intervals)))
    fewer = joined.solve(limits.torque * root, met[:, pairs[1:] - 1])
    more = np.inf if fewer is None else float(np.sum(fewer[0].torques ** 2) / np.sum(result.torques**2)) - 1.0
    return HeldEffort(held(np.linspace(0.0, duration, intervals + 1), result.torques), more, met)
