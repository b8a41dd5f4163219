"""The sampled loop around a nonlinear machine, as one CasADi function per step, repeated with halved steps.

A step of the grid is a sample of the controller (if one falls on it) and the machine's motion under the control before and
after the switch.  The motions with two step lengths are compared: their difference is the error of the coarser motion, and
an upper bound on the error of the finer motion, which is returned.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from boomctl.arrays import Array, blocks
from boomctl.checks import exactly
from boomctl.lti.machine_modes import MachineModes
from boomctl.lti.rounding import ALIKE, DEPENDENT
from boomctl.progress import tell
from boomctl.simulation.controller import SampledController
from boomctl.simulation.machine.exponential_step import exponential_step
from boomctl.simulation.stepping import ControlLog, SampledRun

if TYPE_CHECKING:
    import casadi

Acts: TypeAlias = tuple[tuple[int, ...], tuple[int, ...]]
"""Indices of controls and of disturbances among a machine's inputs."""


_ANGLE = 3.0  # Phase [rad] of the fastest mode that an input excites in a first step.
_DAMPED = 2.0  # Decay rate times length of a first step: explicit steps are stable below 2.5.
_ORDER = 4  # Order of the scheme; lower if axial modes vibrate many times in a step.
_MOST_DOUBLINGS = 3  # Most doublings of the number of steps between trials: early error estimates are inaccurate.
_FAILURES = 3  # Trials that overflow, or do not reduce the difference, after which the run fails.
_MOST_STEPS = 2e7  # Most steps of a run: some minutes.
_INLINE = 4  # Most steps within a step of the grid that are expanded into one expression; more are a loop.
_LONGEST_QUEUE = 64  # Longest delay [samples] with pending controls as states; longer queues are read from the log.
BLOCK = 250  # Columns evaluated in one call of a CasADi function: 1000 and 30 take longer.


@dataclass(frozen=True, eq=False, kw_only=True)
class MachineLoop(SampledRun):
    """Data of a run around a machine."""

    machine: MachineModes

    @property
    def acts(self) -> Acts:
        """Indices of the machine's inputs that are controls, and that are disturbances."""
        return tuple(self.controller.driven.tolist()), tuple(self.disturbed.tolist())

    @property
    def queued(self) -> tuple[int, int]:
        """Delay of a control in samples, and the remaining delay in steps of the grid."""
        return divmod(self.lag, self.grid.per_sample)

    @property
    def waiting(self) -> int:
        """Number of pending controls, including the latest, that are states of the loop."""
        late = self.queued[0]
        return late + 1 if late <= _LONGEST_QUEUE else 1

    @property
    def size(self) -> int:
        """Number of states of the loop."""
        return len(self.start) + (1 + self.waiting) * len(self.controller.driven) + len(self.controller.A)

    @property
    def segments(self) -> tuple[float, ...]:
        """Lengths of the parts of a step with constant control, s."""
        return (self.switch, self.grid.h - self.switch) if self.switch else (self.grid.h,)


def moved_by(push: Array) -> Array:
    """Return a mask of the modes that inputs excite, from the modal input matrix."""
    # fraction of the largest entry below which an input does not excite a mode
    return np.abs(push) > ALIKE * np.abs(push).max()


def steps_for(machine: MachineModes, length: float) -> int:
    """Return the number of steps of a first trial over a time [s]."""
    excited = moved_by(machine.push).any(axis=1)
    pace = max(float(machine.omega[excited].max()) / _ANGLE, machine.decay / _DAMPED)
    return max(1, int(np.ceil(length * pace)))


