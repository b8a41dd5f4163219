"""References of slews: a replay to rounding, the least effort of any torque, and the least time of a bang-bang one.

Nothing here shares code with the package's own planning and replay: the equations are those that CasADi derives from the
energies, motions are extrapolated, optimization problems are ``casadi.Opti``'s.
"""

from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import root

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.slews import Slew, opti_torque
from boomctl.lab.benchmark.references.extrapolation import extrapolated_step
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.torque import TorqueHistory

_PHASE = 1.0  # rad: of the highest mode in a step of the replay; order 16 leaves 1e-15 of that
_SUBSTEPS = 4  # of RK4 an interval: 1e-7 of the effort with 200 intervals and three modes (measured)
_ARCS = 20  # steps an arc of a bang-bang torque: each well below a radian of the highest mode
_CLOSED = 1e-11  # of the end of a bang-bang slew: rounding


@cache
def _step(beam: AssumedModesBeam) -> Any:
    """Return the function of state, held torque [N m] and step [s]."""
    import casadi as ca

    f, x, u, h = beam.casadi_function(), ca.SX.sym("x", 2 * beam.equations.size), ca.SX.sym("u"), ca.SX.sym("h")
    return ca.Function("step", [x, u, h], [extrapolated_step(lambda a, _: f(a, u)[0], x, 0.0, h)])


def _end(beam: AssumedModesBeam, torques: Array, lengths: Array, substeps: int) -> Array:
    """Return the state after intervals of some lengths [s] on each of which a torque [N m] is held."""
    state = np.zeros(2 * beam.equations.size)
    for torque, length in zip(torques, lengths, strict=True):
        for _ in range(substeps):
            state = _step(beam)(state, torque, length / substeps)
    return np.array(state).ravel()


def end_error(slew: Slew, history: TorqueHistory) -> float:
    """Return by how much a held torque misses the end: the largest of angle [rad], hub speed [rad/s] and tip [m].

    Raises
    ------
    ValueError
        The torque is not held on its intervals.
    """
    if np.any(history.left != history.right):
        raise ValueError("history: expected a torque that is held on each interval")
    size, lengths = slew.beam.equations.size, np.diff(history.edges)
    substeps = int(np.ceil(lengths.max() * slew.beam.equations.frequency_range[1] / _PHASE))
    end = _end(slew.beam, history.left, lengths, substeps)
    tip = slew.beam.equations.tip.transverse @ end[1:size]
    return float(max(abs(end[0] - slew.angle), abs(end[size]), abs(tip)))


def least_effort(slew: Slew, intervals: int) -> float:
    """Return the least integral of the torque squared of any torque, not only of held ones [N^2 m^2 s].

    It is extrapolated from so many intervals and half as many: the excess of held torques falls with the square of their
    length.
    """
    coarse, fine = (opti_torque(slew.on(n), _SUBSTEPS).effort for n in (intervals // 2, intervals))
    return fine - (coarse - fine) / 3.0


def least_time(slew: Slew, intervals: int) -> float:
    """Return the duration [s] of the bang-bang torque with as many arcs as states, found near Opti's.

    Raises
    ------
    RuntimeError
        Opti's has another number of arcs, or the durations do not lead to the end.
    """
    found = opti_torque(slew.on(intervals), _SUBSTEPS, fastest=True)
    shares, h = found.left / slew.torque_limit, found.duration / intervals
    signs = np.sign(shares)
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    # the momentum up to a turn tells where within the two intervals at it the torque changes its sign
    parts = shares[turns] - signs[turns] + shares[turns + 1] + signs[turns]
    switches = h * (turns + 1.0 + 0.5 * signs[turns] * parts)
    lengths = np.diff(np.concatenate([[0.0], switches, [found.duration]]))
    if lengths.size != slew.target.size:
        raise RuntimeError(f"{lengths.size} arcs for {slew.target.size} states")
    torques = slew.torque_limit * signs[0] * (-1.0) ** np.arange(lengths.size)
    exact = root(lambda d: _end(slew.beam, torques, d, _ARCS) - slew.target, lengths, tol=_CLOSED)
    if np.abs(exact.fun).max() > 1e2 * _CLOSED or exact.x.min() <= 0.0:
        raise RuntimeError(f"the end is missed by {np.abs(exact.fun).max():.1e}")
    return float(exact.x.sum())
