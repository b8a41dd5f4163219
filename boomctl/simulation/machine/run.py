"""The sampled loop around a nonlinear machine, as one CasADi function a step, run again with steps half as long.

A step of the grid is a sample of the controller (where one falls on it) and the machine's motion under the control before
and after the switch.  The motions of two lengths of step are compared: their distance is the error, of the coarser one, and
an upper bound of that of the finer one, which is returned.  Where measurements are quantized, the second run repeats the
controls of the first, for a rounding that flips is no error of the motion.
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
from boomctl.lti.rounding import ALIKE
from boomctl.progress import tell
from boomctl.simulation.controller import SampledController
from boomctl.simulation.machine.exponential_step import exponential_step
from boomctl.simulation.stepping import ControlLog, SampledRun

if TYPE_CHECKING:
    import casadi

Acts: TypeAlias = tuple[tuple[int, ...], tuple[int, ...]]
"""Places among a machine's inputs: of controls, and of disturbances."""

PATH = "exponential steps"

_ANGLE = 3.0  # radians that the fastest mode which an input moves turns in a first step (a choice: halved if need be)
_DAMPED = 2.0  # share of a rate that damping takes away in a first step: explicit steps are stable below 2.5
_ORDER = 4  # of the scheme; lower where axial modes turn many times in a step
_MOST_DOUBLINGS = 3  # of the number of steps from one trial to the next: an early guess of the error is a poor one
_ROUNDING = 1e-10  # of the displacements: runs this near that come no nearer differ by rounding (a choice)
_FAILURES = 3  # trials that overflow or come no nearer, after which no more is tried (a choice)
_MOST_STEPS = 2e7  # of a run: some minutes (a choice)
_INLINE = 4  # steps within one step of the grid that are one expression; more are a loop over it (measured)
_LONGEST_QUEUE = 64  # controls on their way that are states of the loop; longer queues are read off the log (a choice)
# columns that are one call of a CasADi function: 1000 take a third longer over a second, 30 a quarter longer over five
# (measured)
BLOCK = 250


@dataclass(frozen=True, eq=False, kw_only=True)
class MachineLoop(SampledRun):
    """What a run around a machine needs."""

    machine: MachineModes

    @property
    def acts(self) -> Acts:
        """Inputs of the machine that are controls, and those that are disturbances."""
        return tuple(self.controller.driven.tolist()), tuple(self.disturbed.tolist())

    @property
    def queued(self) -> tuple[int, int]:
        """Samples by which a control comes late, and steps of the grid after a sample at which one arrives."""
        return divmod(self.lag, self.grid.per_sample)

    @property
    def waiting(self) -> int:
        """How many controls on their way, the one given last among them, are states of the loop."""
        late = self.queued[0]
        return late + 1 if late <= _LONGEST_QUEUE else 1

    @property
    def size(self) -> int:
        """Number of states of the loop."""
        return len(self.start) + (1 + self.waiting) * len(self.controller.driven) + len(self.controller.A)

    @property
    def segments(self) -> tuple[float, ...]:
        """Lengths of the parts of a step in which the control is held, s."""
        return (self.switch, self.grid.h - self.switch) if self.switch else (self.grid.h,)


def moved_by(push: Array) -> Array:
    """Return which modes inputs move, by what they do to each."""
    # share of the largest push below which an input does not move a mode
    return np.abs(push) > ALIKE * np.abs(push).max()


def steps_for(machine: MachineModes, length: float) -> int:
    """Return how many steps a first trial takes over a time [s]."""
    felt = moved_by(machine.push).any(axis=1)
    pace = max(float(machine.omega[felt].max()) / _ANGLE, machine.decay / _DAMPED)
    return max(1, int(np.ceil(length * pace)))


def run_to_tolerance(p: MachineLoop, rtol: float, atol: float) -> tuple[Array, ControlLog, float]:
    """Return the motion whose judged displacements are exact to ``atol + rtol max |displacement|`` [m].

    It is that at all steps of the grid, (2 m, steps + 1), with its log, and the error of what is judged [m].

    Raises
    ------
    ValueError
        The loop diverges, the machine is deformed beyond its model, or the tolerance is not reached.
    """
    counts = tuple(steps_for(p.machine, length) for length in p.segments)
    coarse, best, failures = None, np.inf, 0
    while True:
        finer = tuple(2 * count for count in counts)
        _check_length(p, finer, rtol, best)
        try:
            first = _closed(p, counts) if coarse is None else coarse
            second = _repeated(p, finer, first[1]) if p.limits.coarse else _closed(p, finer)
        except _StepOverflowError:  # which a step too long may do as well as the loop
            coarse, counts, failures = None, finer, failures + 1
            if failures > _FAILURES:
                raise ValueError(
                    "the loop diverges: its states grow beyond all numbers before the last of timepts"
                ) from None
            continue
        there, here = (
            at_columns(p.machine.displacements, result[0][:, :: p.grid.per_point])[0] for result in (first, second)
        )
        apart = np.abs(here - there).max(axis=1)
        wanted = atol + rtol * np.abs(here).max(axis=1)
        if (apart <= wanted).all():
            return *second, float(apart.max())
        nearer = apart.max() < best
        failures += 0 if nearer else 1
        rounding = bool((apart <= _ROUNDING * np.abs(here).max(axis=1)).all())
        best = min(best, float(apart.max()))
        if failures > _FAILURES or (rounding and not nearer):
            _stays(rtol, best, counts)
        missing = int(np.ceil(np.log2(float((apart / wanted).max())) / _ORDER))
        doublings = min(max(1, missing), _MOST_DOUBLINGS) if nearer and not rounding else 1
        coarse = second if doublings == 1 and not p.limits.coarse else None
        counts = tuple(count * 2**doublings for count in counts)


