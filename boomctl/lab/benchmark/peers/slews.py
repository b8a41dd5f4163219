"""The same slews as others would write them: RK4 multiple shooting in ``casadi.Opti``, mapped over the intervals."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.torque import TorqueHistory, held

# IPOPT's options: silent, and solved until the objective no longer limits what errors are compared
_QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-10}


@dataclass(frozen=True)
class Slew:
    """A rest-to-rest slew: the torque is held on equal intervals; ``duration`` [s] is a first guess where it is least."""

    beam: AssumedModesBeam
    angle: float
    torque_limit: float
    duration: float
    intervals: int = 100

    @property
    def target(self) -> Array:
        """State at the end."""
        state = np.zeros(2 * self.beam.equations.size)
        state[0] = self.angle
        return state

    def on(self, intervals: int) -> "Slew":
        """Return the slew on another mesh."""
        return replace(self, intervals=intervals)


def opti_torque(slew: Slew, substeps: int = 1, fastest: bool = False) -> TorqueHistory:
    """Return the torque of least effort, or of least time, with some RK4 steps an interval.

    Raises
    ------
    RuntimeError
        IPOPT ends without a solution.
    """
    import casadi as ca

    f, n, N, limit = slew.beam.casadi_function(), slew.target.size, slew.intervals, slew.torque_limit
    x, u, t = ca.SX.sym("x", n), ca.SX.sym("u"), ca.SX.sym("t")
    step = ca.Function("step", [x, u, t], [_rk4(lambda a: f(a, u)[0], x, t / N / substeps, substeps)])
    opti = ca.Opti()
    X, U = opti.variable(n, N + 1), opti.variable(1, N)
    T = opti.variable() if fastest else slew.duration
    opti.subject_to(X[:, 1:] == step.map(N)(X[:, :-1], U * limit, ca.repmat(ca.MX(T), 1, N)))
    opti.subject_to(X[:, 0] == 0.0)
    opti.subject_to(X[:, N] == slew.target)
    opti.subject_to(opti.bounded(-1.0, U, 1.0))
    s = np.linspace(0.0, 1.0, N + 1)
    opti.set_initial(X[0, :], slew.angle * (3.0 * s**2 - 2.0 * s**3))
    opti.set_initial(X[n // 2, :], slew.angle * 6.0 * s * (1.0 - s) / slew.duration)
    if fastest:
        opti.subject_to(0.1 * slew.duration <= T)
        opti.set_initial(T, slew.duration)
    opti.minimize(T if fastest else ca.sumsqr(U) / N)
    opti.solver("ipopt", _QUIET)
    found = opti.solve()
    edges = np.linspace(0.0, float(found.value(T)), N + 1)
    return held(edges, np.array(found.value(U)).ravel() * limit)


def _rk4(f: Callable[[Any], Any], x: Any, h: Any, steps: int) -> Any:
    for _ in range(steps):
        k1 = f(x)
        k2 = f(x + 0.5 * h * k1)
        k3 = f(x + 0.5 * h * k2)
        k4 = f(x + h * k3)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x
