"""Least effort of a plant within its limits: a torque held on equal intervals.

Torques u lead to an end e(u), and on the way past nodes with limits. About any of them the least effort that the first
derivatives allow is a closed form, clipped at the torque's limit, with as many unknowns as the end has conditions and
limits are met at nodes; it is taken again and again (Gauss and Newton's method). What is not linear in a slew is weak: each
turn gains two digits (measured, also with tips that go out to half of the length). Where it ends, ``u = clip(G^T c)`` leads
to the target: the conditions of the optimum on the mesh. They are exact, for G is. A programme takes ten times as long.
"""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.slew.end_map import MOST_STEPS, STEP_SHARE, EndMap, Steps, end_map
from boomctl.slew.linear import Clipped, clipped, least_effort
from boomctl.slew.problem import Limits, SlewProblem
from boomctl.slew.torque import TorqueProfile, held

_TURNS = 20  # at most; a safeguard
_STATIONARY = 1e-6  # of the torque limit, that another turn would change: of the effort it is worth the square of that
_EXCHANGES = 100  # of nodes at which limits are met, at most; a safeguard, for 3 to 12 do
# Exchanges of all nodes without fewer that are wrong, until they are exchanged one at a time.  Where a limit is met all along
# an arc, twice as many nodes follow each time: 3 would do for 15 of them, 6 do for 100 (a choice)
_PATIENCE = 6
_CHORDS = 6  # corrections with derivatives of coarser steps at most; one or none does
_CLOSED = 1e-3  # of the tolerance: defect of the scaled end after them


@dataclass(frozen=True, eq=False)
class _Local:
    """Least effort about torques: ``G u = d``, and ``|P u + rest| <= most`` at the nodes within the mesh, r x (N - 1) x N."""

    G: Array
    d: Array
    P: Array
    rest: Array
    most: Array

    def joined(self, first: Array) -> "_Local":
        """Torques that begin with some of the intervals and are held until the next one begins."""
        root = np.sqrt(np.diff(np.append(first, self.G.shape[1])))
        inner = first[1:] - 1
        G, P = (np.add.reduceat(item, first, axis=-1) / root for item in (self.G, self.P[:, inner]))
        return _Local(G, self.d, P, self.rest[:, inner], self.most)

    def solve(self, limit: float | Array, met: Array) -> tuple[Clipped, Array] | None:
        """The torques, and the nodes at which limits are met: 1 above, -1 below, 0 where they are not, r x (N - 1).

        Where limits are exceeded most they are met next, those whose multiplier has the wrong sign are left: all at once,
        and where that turns in circles one at a time (Judice and Pires 1994). None where it does not end, or not at the
        target.
        """
        fewest, patience = np.inf, _PATIENCE
        for _ in range(_EXCHANGES):
            at = np.nonzero(met)
            rows, wanted = self.P[at], met[at] * self.most[at[0]] - self.rest[at]
            result = clipped(np.vstack([self.G, rows]), np.concatenate([self.d, wanted]), limit)
            if result.missed > ALIKE:
                return None
            if not len(self.P):
                return result, met
            values = self.P @ result.torques + self.rest
            size = np.pad(np.where(met == 0.0, np.abs(values), 0.0), ((0, 0), (1, 1)))
            peak = (size[:, 1:-1] >= size[:, :-2]) & (size[:, 1:-1] > size[:, 2:])
            following = np.where(peak & (size[:, 1:-1] > self.most[:, None] * (1.0 + SUMMED)), np.sign(values), met)
            following[at] = np.where(met[at] * result.weights[self.G.shape[0] :] <= 0.0, met[at], 0.0)
            changes = np.argwhere(following != met)
            if not len(changes):
                return result, met
            fewest, patience = (len(changes), _PATIENCE) if len(changes) < fewest else (fewest, patience - 1)
            if patience < 0:
                last = tuple(changes[-1])
                following, met = met.copy(), following
                following[last] = met[last]
            met = following
        return None


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Equal intervals of a slew, and lines over the states, r x n, whose size is limited at the nodes within."""

    ends: EndMap
    duration: float
    intervals: int
    lines: Array
    most: Array
    limit: float

    def steps(self, u: Array, parts: int) -> Steps:
        """Each interval in equal parts."""
        count = self.intervals * parts
        return Steps(np.repeat(u, parts), np.full(count, self.duration / count), np.zeros((count, 0)))

    def about(self, u: Array, parts: int) -> _Local:
        """Least effort about torques."""
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
        """The torques at which another turn changes nothing, with what is known about them; None where it never ends."""
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
            if size * (size / before if before < np.inf else 1.0) <= _STATIONARY:  # what the next turn would change
                return local, result, met
        return None

    def led(self, local: _Local, found: Clipped, met: Array, parts: int) -> tuple[Clipped, float, float]:
        """Torques led to the end of other steps by the same derivatives; its defect before and after."""
        at = np.nonzero(met)
        rows, values = np.vstack([local.G, local.P[at]]), met[at] * self.most[at[0]] - local.rest[at]
        defects = [self.ends.defect(self.steps(found.torques, parts))]
        while np.abs(defects[-1]).max() > _CLOSED * self.ends.problem.planning_rtol and len(defects) <= _CHORDS:
            wanted = np.concatenate([local.G @ found.torques - defects[-1], values])
            found = clipped(rows, wanted, self.limit, found.weights)
            defects.append(self.ends.defect(self.steps(found.torques, parts)))
        return found, float(np.abs(defects[0]).max()), float(np.abs(defects[-1]).max())


@dataclass(frozen=True, eq=False)
class HeldEffort:
    """The torque of least effort on a mesh.

    Attributes
    ----------
    history : TorqueProfile
    more : float
        By how much more effort it would take, relative, if it were held on two intervals at a time: by the derivatives
        along its motion, infinite where that does not lead to the end.
    met : ndarray, r x (N - 1)
        Nodes at which limits are met: 1 above, -1 below, 0 where they are not.
    """

    history: TorqueProfile
    more: float
    met: Array


def effort_on_mesh(
    problem: SlewProblem, duration: float, intervals: int, limits: Limits, before: HeldEffort | None = None
) -> HeldEffort | None:
    """The torque of least effort in a given time [s] on a mesh; None where it was not found, or a limit is too low.

    Steps are halved until the end stays where it is, within the tolerance.

    Parameters
    ----------
    problem : SlewProblem
    duration : float
        s.
    intervals : int
    limits : Limits
        Tighter ones than the problem's, which keep the motion within those between the nodes too.
    before : HeldEffort, optional
        With other limits on the same mesh: where to begin.
    """
    first = least_effort(problem, duration, intervals).history if before is None else before.history
    watched = [(kind, part) for kind in limits.beside_torque for part in problem.parts]
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
    missed = np.inf
    while missed > STEP_SHARE * problem.planning_rtol:
        parts *= 2
        if parts * intervals > MOST_STEPS:
            return None
        result, missed, left = mesh.led(local, result, met, parts)
        if not left <= STEP_SHARE * problem.planning_rtol:
            return None
    pairs = np.arange(0, intervals, 2)
    joined = replace(local, d=local.G @ result.torques).joined(pairs)
    root = np.sqrt(np.diff(np.append(pairs, intervals)))
    fewer = joined.solve(limits.torque * root, met[:, pairs[1:] - 1])
    more = np.inf if fewer is None else float(np.sum(fewer[0].torques ** 2) / np.sum(result.torques**2)) - 1.0
    return HeldEffort(held(np.linspace(0.0, duration, intervals + 1), result.torques), more, met)
