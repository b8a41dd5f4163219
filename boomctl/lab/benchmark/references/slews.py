"""By what slews are judged: a replay to rounding, the least effort of any torque, and the least time of a bang-bang one.

Nothing here shares code with the package's own planning and replay: the equations are those that CasADi derives from the
energies, motions are extrapolated, programmes are `casadi.Opti`'s.
"""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.opti import Effort, Failed, opti_programme
from boomctl.lab.benchmark.references.extrapolation import extrapolated_step
from boomctl.slew.torque import TorqueHistory

_PHASE = 1.0  # rad: of the highest mode in a step of the replay; order 16 leaves 1e-15 of that
_SUBSTEPS = 4  # of RK4 an interval in a reference: 1e-7 of the effort with 200 intervals and three modes (measured)
_ARCS = 20  # steps an arc of a bang-bang torque: each well below a radian of the highest mode
_CLOSED = 1e-11  # of the end of a bang-bang slew: rounding


class Referee:
    """Replays torques on a beam.

    Parameters
    ----------
    effort : Effort
        Whose beam is turned, and to which angle.
    """

    def __init__(self, effort: Effort) -> None:
        self.effort = effort

    @cached_property
    def _step(self) -> Any:
        """Function of state, held torque [N m] and step [s]."""
        import casadi as ca

        f, n = self.effort.beam.casadi_function(), self.effort.target.size
        x, u, h = ca.SX.sym("x", n), ca.SX.sym("u"), ca.SX.sym("h")
        return ca.Function("step", [x, u, h], [extrapolated_step(lambda a, _: f(a, u)[0], x, 0.0, h)])

    def end(self, torques: Array, lengths: Array, substeps: int) -> Array:
        """Return the state after intervals of some lengths [s] on each of which a torque [N m] is held."""
        state = np.zeros(self.effort.target.size)
        for torque, length in zip(torques, lengths, strict=True):
            for _ in range(substeps):
                state = self._step(state, torque, length / substeps)
        return np.array(state).ravel()

    def miss(self, history: TorqueHistory) -> float:
        """Return by how much a held torque misses the end: the largest of angle [rad], hub speed [rad/s] and tip [m].

        Raises
        ------
        ValueError
            The torque is not held on its intervals.
        """
        if np.any(history.left != history.right):
            raise ValueError("history: expected a torque that is held on each interval")
        beam, size = self.effort.beam, self.effort.beam.equations.size
        lengths = np.diff(history.edges)
        substeps = int(np.ceil(lengths.max() * beam.equations.frequency_range[1] / _PHASE))
        end = self.end(history.left, lengths, substeps)
        tip = beam.equations.tip.transverse @ end[1:size]
        return float(max(abs(end[0] - self.effort.angle), abs(end[size]), abs(tip)))

    def least_effort(self) -> float:
        """Return the least integral of the torque squared of any torque, not only of held ones [N^2 m^2 s].

        It is extrapolated from half as many intervals and as many as `effort` has: the excess of held torques falls with
        the square of their length.
        """
        coarse, fine = (
            self._held(replace(self.effort, intervals=n)).effort
            for n in (self.effort.intervals // 2, self.effort.intervals)
        )
        return fine - (coarse - fine) / 3.0

    @staticmethod
    def _held(effort: Effort) -> TorqueHistory:
        programme = opti_programme(effort, _SUBSTEPS, mapped=True)
        return programme.torque(programme.solve(effort.angle))

    def least_time(self) -> float:
        """Return the duration [s] of the bang-bang torque with as many arcs as states, found near `Opti`'s.

        Raises
        ------
        Failed
            `Opti`'s has another number of arcs, or the durations do not come to the end.
        """
        from scipy.optimize import root

        programme = opti_programme(self.effort, _SUBSTEPS, mapped=True, fastest=True)
        found = programme.torque(programme.solve(self.effort.angle))
        limit, h = self.effort.torque_limit, found.duration / self.effort.intervals
        shares = found.left / limit
        signs = np.sign(shares)
        turns = np.flatnonzero(signs[1:] != signs[:-1])
        # the momentum up to a turn tells where within the two intervals beside it the torque changes its sign
        switches = np.array([
            h * (k + 1.0 + 0.5 * signs[k] * (shares[k] - signs[k] + shares[k + 1] + signs[k])) for k in turns
        ])  # fmt: skip
        lengths = np.diff(np.concatenate([[0.0], switches, [found.duration]]))
        if lengths.size != self.effort.target.size:
            raise Failed(f"{lengths.size} arcs for {self.effort.target.size} states")
        torques = limit * signs[0] * (-1.0) ** np.arange(lengths.size)
        exact = root(lambda d: self.end(torques, d, _ARCS) - self.effort.target, lengths, tol=_CLOSED)
        if np.abs(exact.fun).max() > 1e2 * _CLOSED or exact.x.min() <= 0.0:
            raise Failed(f"the end is missed by {np.abs(exact.fun).max():.1e}")
        return float(exact.x.sum())
