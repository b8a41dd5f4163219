"""Why no slew was found: the same programme with limits that give, as little as they have to.

Every limit is multiplied by one plus a slack of its own and the sum of the slacks made least (an elastic programme, with
one slack a limit instead of one an instant: Gill, Murray and Saunders 2005). What gives is named, with the instant at
which the limit is first exceeded, the instant at which it is exceeded most, and the value that would do.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.slew.deadline import SlewDeadline, Watch, solved
from boomctl.slew.nlp.transcription import Transcription
from boomctl.slew.problem import AT_LIMIT

_GIVES = 1e-6  # slack above which a limit is said to give: IPOPT leaves 1e-8
_COST_WEIGHT = 1e-7  # of the slew's own cost beside the slacks: it decides between slews that need the same
_MOST = 1e3  # largest slack: what needs more cannot be done
_START = 0.1  # slack to start from; a choice
_MET = 1e-6  # of scaled conditions: what the solver leaves in a programme that is solved
_EXCEEDED = 0.1  # share of the slack above a limit from which the limit counts as exceeded
_OPTIONS = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "error_on_fail": False,
    "ipopt.tol": 1e-8,  # a diagnosis, in three digits
    "ipopt.max_iter": 400,  # a safeguard
    "ipopt.nlp_scaling_method": "none",  # the transcription scales
}


@dataclass(frozen=True)
class Excess:
    """A limit that is too tight for any slew.

    Attributes
    ----------
    kind : str
        "torque", "torque_rate", "speed", "tip" or "moment".
    needed : float
        The limit that would do, with the other limits as they are given or needed; in the unit of the limit.
    first, worst : float
        When it is first exceeded and when most, s.
    """

    kind: str
    needed: float
    first: float
    worst: float


@dataclass(frozen=True, eq=False)
class Relaxed:
    """The least relaxation: what is exceeded, most first, limits that are met and since when [s], the duration [s], and
    the unknowns of the programme."""

    excesses: tuple[Excess, ...]
    met: dict[str, float]
    duration: float
    unknowns: Array


def relaxed(
    t: Transcription,
    arguments: dict[str, Array],
    limits: dict[str, float],
    duration: float | None,
    deadline: SlewDeadline,
) -> Relaxed | None:
    """Solve with limits that give.

    Parameters
    ----------
    t : Transcription
    arguments : dict of str to ndarray
        Bounds, data and start of the programme that failed, by the names of a CasADi solver.
    limits : dict of str to float
        By kind, the torque's first.
    duration : float or None
        s; None if free.
    deadline : SlewDeadline

    Returns
    -------
    Relaxed or None
        None if not even limits that give allow the end state on this mesh.
    """
    layout, kinds = t.layout, list(limits)
    x, p, s = ca.MX.sym("x", layout.size), ca.MX.sym("p", 1 + len(t.scheme.limits)), ca.MX.sym("s", len(kinds))
    widened = [p[1 + i] * (1.0 + s[kinds.index(kind)]) for i, kind in enumerate(t.scheme.limits)]
    cost, g = t.nlp(x, ca.vertcat(p[0], *widened))
    u, most = x[layout.torques.tolist()], limits["torque"] / t.units.torque * (1.0 + s[0])
    nlp = {
        "x": ca.vertcat(x, s),
        "p": p,
        "f": ca.sum1(s) + _COST_WEIGHT * cost,
        "g": ca.vertcat(g, u - most, -u - most),
    }
    lower, upper = arguments["lbx"].copy(), arguments["ubx"].copy()
    inner = layout.torques[1:-1] if t.scheme.ramp else layout.torques
    lower[inner], upper[inner] = -np.inf, np.inf
    count, rows = len(kinds), 2 * layout.torques.size
    watch = Watch(layout.size + count, g.shape[0] + rows)
    solver = ca.nlpsol("relaxed", "ipopt", nlp, _OPTIONS | {"iteration_callback": watch})
    data = {
        "x0": np.append(arguments["x0"], np.full(count, _START)),
        "p": arguments["p"],
        "lbx": np.append(lower, np.zeros(count)),
        "ubx": np.append(upper, np.full(count, _MOST)),
        "lbg": np.append(arguments["lbg"], np.full(rows, -np.inf)),
        "ubg": np.append(arguments["ubg"], np.zeros(rows)),
    }
    raw = solved(solver, watch, data, deadline, f"which limits are too tight, on {t.scheme.intervals} intervals")
    found, g = np.array(raw["x"]).ravel(), np.array(raw["g"]).ravel()
    high, low = arguments["ubg"], arguments["lbg"]
    equal = np.flatnonzero(high == low)
    # conditions other than the limits have to hold, whatever the solver says of itself
    if not np.all(np.isfinite(g)) or np.abs(g[equal] - high[equal]).max() >= _MET:
        return None
    unknowns, slacks = found[: layout.size], dict(zip(kinds, found[layout.size :], strict=True))
    time = float(unknowns[layout.duration]) * t.units.time if duration is None else duration
    given = [k for k in sorted(kinds, key=lambda k: -slacks[k]) if slacks[k] > _GIVES]
    values = _values(t, unknowns, arguments["p"], limits)
    met = {
        k: float(np.argmax(values[k] > AT_LIMIT)) * time / values[k].size
        for k in kinds
        if k not in given and values[k].max() > AT_LIMIT
    }
    return Relaxed(tuple(_excess(k, slacks[k], limits[k], values[k], time) for k in given), met, time, unknowns)


def _values(t: Transcription, x: Array, p: Array, limits: dict[str, float]) -> dict[str, Array]:
    """Each limited quantity over its limit, at the nodes."""
    layout, N = t.layout, t.scheme.intervals
    values = {"torque": np.abs(x[layout.torques]) * t.units.torque / limits["torque"]}
    if len(limits) == 1:
        return values
    g, without = (np.array(t.nlp(x, data)[1]).ravel() for data in (p, np.append(p[0], np.zeros(p.size - 1))))
    size, limit = (each[: t.stages_end].reshape(N, t.stage_rows)[:, t.defects :] for each in (without, without - g))
    shares = size / np.where(limit > 0.0, limit, np.inf)
    for kind in t.scheme.limits:
        own = [j for j, name in enumerate(t.names) if name == f"{kind}_limit"]
        values[kind] = shares[:, own].max(axis=1)
    return values


def _excess(kind: str, slack: float, limit: float, values: Array, duration: float) -> Excess:
    times = np.linspace(0.0, duration, values.size + 1)
    over = np.flatnonzero(values > 1.0 + _EXCEEDED * slack)
    first = int(over[0]) if over.size else int(np.argmax(values))
    return Excess(kind, (1.0 + slack) * limit, float(times[first]), float(times[int(np.argmax(values))]))
