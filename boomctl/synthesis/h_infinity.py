"""``h_infinity``: controllers whose closed loop was verified, and a bound that tells how far from the best they are."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormCertificate, StateMatrices, matrices_norm
from boomctl.checks import positive
from boomctl.synthesis.assumptions import check_modes, check_ranks, check_zeros
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.loop import closed, named_loop, with_feedthrough
from boomctl.synthesis.native import NativeFailure, shared_worker
from boomctl.synthesis.partition import Normalised, Plant, normalised, partition
from boomctl.synthesis.result import HInfinityCertificate, HInfinityResult
from boomctl.synthesis.search import Bounds, Deadline, lowest_level
from boomctl.synthesis.slow_poles import without_fast_poles
from boomctl.synthesis.two_riccati import central_controller, level_of

if TYPE_CHECKING:
    import control

__all__ = ["h_infinity"]

_BAND = 1000.0
_STEPS = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 3.0, 10.0, 100.0)
_SEARCH = 0.25
_ACCEPT = 0.01
_BELOW = 0.95


def h_infinity(
    P: "control.StateSpace",
    nmeas: int,
    ncon: int,
    *,
    gamma: float | None = None,
    tolerance: float = 0.01,
    fastest_pole: float | None = None,
    time_limit: float = 60.0,
) -> HInfinityResult:
    """Return a controller ``u = K y`` that holds the H-infinity norm of the closed loop near the lowest possible.

    The assumptions are checked first.  Each controller tried is verified: closed loop stable, norm certified and not
    above 1.01 times the level it was computed for.  Controllers whose poles can be implemented come first, even where
    that costs more than ``tolerance``; the certificate says so.

    Parameters
    ----------
    P : control.StateSpace
        Generalised plant in continuous time: the last ``nmeas`` outputs are measured, the last ``ncon`` inputs are
        controls (`generalized_plant` makes one).
    nmeas, ncon : int
    gamma : float, optional
        A level that is enough: the closed loop's norm will not exceed it, and nothing lower is sought.
    tolerance : float
        How far above the lower bound the norm may lie, relative to it.
    fastest_pole : float, optional
        Largest magnitude of the controller's poles [rad/s].  By default 1,000 times the fastest pole of the plant and
        of its H2-optimal state feedback and filter.
    time_limit : float
        Seconds after which it gives up; starting the process for native synthesis, once, does not count.

    Returns
    -------
    HInfinityResult

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite, counts or numbers out of range.
    SynthesisError
        An assumption fails, at the signal or mode named; ``gamma`` lies below what any controller reaches; no
        controller could be verified; out of time.

    Examples
    --------
    >>> import control
    >>> P = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    >>> design = h_infinity(P, 1, 1)
    >>> bool(design.gamma <= 1.01 * design.certificate.lower)
    True
    """
    plant = partition(P, nmeas, ncon)
    wanted = None if gamma is None else positive("gamma", gamma)
    share, limit = positive("tolerance", tolerance), positive("time_limit", time_limit)
    allowed = None if fastest_pole is None else positive("fastest_pole", fastest_pole)
    check_ranks(plant)
    ready = normalised(plant)
    check_modes(plant, ready)
    check_zeros(plant, ready)
    shared_worker().warm()
    deadline = Deadline.after(limit)
    bounds = lowest_level(ready, _SEARCH * share, deadline)
    if wanted is not None and wanted < bounds.lower:
        raise SynthesisError(_too_low(wanted, bounds))
    fastest = allowed if allowed is not None else (_BAND * bounds.band or np.inf)
    task = _Task(plant, ready, bounds, fastest, share, deadline)
    return _result(task, _first(task, _levels(bounds, share, wanted)))


@dataclass(frozen=True)
class _Task:
    plant: Plant
    ready: Normalised
    bounds: Bounds
    fastest: float
    tolerance: float
    deadline: Deadline


@dataclass(frozen=True)
class _Candidate:
    """A controller that passed, with what was found of it."""

    K: StateMatrices
    loop: StateMatrices
    norm: NormCertificate
    slowest: float
    level: float
    solver: str


def _too_low(wanted: float, bounds: Bounds) -> str:
    why = (
        f"at {bounds.omega:.4g} rad/s no controller goes below {bounds.frequency:.6g}"
        if bounds.frequency >= bounds.riccati
        else f"below {bounds.riccati:.6g} {bounds.reason}"
    )
    return f"gamma = {wanted:.6g} cannot be reached: {why}"


def _levels(bounds: Bounds, tolerance: float, wanted: float | None) -> Iterator[float]:
    """Yield levels to try, none below what can be reached: first the highest within the tolerance."""
    if wanted is not None:
        yield from sorted({max(wanted * share, bounds.reached) for share in (1.0, 0.999, 0.99)}, reverse=True)
        return
    lower = bounds.lower or bounds.reached
    for share in (_BELOW * tolerance, 0.5 * tolerance, tolerance, *(step for step in _STEPS if step > tolerance)):
        yield max(lower * (1.0 + share), bounds.reached * (1.0 + 0.1 * tolerance))


def _first(task: _Task, levels: Iterator[float]) -> _Candidate:
    """Return the first controller that passes.

    Raises
    ------
    SynthesisError
        None does; why each was rejected is told.
    """
    rejected: dict[str, str] = {}
    for level in levels:
        for solver, K in _controllers(task, level, rejected):
            found = _judged(task, K, level, solver)
            if isinstance(found, _Candidate):
                return found
            rejected[solver] = found
    told = "; ".join(f"{solver}: {why}" for solver, why in rejected.items())
    raise SynthesisError(
        f"no controller passed verification ({told}); levels from {task.bounds.reached:.6g} were tried"
    )


def _controllers(task: _Task, level: float, rejected: dict[str, str]) -> Iterator[tuple[str, StateMatrices]]:
    """Yield controllers of a level, each also without its too fast poles; refusals go into ``rejected``."""
    for solver, solve in (("SLICOT SB10FD", _native), ("two Riccati equations", _own)):
        task.deadline.left(f"computing a controller for gamma = {level:.6g}")
        try:
            K = _in_plant_signals(task, solve(task, level))
        except (NativeFailure, ValueError, linalg.LinAlgError) as error:
            rejected[solver] = str(error)
            continue
        if _fastest(K) <= task.fastest:
            yield solver, K
            continue
        rejected[solver] = f"a pole at {_fastest(K):.3g} rad/s, {task.fastest:.3g} are allowed"
        slower = without_fast_poles(K, task.fastest)
        if slower is not None:
            yield f"{solver}, fast poles residualised", slower


def _native(task: _Task, level: float) -> StateMatrices:
    """Return the native controller; the plant's signals are scaled so that the level is one."""
    ready, root = task.ready, np.sqrt(level)
    D = np.block([[ready.D11 / level, ready.D12 / root], [ready.D21 / root, task.plant.D22 * 0.0]])
    B, C = np.hstack([ready.B1 / root, ready.B2]), np.vstack([ready.C1 / root, ready.C2])
    ncon, nmeas = ready.B2.shape[1], len(ready.C2)
    limit = task.deadline.left("waiting for the native solver")
    return shared_worker().controller(StateMatrices(ready.A, B, C, D), nmeas, ncon, 1.0, limit)


