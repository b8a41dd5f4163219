"""Controllers of one level after another, each verified in its loop before anyone sees it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormCertificate, matrices_norm
from boomctl.lti.system import Lti
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.fast_poles import without_fast_poles
from boomctl.synthesis.hinf.central import controllers_of
from boomctl.synthesis.hinf.native import NativeFailure, shared_worker
from boomctl.synthesis.hinf.search import Bounds, Deadline
from boomctl.synthesis.hinf.two_riccati import level_of
from boomctl.synthesis.plants.closed_loop import closed, with_feedthrough
from boomctl.synthesis.plants.partition import Normalised, Plant

_ACCEPT = 0.01
_BELOW = 0.95
_CLOSE = 0.05
_FAR = (0.1, 0.2, 0.4, 0.7, 1.0)
_ANY = (*_FAR, 3.0, 10.0, 100.0)
_HALVINGS = 3


@dataclass(frozen=True)
class Task:
    """A plant, what bounds its loops from below, and what is wanted of a controller."""

    plant: Plant
    ready: Normalised
    bounds: Bounds
    fastest: float
    tolerance: float
    deadline: Deadline
    wanted: float | None = None


@dataclass(frozen=True)
class Candidate:
    """A controller that passed, the loop it passed in, and what was found of it."""

    K: Lti
    loop: Lti
    norm: NormCertificate
    slowest: float
    level: float
    solver: str


def levels_within(task: Task, shares: Sequence[float]) -> list[float]:
    """Return levels these shares above the lower bound, ascending from the third, none below what can be reached."""
    base, least = task.bounds.lower or task.bounds.reached, task.bounds.reached * (1.0 + 0.1 * task.tolerance)
    return [max(base * (1.0 + share), least) for share in shares]


def first_accepted(task: Task, strict: bool) -> Candidate:
    """Return a controller whose poles may be implemented, as near to the lower bound as that allows.

    Where none is found up to twice the lower bound, and unless ``strict``, one with faster poles comes back.

    Raises
    ------
    SynthesisError
        No controller passes; why each was rejected is told.
    """
    rejected: dict[str, str] = {}
    t = task.tolerance
    if task.wanted is not None:
        shares = [max(task.wanted * share, task.bounds.reached) for share in (0.9999, 0.999, 0.99)]
        found = next(_accepted(task, sorted(set(shares), reverse=True), rejected), None)
    else:
        near = levels_within(task, (_BELOW * t, 0.5 * t, t, *(s for s in (2.0 * t, 0.02, 0.97 * _CLOSE) if s > t)))
        found = next(_accepted(task, near, rejected), None) or _farther(task, near[-1], strict, rejected)
    if found is None and not strict:
        found = next(
            _accepted(replace(task, fastest=np.inf), levels_within(task, (_BELOW * t, t, *_ANY)), rejected), None
        )
    if found is not None:
        return found
    told = "; ".join(f"{solver}: {why}" for solver, why in rejected.items())
    raise SynthesisError(f"no controller passed verification, from gamma = {task.bounds.reached:.6g} on ({told})")


def _farther(task: Task, last: float, strict: bool, rejected: dict[str, str]) -> Candidate | None:
    """Return a controller from farther above the bound, the level halved back towards the last that gave none."""
    levels = [last, *(level for level in levels_within(task, _ANY if strict else _FAR) if level > last)]
    for below, above in pairwise(levels):
        found = next(_accepted(task, [above], rejected), None)
        if found is None:
            continue
        for _ in range(_HALVINGS):
            middle = float(np.sqrt(below * above))
            better = next(_accepted(task, [middle], rejected), None)
            below, above, found = (below, middle, better) if better is not None else (middle, above, found)
        return found
    return None


def _accepted(task: Task, levels: Sequence[float], rejected: dict[str, str]) -> Iterator[Candidate]:
    """Yield the controllers that pass; why others do not goes into ``rejected``."""
    for level in levels:
        limit = task.wanted if task.wanted is not None else (1.0 + _ACCEPT) * level
        for solver, K in _controllers(task, level, rejected):
            task.deadline.left(f"verifying a controller for gamma = {level:.6g}")
            found = judged(task.plant, K, limit)
            if isinstance(found, str):
                rejected[solver] = found
            else:
                yield replace(found, level=level, solver=solver)


def _controllers(task: Task, level: float, rejected: dict[str, str]) -> Iterator[tuple[str, Lti]]:
    """Yield controllers of a level, one with poles that are too fast without these; refusals go into ``rejected``."""
    solvers: dict[str, Callable[[Task, float], Lti]] = {
        "SLICOT SB10FD": _native,
        "two Riccati equations": _own,
    }
    for solver, solve in solvers.items():
        task.deadline.left(f"computing a controller for gamma = {level:.6g}")
        try:
            K = _in_plant_signals(task, solve(task, level))
        except (NativeFailure, ValueError, np.linalg.LinAlgError) as error:
            rejected[solver] = str(error)
            continue
        speed = largest_pole(K)
        if speed <= task.fastest:
            yield solver, K
            continue
        rejected[solver] = f"a pole at {speed:.3g} rad/s where {task.fastest:.3g} are allowed"
        slower = without_fast_poles(K, task.fastest)
        if slower is not None:
            yield f"{solver}, fast poles residualised", slower


def _native(task: Task, level: float) -> Lti:
    """Return the native controller; the plant's signals are scaled so that the level is one."""
    ready, root = task.ready, np.sqrt(level)
    ncon, nmeas = ready.B2.shape[1], len(ready.C2)
    D = np.block([[ready.D11 / level, ready.D12 / root], [ready.D21 / root, np.zeros((nmeas, ncon))]])
    B, C = np.hstack([ready.B1 / root, ready.B2]), np.vstack([ready.C1 / root, ready.C2])
    limit = 0.5 * task.deadline.left("waiting for the native solver")
    return shared_worker().controller(Lti(ready.A, B, C, D), nmeas, ncon, 1.0, limit)


