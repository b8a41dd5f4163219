"""Why no slew was found: the same programme with limits that give, as little as they have to.

Every limit is multiplied by one plus a slack of its own and the sum of the slacks made least (an elastic programme, with
one slack a limit instead of one an instant: Gill, Murray and Saunders 2005). What gives is named, with the instant at
which the limit is first exceeded, the instant at which it is exceeded most, and the value that would do.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.nlp.transcription import Transcription

KINDS = ("torque", "rate", "speed", "tip", "moment")
"""Kinds of limits, in the order of the slacks."""
_TINY = 1e-6
_SMALL = 1e-7
_MOST = 1e3


@dataclass(frozen=True)
class Excess:
    """How a limit fails to allow a slew.

    Attributes
    ----------
    kind : str
        "torque", "rate", "speed", "tip" or "moment".
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
    t: Transcription, arguments: dict[str, Array], limits: dict[str, float], duration: float | None
) -> Relaxed | None:
    """Solve with limits that give.

    Parameters
    ----------
    t : Transcription
    arguments : dict of str to ndarray
        Bounds, data and start of the programme that failed, by the names of a CasADi solver.
    limits : dict of str to float
        By kind, the torque's among them.
    duration : float or None
        s; None if free.

    Returns
    -------
    Relaxed or None
        None if not even limits that give allow the end state on this mesh.
    """
    import casadi as ca

    layout, kinds = t.layout, [kind for kind in KINDS if kind in limits]
    x, p, s = ca.MX.sym("x", layout.size), ca.MX.sym("p", 5), ca.MX.sym("s", len(kinds))
    widened = [p[0], *(p[i] * (1.0 + s[kinds.index(k)]) if k in limits else p[i] for i, k in enumerate(KINDS) if i)]
    cost, g = t.nlp(x, ca.vertcat(*widened))
    u, most = x[layout.torques.tolist()], limits["torque"] / layout.torque_unit * (1.0 + s[0])
    nlp = {"x": ca.vertcat(x, s), "p": p, "f": ca.sum1(s) + _SMALL * cost, "g": ca.vertcat(g, u - most, -u - most)}
    lower, upper = arguments["lbx"].copy(), arguments["ubx"].copy()
    inner = layout.torques[1:-1] if t.scheme.ramp else layout.torques
    lower[inner], upper[inner] = -np.inf, np.inf
    count, rows = len(kinds), 2 * layout.torques.size
    raw = ca.nlpsol("relaxed", "ipopt", nlp, _options())(
        x0=np.append(arguments["x0"], np.full(count, 0.1)),
        p=arguments["p"],
        lbx=np.append(lower, np.zeros(count)),
        ubx=np.append(upper, np.full(count, _MOST)),
        lbg=np.append(arguments["lbg"], np.full(rows, -np.inf)),
        ubg=np.append(arguments["ubg"], np.zeros(rows)),
    )
    found = np.array(raw["x"]).ravel()
    if not _kept(np.array(raw["g"]).ravel(), arguments):
        return None
    unknowns, slacks = found[: layout.size], dict(zip(kinds, found[layout.size :], strict=True))
    time = float(unknowns[layout.duration]) * layout.time_unit if duration is None else duration
    given = [k for k in sorted(kinds, key=lambda k: -slacks[k]) if slacks[k] > _TINY]
    values = _values(t, unknowns, arguments["p"], limits)
    met = {
        k: float(np.argmax(values[k] > 0.999)) * time / values[k].size
        for k in kinds
        if k not in given and values[k].max() > 0.999
    }
    return Relaxed(tuple(_excess(k, slacks[k], limits[k], values[k], time) for k in given), met, time, unknowns)


def _options() -> dict[str, Any]:
    quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "error_on_fail": False}
    return quiet | {"ipopt.tol": 1e-8, "ipopt.max_iter": 400, "ipopt.nlp_scaling_method": "none"}


def _kept(g: Array, arguments: dict[str, Array]) -> bool:
    """Whether the conditions other than the limits hold, solver success or not."""
    high, low = arguments["ubg"], arguments["lbg"]
    equal = np.flatnonzero(high == low)
    return bool(np.all(np.isfinite(g)) and np.abs(g[equal] - high[equal]).max() < 1e-6)


def _values(t: Transcription, x: Array, p: Array, limits: dict[str, float]) -> dict[str, Array]:
    """Each limited quantity over its limit, at the nodes."""
    scheme, layout, N = t.scheme, t.layout, t.scheme.intervals
    values = {"torque": np.abs(x[layout.torques]) * layout.torque_unit / limits["torque"]}
    if len(limits) == 1:
        return values
    g = np.array(t.nlp(x, p)[1]).ravel()
    each = (t.count - t.paths - t.ends.shape[0]) // N
    without = np.array(t.nlp(x, np.append(p[0], np.zeros(4)))[1]).ravel()
    size, limit = (a[: each * N].reshape(N, each)[:, t.defects :] for a in (without, without - g))
    shares = size / np.where(limit > 0.0, limit, np.inf)
    for kind in limits:
        own = [j for j, name in enumerate(t.names) if name.endswith(f"{kind}_limit") and kind != "torque"]
        if own:
            values[kind] = shares[:, own].max(axis=1)
    if scheme.ramp and "rate" in limits:
        step = np.diff(x[layout.torques])
        own = [j for j, name in enumerate(t.names) if name == "torque_rate_limit"]
        values["rate"] = np.abs(step) / limit[:, own[0]]
    return values


def _excess(kind: str, slack: float, limit: float, values: Array, duration: float) -> Excess:
    times = np.linspace(0.0, duration, values.size + 1)
    over = np.flatnonzero(values > 1.0 + 0.1 * slack)
    first = int(over[0]) if over.size else int(np.argmax(values))
    return Excess(kind, (1.0 + slack) * limit, float(times[first]), float(times[int(np.argmax(values))]))