def _own(task: _Task, level: float) -> StateMatrices:
    found = level_of(task.ready, level)
    if found.reason:
        raise ValueError(found.reason)
    return central_controller(task.ready, found)


def _in_plant_signals(task: _Task, K: StateMatrices) -> StateMatrices:
    outward, inward = task.ready.from_controls, task.ready.from_measurements
    scaled = StateMatrices(K.A, K.B @ inward, outward @ K.C, outward @ K.D @ inward)
    if not all(np.isfinite(part).all() for part in (scaled.A, scaled.B, scaled.C, scaled.D)):
        raise ValueError("a controller that is not finite")
    return with_feedthrough(scaled, task.plant.D22)


def _fastest(K: StateMatrices) -> float:
    return float(np.abs(linalg.eigvals(K.A)).max()) if len(K.A) else 0.0


def _judged(task: _Task, K: StateMatrices, level: float, solver: str) -> _Candidate | str:
    """Return a controller with its certificate, or why it is rejected."""
    task.deadline.left(f"verifying a controller for gamma = {level:.6g}")
    try:
        loop = closed(task.plant, K)
    except ValueError as error:
        return str(error)
    slowest = float(linalg.eigvals(loop.A).real.max()) if len(loop.A) else -np.inf
    if slowest >= 0.0:
        return f"its loop has a pole with real part {slowest:.3g} rad/s"
    norm = matrices_norm(_balanced(loop))
    if not norm.certified:
        return f"the norm of its loop could not be certified ({norm.method})"
    if norm.upper > (1.0 + _ACCEPT) * level:
        return f"its loop has norm {norm.lower:.6g} instead of {level:.6g}"
    return _Candidate(K, loop, norm, slowest, level, solver)


def _balanced(loop: StateMatrices) -> StateMatrices:
    if not len(loop.A):
        return loop
    A, (scale, _) = linalg.matrix_balance(loop.A, permute=False, separate=True)
    return StateMatrices(A, loop.B / scale[:, None], loop.C * scale[None, :], loop.D)


def _result(task: _Task, found: _Candidate) -> HInfinityResult:
    import control

    plant, bounds, K = task.plant, task.bounds, found.K
    controller = control.ss(
        K.A, K.B, K.C, K.D, inputs=list(plant.measurements), outputs=list(plant.controls), name="controller"
    )
    certificate = HInfinityCertificate(
        found.norm, found.slowest, bounds.lower, bounds.frequency, bounds.omega, bounds.riccati, bounds.reason,
        found.level, _fastest(K), task.fastest, found.solver, _statement(task, found),
    )  # fmt: skip
    return HInfinityResult(controller, named_loop(plant, found.loop), found.norm.lower, certificate)


def _statement(task: _Task, found: _Candidate) -> str:
    bounds, gamma = task.bounds, found.norm.upper
    if bounds.lower <= 0.0:
        return f"verified norm {gamma:.6g}; nothing bounds it from below"
    above = gamma / bounds.lower - 1.0
    told = (
        f"verified norm {gamma:.6g}, at most {100.0 * above:.2g} % above {bounds.lower:.6g}, which no controller beats"
    )
    if above > task.tolerance:
        told += f"; more than the {100.0 * task.tolerance:.3g} % wanted, for controllers closer to it have poles above "
        told += f"{task.fastest:.3g} rad/s or could not be verified"
    return told