class _StepOverflowError(Exception):
    """The states grow beyond all numbers."""


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
    """Return a step of the loop in so many steps a segment, ``(s, w) -> (s, asked, given, marks)``, and its sample.

    The state s has those of the machine, the control that acts, those on their way, and the controller's; `StepSignals` w.
    """
    import casadi as ca

    c, ps = p.controller, p.grid.per_sample
    nz, nu, queue, late = len(p.start), len(c.driven), p.waiting, p.queued[0]
    beside = StepSignals(p)
    sample, advance = _sample(p, queue), _advance(p, counts)
    symbol: Any = ca.SX.sym if advance.is_a("SXFunction") else ca.MX.sym
    s, w = symbol("s", p.size), symbol("w", beside.rows)
    z, acting = s[:nz], s[nz : nz + nu]
    after, asked, given, marks = sample(s, w)
    kept = after if ps == 1 else ca.if_else(w[beside["sampled"]], after, s)
    held = kept[nz + nu : nz + (queue + 1) * nu]
    arriving = held[late * nu :] if queue > 1 or not late else w[beside["arriving"]]
    acting_then = arriving if ps == 1 else ca.if_else(w[beside["arrives"]], arriving, acting)
    moved = advance(z, acting, acting_then, w[beside["first"]], w[beside["last"]])
    return ca.Function("unit", [s, w], [ca.vertcat(moved, acting_then, kept[nz + nu :]), asked, given, marks]), sample


