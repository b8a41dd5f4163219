"""The same slews as others would write them: RK4 multiple shooting in casadi.Opti, and rockit."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.torque import TorqueHistory, held

# IPOPT's options: silent, and solved until the objective no longer limits what errors are compared
_QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-10}


class Failed(RuntimeError):
    """The peer found no solution."""


@dataclass(frozen=True)
class Effort:
    """Least effort, rest to rest: the torque held on equal intervals."""

    beam: AssumedModesBeam
    angle: float
    torque_limit: float
    duration: float
    intervals: int

    @property
    def target(self) -> Array:
        """State at the end."""
        state = np.zeros(2 * self.beam.equations.size)
        state[0] = self.angle
        return state

    def guess(self) -> Array:
        """Angle of the cubic from rest to rest and its speed, (N + 1) x n."""
        s = np.linspace(0.0, 1.0, self.intervals + 1)
        states = np.zeros((s.size, self.target.size))
        states[:, 0] = self.angle * (3.0 * s**2 - 2.0 * s**3)
        states[:, self.beam.equations.size] = self.angle * 6.0 * s * (1.0 - s) / self.duration
        return states


@dataclass(frozen=True)
class OptiSlew:
    """RK4 multiple shooting in `casadi.Opti`, built, its angle left open."""

    effort: Effort
    opti: Any
    angle: Any
    torques: Any
    duration: Any

    def solve(self, angle: float, start: Any = None) -> Any:
        """Return `Opti`'s solution; it starts from the cubic, or from another solution with its multipliers.

        Raises
        ------
        Failed
            If IPOPT ends without a solution.
        """
        self.opti.set_value(self.angle, angle)
        if start is not None:
            self.opti.set_initial(start.value_variables())
            self.opti.set_initial(self.opti.lam_g, start.value(self.opti.lam_g))
        try:
            return self.opti.solve()
        except RuntimeError as error:
            raise Failed(str(self.opti.return_status())) from error

    def torque(self, solution: Any) -> TorqueHistory:
        """Return the torque that is held on each interval."""
        duration = float(solution.value(self.duration))
        values = np.array(solution.value(self.torques)).ravel() * self.effort.torque_limit
        return held(np.linspace(0.0, duration, self.effort.intervals + 1), values)


def opti_programme(effort: Effort, substeps: int = 1, mapped: bool = False, fastest: bool = False) -> OptiSlew:
    """Build RK4 multiple shooting in `casadi.Opti`, the torque in units of its limit.

    Parameters
    ----------
    effort : Effort
    substeps : int
        RK4 steps an interval.
    mapped : bool
        False: one constraint an interval, in a loop, as in CasADi's example of direct multiple shooting. True: an SX step
        function mapped over all intervals at once.
    fastest : bool
        Whether the duration is free, that of `effort` a first guess, and made least.
    """
    import casadi as ca

    f, n, N, limit = effort.beam.casadi_function(), effort.target.size, effort.intervals, effort.torque_limit
    x, u, t = ca.SX.sym("x", n), ca.SX.sym("u"), ca.SX.sym("t")
    step = ca.Function("step", [x, u, t], [_rk4(lambda a: f(a, u)[0], x, t / N / substeps, substeps)])
    opti = ca.Opti()
    X, U = opti.variable(n, N + 1), opti.variable(1, N)
    T = opti.variable() if fastest else effort.duration
    if mapped:
        opti.subject_to(X[:, 1:] == step.map(N)(X[:, :-1], U * limit, ca.repmat(ca.MX(T), 1, N)))
    else:
        for k in range(N):
            now, torque = X[:, k], U[k] * limit
            opti.subject_to(
                X[:, k + 1] == _rk4(lambda a, torque=torque: f(a, torque)[0], now, T / N / substeps, substeps)
            )
    angle = opti.parameter()
    opti.subject_to(X[:, 0] == 0.0)
    opti.subject_to(X[:, N] == ca.vertcat(angle, ca.DM.zeros(n - 1)))
    opti.subject_to(opti.bounded(-1.0, U, 1.0))
    if fastest:
        opti.subject_to(0.1 * effort.duration <= T)
        opti.set_initial(T, effort.duration)
    opti.minimize(T if fastest else ca.sumsqr(U) / N)
    opti.set_initial(X, effort.guess().T)
    opti.solver("ipopt", _QUIET)
    return OptiSlew(effort, opti, angle, U, T)


def rockit_torque(effort: Effort, substeps: int = 1, fastest: bool = False) -> TorqueHistory:
    """Return the torque of least effort, or of least time, by rockit's multiple shooting (RK4).

    Raises
    ------
    Failed
        If IPOPT ends without a solution.
    """
    import rockit  # pyright: ignore[reportMissingImports]

    f, n, N = effort.beam.casadi_function(), effort.target.size, effort.intervals
    ocp: Any = rockit.Ocp(T=rockit.FreeTime(effort.duration) if fastest else effort.duration)
    x, u = ocp.state(n), ocp.control()
    ocp.set_der(x, f(x, u * effort.torque_limit)[0])
    ocp.subject_to(ocp.at_t0(x) == 0.0)
    ocp.subject_to(ocp.at_tf(x) == effort.target)
    ocp.subject_to(u <= 1.0)
    ocp.subject_to(u >= -1.0)
    ocp.add_objective(ocp.T if fastest else ocp.sum(u**2) / N)
    ocp.solver("ipopt", _QUIET)
    ocp.method(rockit.MultipleShooting(N=N, M=substeps, intg="rk"))
    ocp.set_initial(x, effort.guess().T)
    try:
        solution = ocp.solve()
    except Exception as error:
        raise Failed("rockit found no solution") from error
    times, values = solution.sample(u, grid="control")
    return held(np.array(times), np.array(values)[:N] * effort.torque_limit)


def _rk4(f: Callable[[Any], Any], x: Any, h: Any, steps: int) -> Any:
    for _ in range(steps):
        k1 = f(x)
        k2 = f(x + 0.5 * h * k1)
        k3 = f(x + 0.5 * h * k2)
        k4 = f(x + h * k3)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x