def run_to_tolerance(p: MachineLoop, rtol: float, atol: float) -> tuple[Array, ControlLog, float]:
    """Return the motion whose evaluated displacements have an error below ``atol + rtol max |displacement|`` [m].

    Returns the states at all steps of the grid, (2 m, steps + 1), the log, and the error of the displacements [m].

    Raises
    ------
    ValueError
        If the loop diverges, the machine is deformed beyond its model, or the tolerance is not reached.
    """
    counts = tuple(steps_for(p.machine, length) for length in p.segments)
    coarse, best, failures = None, np.inf, 0
    while True:
        finer = tuple(2 * count for count in counts)
        _check_length(p, finer, rtol, best)
        try:
            first = _closed(p, counts) if coarse is None else coarse
            second = _closed(p, finer)
        except _StepOverflowError:  # caused by an unstable loop, or by too long a step
            coarse, counts, failures = None, finer, failures + 1
            if failures > _FAILURES:
                raise ValueError("the loop diverges: its states overflow before the last of timepts") from None
            continue
        there, here = (
            at_columns(p.machine.displacements, result[0][:, :: p.grid.per_point])[0] for result in (first, second)
        )
        difference = np.abs(here - there).max(axis=1)
        wanted = atol + rtol * np.abs(here).max(axis=1)
        if (difference <= wanted).all():
            return *second, float(difference.max())
        nearer = difference.max() < best
        failures += 0 if nearer else 1
        rounding = bool((difference <= DEPENDENT * np.abs(here).max(axis=1)).all())
        best = min(best, float(difference.max()))
        if failures > _FAILURES or (rounding and not nearer):
            _stays(rtol, best, counts)
        missing = int(np.ceil(np.log2(float((difference / wanted).max())) / _ORDER))
        doublings = min(max(1, missing), _MOST_DOUBLINGS) if nearer and not rounding else 1
        coarse = second if doublings == 1 else None
        counts = tuple(count * 2**doublings for count in counts)


class _StepOverflowError(Exception):
    """Overflow of the states."""


def _check_length(p: MachineLoop, counts: tuple[int, ...], rtol: float, before: float) -> None:
    if p.grid.steps * sum(counts) <= _MOST_STEPS:
        return
    if np.isfinite(before):
        _stays(rtol, before, counts)
    raise ValueError(
        f"timepts: the motion would take {p.grid.steps * sum(counts):.1e} steps; expected at most {_MOST_STEPS:g}"
    )


def _stays(rtol: float, error: float, counts: tuple[int, ...]) -> None:
    raise ValueError(
        f"rtol = {exactly(rtol)}: the error stays at {error:.1e} m with {sum(counts)} steps from one sample or time to the "
        f"next; expected a larger rtol or atol"
    )


def loop_step(p: MachineLoop, counts: tuple[int, ...]) -> tuple[casadi.Function, casadi.Function]:
    """Return the function of a step of the loop, ``(s, w) -> (s, commanded, applied, marks)``, and of its sample.

    ``counts`` is the number of steps in each segment.  The state s consists of the machine's state, the acting control, the
    pending controls, and the controller's state; w are the `StepSignals`.
    """
    import casadi as ca

    c, ps = p.controller, p.grid.per_sample
    nz, nu, queue, late = len(p.start), len(c.driven), p.waiting, p.queued[0]
    layout = StepSignals(p)
    sample, advance = _sample(p, queue), _cached_advance(p.machine, p.acts, p.segments, counts, p.grid.h)
    symbol: Any = ca.SX.sym if advance.is_a("SXFunction") else ca.MX.sym
    s, w = symbol("s", p.size), symbol("w", layout.rows)
    z, acting = s[:nz], s[nz : nz + nu]
    after, commanded, applied, marks = sample(s, w)
    following = after if ps == 1 else ca.if_else(w[layout["sampled"]], after, s)
    held = following[nz + nu : nz + (queue + 1) * nu]
    arriving = held[late * nu :] if queue > 1 or not late else w[layout["arriving"]]
    acting_then = arriving if ps == 1 else ca.if_else(w[layout["arrives"]], arriving, acting)
    moved = advance(z, acting, acting_then, w[layout["first"]], w[layout["last"]])
    return ca.Function(
        "unit", [s, w], [ca.vertcat(moved, acting_then, following[nz + nu :]), commanded, applied, marks]
    ), sample