def _closed(p: MachineLoop, counts: tuple[int, ...]) -> tuple[Array, ControlLog]:
    """Run the loop in so many steps a segment."""
    ps, nz, queue, (late, offset) = p.grid.per_sample, len(p.start), p.waiting, p.queued
    (unit, sample), beside, size = loop_step(p, counts), StepSignals(p), p.size
    steps = p.grid.steps
    block = min(BLOCK, steps, late * ps + offset if queue == 1 and late else steps)
    run, signals = Buffered(unit.mapaccum("run", block)), beside.signals()
    state, states = np.concatenate([p.start, np.zeros(size - nz)]), np.empty((nz, steps + 1))
    log = p.new_log()
    states[:, 0] = p.start
    for k in range(0, steps, block):
        tell(f"{sum(counts)} steps from one time to the next", k, steps)
        here = np.zeros((beside.rows, block))
        end = min(k + block, steps)
        here[:, : end - k] = signals[:, k:end]
        if queue == 1 and late:
            here[beside["arriving"], : end - k] = log.acting(np.arange(k, end), p.lag, ps).T
        moved, *taken = run(state, here)
        state = moved[:, end - k - 1]
        if not np.isfinite(state).all():
            raise _StepOverflowError
        states[:, k + 1 : end + 1] = moved[:nz, : end - k]
        at = np.arange(-(-k // ps) * ps, end, ps)
        _write(log, at // ps, *(item[:, at - k] for item in taken))
    if steps % ps == 0:
        _, *taken = (np.array(item) for item in sample(state, beside.signals(at_end=True)))
        _write(log, np.array([steps // ps]), *taken)
    return states, log


def _write(log: ControlLog, samples: Array, asked: Array, given: Array, marks: Array) -> None:
    log.asked[samples], log.given[samples] = asked.T, given.T
    log.saturated[samples], log.slewed[samples] = np.split(marks.T > 0.0, 2, axis=1)


def _repeated(p: MachineLoop, counts: tuple[int, ...], log: ControlLog) -> tuple[Array, ControlLog]:
    """Run the machine under the controls of a log."""
    steps, nu = np.arange(p.grid.steps), len(p.controller.driven)
    after = log.acting(steps, p.lag, p.grid.per_sample).T
    before = np.hstack([np.zeros((nu, 1)), after[:, :-1]])
    W = p.W[p.disturbed]
    result = _advance(p, counts).mapaccum("run", len(steps))(p.start, before, after, W[:, :-1], W[:, 1:])
    states = np.hstack([p.start[:, None], np.array(result)])
    if not np.isfinite(states[:, -1]).all():
        raise _StepOverflowError
    return states, log


class StepSignals:
    """Rows of what each step is given: disturbances at both ends, what is added to the signals, which events it has."""

    def __init__(self, p: MachineLoop) -> None:
        self.p, nd, ny, nu = p, len(p.disturbed), len(p.controller.measured), len(p.controller.driven)
        sizes = {"first": nd, "last": nd, "noise": ny, "reference": ny, "forward": nu, "arriving": nu}
        laws = p.controller.laws
        self.changing = None if laws is None or laws.place is not None else laws
        changing = (0, 0) if self.changing is None else (self.changing.law[0].size, self.changing.correction[0].size)
        sizes |= {"sampled": 1, "arrives": 1, "law": changing[0], "correction": changing[1]}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self.rows, self.places = ends[-1], dict(zip(sizes, map(slice, ends, ends[1:]), strict=False))

    def __getitem__(self, name: str) -> slice:
        """Return the rows of a signal."""
        return self.places[name]

    def signals(self, at_end: bool = False) -> Array:
        """Return them for all steps, (rows, steps), or for the sample at the last time, (rows,)."""
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
    """Return all inputs of the machine; those that nothing moves are zeros, on which no operation is spent."""
    import casadi as ca

    u = ca.SX.zeros(len(m.input_labels))
    for places, values in zip(acts, (controls, disturbances), strict=True):
        for k, place in enumerate(places):
            u[place] += values[k]
    return u


def _sample(p: MachineLoop, queue: int) -> casadi.Function:
    """Return ``(s, w) -> (s, asked, given, marks)``: the controller reads, asks, and is given what limits allow."""
    import casadi as ca

    c, limits, beside = p.controller, p.limits, StepSignals(p)
    nz, nu = len(p.start), len(c.driven)
    s, w = ca.SX.sym("s", nz + nu + queue * nu + len(c.A)), ca.SX.sym("w", beside.rows)
    z, acting, last = s[:nz], s[nz : nz + nu], s[nz + nu : nz + 2 * nu]
    state = s[nz + (queue + 1) * nu :]
    y = p.machine.read(z, inputs_of(p.machine, p.acts, acting, w[beside["first"]]))[0][c.measured.tolist()]
    y = y if p.added.noise is None else y + w[beside["noise"]]
    for k, quantum in enumerate(limits.quantum):
        if np.isfinite(quantum):
            count = y[k] / quantum
            y[k] = quantum * (count - ca.remainder(count, 1.0))
    law, correction = _laws(c, y, w, beside)
    y = y if p.added.reference is None else y - w[beside["reference"]]
    asked, following = ca.vertsplit(ca.mtimes(law, ca.vertcat(y, state)), [0, nu, nu + len(c.A)])
    asked = asked if p.added.feedforward is None else asked + w[beside["forward"]]
    given, marks = [], [[], []]
    for k in range(nu):
        force, rate, allowed = float(limits.force[k]), float(limits.rate[k]), asked[k]
        saturated = slewed = ca.SX(0.0)
        if np.isfinite(force):
            saturated = ca.fabs(asked[k]) > force
            allowed = ca.fmax(ca.fmin(allowed, force), -force)
        if np.isfinite(rate):
            slewed = ca.fabs(allowed - last[k]) > rate
            allowed = ca.if_else(slewed, last[k] + ca.if_else(allowed > last[k], rate, -rate), allowed)
        given.append(allowed)
        marks[0].append(saturated)
        marks[1].append(slewed)
    allowed = ca.vertcat(*given)
    if correction is not None:
        following += ca.mtimes(correction, allowed - asked)
    waiting = ca.vertcat(allowed, s[nz + nu : nz + queue * nu])
    marked = ca.vertcat(*marks[0], *marks[1])
    return ca.Function("sample", [s, w], [ca.vertcat(z, acting, waiting, following), asked, allowed, marked])


def _laws(c: SampledController, y: casadi.SX, w: casadi.SX, beside: StepSignals) -> tuple[casadi.SX, casadi.SX | None]:
    """Return ``[[D, C], [B, A]]`` and ``L`` (None: zero) at a sample, of what is measured and what the step is given."""
    import casadi as ca

    def sparse(matrix: Array) -> casadi.SX:
        return ca.SX(ca.sparsify(ca.DM(matrix)))

    if c.laws is None:
        return sparse(blocks([[c.D, c.C], [c.B, c.A]])), sparse(c.L) if c.L.any() else None
    laws, result = c.laws, []
    for item, given in ((laws.law, beside["law"]), (laws.correction, beside["correction"])):
        _, rows, columns = item.shape
        if laws.place is None:
            result.append(ca.reshape(w[given], columns, rows).T)
            continue
        total = sparse(item[0])
        for i, (low, high) in enumerate(pairwise(laws.values.tolist())):
            share = ca.fmax(ca.fmin((y[laws.place] - low) / (high - low), 1.0), 0.0)
            total += share * sparse(item[i + 1] - item[i])
        result.append(total)
    return result[0], result[1] if laws.correction.any() else None


def _advance(p: MachineLoop, counts: tuple[int, ...]) -> casadi.Function:
    """Return ``(z, before, after, first, last) -> z`` over a step of the grid, each segment in so many steps."""
    return _kept_advance(p.machine, p.acts, p.segments, counts, p.grid.h)


@lru_cache(maxsize=8)  # for the next loop around the same machine (a choice)
def _kept_advance(
    m: MachineModes, acts: Acts, segments: tuple[float, ...], counts: tuple[int, ...], h: float
) -> casadi.Function:
    import casadi as ca

    nz, nu, nd = 2 * len(m.omega), *map(len, acts)
    sizes = {"z": nz, "before": nu, "after": nu, "first": nd, "last": nd}
    inline = sum(counts) <= _INLINE
    symbol: Any = ca.SX.sym if inline else ca.MX.sym
    z, before, after, first, last = given = [symbol(name, size) for name, size in sizes.items()]
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
    return ca.Function("advance", given, [z])


def measured(p: MachineLoop, states: Array, controls: Array) -> Array:
    """Return the outputs at the given times, (outputs, points), under the controls that act just after each.

    Raises
    ------
    ValueError
        The mass matrix ceases to be positive definite.
    """
    rows = p.W[p.disturbed][:, :: p.grid.per_point]
    outputs, margin = at_columns(_kept_reading(p.machine, p.acts), states, controls, rows)
    beyond = np.flatnonzero(margin[0] <= 0.0)
    if beyond.size:
        raise ValueError(
            f"mass matrix margin at t = {p.grid.time[beyond[0]]:.6g} s: expected above zero; the deformation is outside "
            f"the model"
        )
    return outputs


@lru_cache(maxsize=8)  # likewise
def _kept_reading(m: MachineModes, acts: Acts) -> casadi.Function:
    """Return ``(z, controls, disturbances) -> (outputs, margin)``."""
    import casadi as ca

    sizes = {"z": 2 * len(m.omega), "u": len(acts[0]), "d": len(acts[1])}
    z, u, d = given = [ca.SX.sym(name, size) for name, size in sizes.items()]
    return ca.Function("read", given, list(m.read.call([z, inputs_of(m, acts, u, d)])))


class Buffered:
    """A function of dense matrices, evaluated in memory that NumPy shares with it.

    Parameters
    ----------
    function : casadi.Function
        Of dense matrices; what it returns with structural zeros is returned full.
    """

    def __init__(self, function: casadi.Function) -> None:
        import casadi as ca

        given = [ca.MX.sym(f"given{i}", *function.size_in(i)) for i in range(function.n_in())]
        full = ca.Function("full", given, [ca.densify(item) for item in function.call(given)])
        # to be kept as long as this: what runs the function points to it.  Its stub knows of no memory that Python shares
        self._buffer: Any = None
        self._buffer, self._run = full.buffer()
        # matrices lie column by column: their transposes are what NumPy lays out row by row
        self._given = [np.empty(full.size_in(i)[::-1]) for i in range(full.n_in())]
        self._found = [np.empty(full.size_out(i)[::-1]) for i in range(full.n_out())]
        for i, array in enumerate(self._given):
            self._buffer.set_arg(i, array.reshape(-1).data)
        for i, array in enumerate(self._found):
            self._buffer.set_res(i, array.reshape(-1).data)

    def __call__(self, *given: Array) -> list[Array]:
        """Return the matrices that the function returns, (rows, columns); vectors are taken as columns."""
        for here, item in zip(self._given, given, strict=True):
            here[...] = np.reshape(item, here.shape[::-1]).T
        self._run()
        return [array.copy().T for array in self._found]


def at_columns(function: casadi.Function, *given: Array) -> list[Array]:
    """Return what a function of vectors returns at all columns of matrices, (rows, columns) each."""
    count = given[0].shape[1]
    block = min(BLOCK, count)
    run = Buffered(function.map(block))
    parts = []
    for k in range(0, count, block):
        end = min(k + block, count)
        padded = [np.pad(item[:, k:end], ((0, 0), (0, block - end + k))) for item in given]
        parts.append([item[:, : end - k] for item in run(*padded)])
    return [np.hstack(item) for item in zip(*parts, strict=True)]