def _own(task: Task, level: float) -> Lti:
    found = level_of(task.ready, level)
    if found.reason:
        raise ValueError(found.reason)
    family, D22 = controllers_of(task.ready, found), task.plant.D22
    return (
        family.posed_for(task.ready.from_measurements @ D22 @ task.ready.from_controls)
        if D22.any()
        else family.member()
    )


def _in_plant_signals(task: Task, K: Lti) -> Lti:
    outward, inward = task.ready.from_controls, task.ready.from_measurements
    scaled = Lti(K.A, K.B @ inward, outward @ K.C, outward @ K.D @ inward)
    if not all(np.isfinite(part).all() for part in (scaled.A, scaled.B, scaled.C, scaled.D)):
        raise ValueError("a controller that is not finite")
    return with_feedthrough(scaled, task.plant.D22)


def largest_pole(K: Lti) -> float:
    """Return the largest magnitude of a controller's poles [rad/s]."""
    return float(np.abs(linalg.eigvals(K.A)).max()) if len(K.A) else 0.0


def judged(plant: Plant, K: Lti, limit: float) -> Candidate | str:
    """Return a controller with its certificate if its loop is stable and its norm not above ``limit``; else why not."""
    try:
        loop = _balanced(closed(plant, K))
    except ValueError as error:
        return str(error)
    slowest = float(linalg.eigvals(loop.A).real.max()) if len(loop.A) else -np.inf
    if slowest >= 0.0:
        return f"its loop has a pole with real part {slowest:.3g} rad/s"
    norm = matrices_norm(loop)
    if not norm.certified:
        return f"the norm of its loop could not be certified ({norm.method})"
    if norm.upper > limit:
        return f"its loop has norm {norm.lower:.6g}, more than {limit:.6g}"
    return Candidate(K, loop, norm, slowest, norm.upper, "")


def _balanced(loop: Lti) -> Lti:
    """Return a system whose states are scaled by powers of two, so that its digits survive whoever evaluates it."""
    if not len(loop.A):
        return loop
    A, (scale, _) = linalg.matrix_balance(loop.A, permute=False, separate=True)
    return Lti(A, loop.B / scale[:, None], loop.C * scale[None, :], loop.D)