def _closed(p: MachineLoop, counts: tuple[int, ...]) -> tuple[Array, ControlLog]:
    """Run the loop with a number of steps in each segment."""
    ps, nz, queue, (late, offset) = p.grid.per_sample, len(p.start), p.waiting, p.queued
    (unit, sample), layout, size = loop_step(p, counts), StepSignals(p), p.size
    steps = p.grid.steps
    block = min(BLOCK, steps, late * ps + offset if queue == 1 and late else steps)
    run, signals = Buffered(unit.mapaccum("run", block)), layout.signals()
    state, states = np.concatenate([p.start, np.zeros(size - nz)]), np.empty((nz, steps + 1))
    log = p.new_log()
    states[:, 0] = p.start
    for k in range(0, steps, block):
        tell(f"{sum(counts)} steps from one time to the next", k, steps)
        here = np.zeros((layout.rows, block))
        end = min(k + block, steps)
        here[:, : end - k] = signals[:, k:end]
        if queue == 1 and late:
            here[layout["arriving"], : end - k] = log.acting(np.arange(k, end), p.lag, ps).T
        moved, *taken = run(state, here)
        state = moved[:, end - k - 1]
        if not np.isfinite(state).all():
            raise _StepOverflowError
        states[:, k + 1 : end + 1] = moved[:nz, : end - k]
        at = np.arange(-(-k // ps) * ps, end, ps)
        _write(log, at // ps, *(item[:, at - k] for item in taken))
    if steps % ps == 0:
        _, *taken = (np.array(item) for item in sample(state, layout.signals(at_end=True)))
        _write(log, np.array([steps // ps]), *taken)
    return states, log


def _write(log: ControlLog, samples: Array, commanded: Array, applied: Array, marks: Array) -> None:
    log.commanded[samples], log.applied[samples] = commanded.T, applied.T
    log.saturated[samples], log.slewed[samples] = np.split(marks.T > 0.0, 2, axis=1)


class StepSignals:
    """Rows of the signals of each step: disturbances at both ends, signals added to the controller's, and events."""

    def __init__(self, p: MachineLoop) -> None:
        self.p, nd, ny, nu = p, len(p.disturbed), len(p.controller.measured), len(p.controller.driven)
        sizes = {"first": nd, "last": nd, "noise": ny, "reference": ny, "forward": nu, "arriving": nu}
        laws = p.controller.laws
        self.changing = None if laws is None or laws.index is not None else laws
        changing = (0, 0) if self.changing is None else (self.changing.law[0].size, self.changing.correction[0].size)
        sizes |= {"sampled": 1, "arrives": 1, "law": changing[0], "correction": changing[1]}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self.rows, self.slices = ends[-1], dict(zip(sizes, map(slice, ends, ends[1:]), strict=False))

    def __getitem__(self, name: str) -> slice:
        """Return the rows of a signal."""
        return self.slices[name]

    def signals(self, at_end: bool = False) -> Array:
        """Return the rows for all steps, (rows, steps), or for the sample at the last time, (rows,)."""
        p, ps, added = self.p, self.p.grid.per_sample, self.p.added
        steps = np.array([p.grid.steps]) if at_end else np.arange(p.grid.steps)
        result, W = np.zeros((self.rows, len(steps))), p.W[p.disturbed]
        result[self["first"]] = W[:, steps]
        if not at_end:
            result[self["last"]] = W[:, steps + 1]
        sampled = {"noise": added.noise, "reference": added.reference, "forward": added.feedforward}
        if self.changing is not None:
            sampled |= {"law": self.changing.law, "correction": self.changing.correction}
        for name, rows in sampled.items():
            if rows is not None:
                result[self[name]] = rows[np.minimum(steps // ps, len(rows) - 1)].reshape(len(steps), -1).T
        result[self["sampled"]], result[self["arrives"]] = steps % ps == 0, (steps - p.lag) % ps == 0
        return result[:, 0] if at_end else result


def inputs_of(m: MachineModes, acts: Acts, controls: casadi.SX, disturbances: casadi.SX) -> casadi.SX:
    """Return all inputs of the machine; inputs without a signal are structural zeros."""
    import casadi as ca

    u = ca.SX.zeros(len(m.input_labels))
    for indices, values in zip(acts, (controls, disturbances), strict=True):
        for k, index in enumerate(indices):
            u[index] += values[k]
    return u


def _sample(p: MachineLoop, queue: int) -> casadi.Function:
    """Return ``(s, w) -> (s, commanded, applied, marks)``: a sample of the controller, with limits."""
    import casadi as ca

    c, limits, layout = p.controller, p.limits, StepSignals(p)
    nz, nu = len(p.start), len(c.driven)
    s, w = ca.SX.sym("s", nz + nu + queue * nu + len(c.A)), ca.SX.sym("w", layout.rows)
    z, acting, last = s[:nz], s[nz : nz + nu], s[nz + nu : nz + 2 * nu]
    state = s[nz + (queue + 1) * nu :]
    y = p.machine.read(z, inputs_of(p.machine, p.acts, acting, w[layout["first"]]))[0][c.measured.tolist()]
    y = y if p.added.noise is None else y + w[layout["noise"]]
    for k, quantum in enumerate(limits.quantum):
        if np.isfinite(quantum):
            count = y[k] / quantum
            y[k] = quantum * (count - ca.remainder(count, 1.0))
    law, correction = _laws(c, y, w, layout)
    y = y if p.added.reference is None else y - w[layout["reference"]]
    commanded, following = ca.vertsplit(ca.mtimes(law, ca.vertcat(y, state)), [0, nu, nu + len(c.A)])
    commanded = commanded if p.added.feedforward is None else commanded + w[layout["forward"]]
    applied, marks = [], [[], []]
    for k in range(nu):
        force, rate, allowed = float(limits.force[k]), float(limits.rate[k]), commanded[k]
        saturated = slewed = ca.SX(0.0)
        if np.isfinite(force):
            saturated = ca.fabs(commanded[k]) > force
            allowed = ca.fmax(ca.fmin(allowed, force), -force)
        if np.isfinite(rate):
            slewed = ca.fabs(allowed - last[k]) > rate
            allowed = ca.if_else(slewed, last[k] + ca.if_else(allowed > last[k], rate, -rate), allowed)
        applied.append(allowed)
        marks[0].append(saturated)
        marks[1].append(slewed)
    allowed = ca.vertcat(*applied)
    if correction is not None:
        following += ca.mtimes(correction, allowed - commanded)
    waiting = ca.vertcat(allowed, s[nz + nu : nz + queue * nu])
    marked = ca.vertcat(*marks[0], *marks[1])
    return ca.Function("sample", [s, w], [ca.vertcat(z, acting, waiting, following), commanded, allowed, marked])


def _laws(c: SampledController, y: casadi.SX, w: casadi.SX, layout: StepSignals) -> tuple[casadi.SX, casadi.SX | None]:
    """Return ``[[D, C], [B, A]]`` and ``L`` (None: zero) at a sample, from the measurements and the step's signals."""
    import casadi as ca

    def sparse(matrix: Array) -> casadi.SX:
        return ca.SX(ca.sparsify(ca.DM(matrix)))

    if c.laws is None:
        return sparse(blocks([[c.D, c.C], [c.B, c.A]])), sparse(c.L) if c.L.any() else None
    laws, result = c.laws, []
    for item, part in ((laws.law, layout["law"]), (laws.correction, layout["correction"])):
        _, rows, columns = item.shape
        if laws.index is None:
            result.append(ca.reshape(w[part], columns, rows).T)
            continue
        total = sparse(item[0])
        for i, (low, high) in enumerate(pairwise(laws.values.tolist())):
            fraction = ca.fmax(ca.fmin((y[laws.index] - low) / (high - low), 1.0), 0.0)
            total += fraction * sparse(item[i + 1] - item[i])
        result.append(total)
    return result[0], result[1] if laws.correction.any() else None


@lru_cache(maxsize=8)  # for the next loop around the same machine
def _cached_advance(
    m: MachineModes, acts: Acts, segments: tuple[float, ...], counts: tuple[int, ...], h: float
) -> casadi.Function:
    """Return ``(z, before, after, first, last) -> z`` over a step of the grid, with a number of steps in each segment."""
    import casadi as ca

    nz, nu, nd = 2 * len(m.omega), *map(len, acts)
    sizes = {"z": nz, "before": nu, "after": nu, "first": nd, "last": nd}
    inline = sum(counts) <= _INLINE
    symbol: Any = ca.SX.sym if inline else ca.MX.sym
    z, before, after, first, last = arguments = [symbol(name, size) for name, size in sizes.items()]
    begin = 0.0
    for length, count, control in zip(segments, counts, (before, after)[-len(counts) :], strict=True):
        start, u, d0, d1 = (ca.SX.sym(name, n) for name, n in (("z", nz), ("u", nu), ("d0", nd), ("d1", nd)))
        pushes = (inputs_of(m, acts, u, d) for d in (d0, d1))
        step = ca.Function(
            "step", [start, u, d0, d1], [exponential_step(m.rest, m.omega, length / count, start, *pushes)]
        )
        edges = (begin + length * np.arange(count + 1) / count) / h
        if inline:
            for e0, e1 in pairwise(edges):
                z = step(z, control, first + e0 * (last - first), first + e1 * (last - first))
        else:
            lines = ca.repmat(first, 1, count + 1) + ca.mtimes(last - first, ca.DM(edges).T)
            z = step.mapaccum("steps", count)(z, ca.repmat(control, 1, count), lines[:, :count], lines[:, 1:])[:, -1]
        begin += length
    return ca.Function("advance", arguments, [z])


def measured(p: MachineLoop, states: Array, controls: Array) -> Array:
    """Return the outputs at the requested times, (outputs, points), under the controls that act just after each time.

    Raises
    ------
    ValueError
        If the mass matrix ceases to be positive definite.
    """
    rows = p.W[p.disturbed][:, :: p.grid.per_point]
    outputs, margin = at_columns(_cached_reading(p.machine, p.acts), states, controls, rows)
    beyond = np.flatnonzero(margin[0] <= 0.0)
    if beyond.size:
        raise ValueError(
            f"mass matrix margin at t = {p.grid.time[beyond[0]]:.6g} s: expected above zero; the deformation is outside "
            f"the model"
        )
    return outputs


@lru_cache(maxsize=8)  # for the next loop around the same machine
def _cached_reading(m: MachineModes, acts: Acts) -> casadi.Function:
    """Return ``(z, controls, disturbances) -> (outputs, margin)``."""
    import casadi as ca

    sizes = {"z": 2 * len(m.omega), "u": len(acts[0]), "d": len(acts[1])}
    z, u, d = arguments = [ca.SX.sym(name, size) for name, size in sizes.items()]
    return ca.Function("read", arguments, list(m.read.call([z, inputs_of(m, acts, u, d)])))


class Buffered:
    """Function of dense matrices, evaluated in memory shared with NumPy.

    Parameters
    ----------
    function : casadi.Function
        Function of dense matrices; results with structural zeros are returned dense.
    """

    def __init__(self, function: casadi.Function) -> None:
        import casadi as ca

        arguments = [ca.MX.sym(f"argument{i}", *function.size_in(i)) for i in range(function.n_in())]
        full = ca.Function("full", arguments, [ca.densify(item) for item in function.call(arguments)])
        # The buffer must live as long as this object: the compiled call points to it.  The stub has no type of shared memory.
        self._buffer: Any = None
        self._buffer, self._run = full.buffer()
        # CasADi stores matrices by columns: NumPy stores their transposes by rows
        self._arguments = [np.empty(full.size_in(i)[::-1]) for i in range(full.n_in())]
        self._results = [np.empty(full.size_out(i)[::-1]) for i in range(full.n_out())]
        for i, array in enumerate(self._arguments):
            self._buffer.set_arg(i, array.reshape(-1).data)
        for i, array in enumerate(self._results):
            self._buffer.set_res(i, array.reshape(-1).data)

    def __call__(self, *arguments: Array) -> list[Array]:
        """Evaluate the function and return its matrices, (rows, columns); vectors are columns."""
        for here, item in zip(self._arguments, arguments, strict=True):
            here[...] = np.reshape(item, here.shape[::-1]).T
        self._run()
        return [array.copy().T for array in self._results]


def at_columns(function: casadi.Function, *arguments: Array) -> list[Array]:
    """Evaluate a function of vectors at all columns of matrices; return matrices (rows, columns)."""
    count = arguments[0].shape[1]
    block = min(BLOCK, count)
    run = Buffered(function.map(block))
    parts = []
    for k in range(0, count, block):
        end = min(k + block, count)
        padded = [np.pad(item[:, k:end], ((0, 0), (0, block - end + k))) for item in arguments]
        parts.append([item[:, : end - k] for item in run(*padded)])
    return [np.hstack(item) for item in zip(*parts, strict=True)]
