"""Controllers of one level after another, each verified in its loop before anyone sees it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from boomctl.analysis.norm import NormBounds, matrices_norm
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import split
from boomctl.lti.rounding import SOLVED
from boomctl.lti.system import ClosedLoop, Lti, rates_of
from boomctl.progress import Deadline
from boomctl.synthesis.hinf.bounds import CLOSEST, Bounds
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.hinf.two_riccati import Level, level_of, suboptimal_controller
from boomctl.synthesis.plants.partition import GeneralizedPlant, with_feedthrough

# Share by which a loop's norm may exceed the level its controller was computed for: rounding of the solver
_ACCEPT = 0.01

# Levels in the order tried, as shares above the lower bound.  All are choices: a controller nearer the optimum has faster
# poles, so that the first level takes up nearly all of the tolerance and leaves the rest to rounding.
_FIRST = (CLOSEST, 0.5, 1.0)  # of the tolerance
_CLOSE = (0.02, 0.0485)  # up to 5 % with rounding: then twice the tolerance and these, where they are more than it
_FAR = (0.1, 0.2, 0.4, 0.7, 1.0)  # then up to twice the bound, where poles may stay slow only at that cost
_ANY = (*_FAR, 3.0, 10.0, 100.0)  # where slow poles were asked for, at whatever cost
# Of the ratio between the last level that failed and the first that passed: to an eighth of its logarithm
_HALVINGS = 3

# A controller that was tried: who computed it, for which level, and what came of it
_Tried = tuple[str, float, str]


@dataclass(frozen=True)
class Task:
    """A plant, what bounds its loops from below, the equations of the level reached, and what is wanted of a controller."""

    plant: GeneralizedPlant
    ready: NormalizedPlant
    bounds: Bounds
    reached: Level
    fastest: float
    tolerance: float
    deadline: Deadline
    wanted: float | None = None


@dataclass(frozen=True)
class Candidate:
    """A controller that passed, the loop it passed in, and what was found of it; ``stages`` tells what was tried."""

    K: Lti
    loop: Lti
    norm: NormBounds
    slowest: float
    stages: tuple[str, ...] = ()


def first_accepted(task: Task, strict: bool) -> Candidate:
    """Return a controller whose poles may be implemented, as near to the lower bound as that allows.

    Where none is found up to twice the lower bound, and unless ``strict``, one with faster poles comes back.

    Raises
    ------
    SynthesisError
        No controller passes; why each was rejected is told.
    OutOfTimeError
        There was no time left for another one.
    """
    tried: list[_Tried] = []
    t = task.tolerance
    first = [share * t for share in _FIRST]
    if task.wanted is not None:
        levels = {max(task.wanted * share, task.bounds.reached) for share in (0.9999, 0.999, 0.99)}
        result = _first_of(task, sorted(levels, reverse=True), tried)
    else:
        near = _levels(task, (*first, *(share for share in (2.0 * t, *_CLOSE) if share > t)))
        result = _first_of(task, near, tried) or _farther(task, near[-1], strict, tried)
    if result is None and not strict:
        result = _first_of(replace(task, fastest=np.inf), _levels(task, (first[0], t, *_ANY)), tried)
    if result is not None:
        stages = (f"{solver} at gamma = {level:.6g}: {outcome}" for solver, level, outcome in tried)
        return replace(result, stages=tuple(stages))
    last = {solver: outcome for solver, _, outcome in tried}
    told = "; ".join(f"{solver}: {outcome}" for solver, outcome in last.items())
    raise SynthesisError(f"no controller passed verification, from gamma = {task.bounds.reached:.6g} on ({told})")


def _levels(task: Task, shares: Sequence[float]) -> list[float]:
    """Return levels that lie these shares above the lower bound, none of them below what can be reached."""
    reached = task.bounds.reached
    levels = [(task.bounds.lower or reached) * (1.0 + share) for share in shares]
    return [level if level >= reached else reached * (1.0 + 0.1 * task.tolerance) for level in levels]


def _farther(task: Task, last: float, strict: bool, tried: list[_Tried]) -> Candidate | None:
    """Return a controller from farther above the bound, the level halved back towards the last that gave none."""
    levels = [last, *(level for level in _levels(task, _ANY if strict else _FAR) if level > last)]
    for below, above in pairwise(levels):
        result = _first_of(task, [above], tried)
        if result is None:
            continue
        for _ in range(_HALVINGS):
            middle = float(np.sqrt(below * above))
            better = _first_of(task, [middle], tried)
            below, above, result = (below, middle, better) if better is not None else (middle, above, result)
        return result
    return None


def _first_of(task: Task, levels: Sequence[float], tried: list[_Tried]) -> Candidate | None:
    """Return the first controller of these levels that passes; all that were computed go into ``tried``."""
    for level in levels:
        limit = task.wanted if task.wanted is not None else (1.0 + _ACCEPT) * level
        for solver, K in _controllers(task, level, tried):
            task.deadline.check(f"verifying a controller for gamma = {level:.6g}")
            result = verified_candidate(task.plant, K, limit)
            if isinstance(result, Candidate):
                tried.append((solver, level, "passed"))
                return result
            tried.append((solver, level, result))
    return None


def _controllers(task: Task, level: float, tried: list[_Tried]) -> Iterator[tuple[str, Lti]]:
    """Yield controllers of a level, one with poles that are too fast without these; refusals go into ``tried``."""
    for solver, ready in (("two Riccati equations", task.ready), ("states in another order", task.ready.reordered)):
        task.deadline.check(f"computing a controller for gamma = {level:.6g}")
        outward, inward = ready.from_controls, ready.from_measurements
        try:
            # the first level tried is often the one that was reached
            known = ready is task.ready and abs(level / task.reached.gamma - 1.0) <= SOLVED
            result = task.reached if known else level_of(ready, level)
            if result.reason:
                raise ValueError(result.reason)
            K = suboptimal_controller(ready, result, inward @ task.plant.D22 @ outward)
            K = Lti(K.A, K.B @ inward, outward @ K.C, outward @ K.D @ inward)
            if not all(np.isfinite(part).all() for part in (K.A, K.B, K.C, K.D)):
                raise ValueError("a controller that is not finite")
            K = with_feedthrough(K, task.plant.D22)
        except (ValueError, np.linalg.LinAlgError) as error:
            tried.append((solver, level, str(error)))
            continue
        speed = largest_pole(K)
        if speed <= task.fastest:
            yield solver, K
            continue
        tried.append((solver, level, f"a pole at {speed:.3g} rad/s where {task.fastest:.3g} are allowed"))
        slower = without_fast_poles(K, task.fastest)
        if slower is not None:
            yield f"{solver}, fast poles residualised", slower


def largest_pole(K: Lti) -> float:
    """Return the largest magnitude of a controller's poles [rad/s]."""
    return float(np.abs(K.poles).max(initial=0.0))


def without_fast_poles(K: Lti, fastest: float) -> Lti | None:
    """Return a system without its poles above a magnitude [rad/s], their gain at zero frequency kept in ``D``.

    None comes back where they cannot be split off.  Nothing is said of the loop: verify it.
    """
    try:
        fast, slow, _ = split(K, np.abs(K.poles) > fastest)
        D = slow.D - fast.C @ np.linalg.solve(fast.A, fast.B)
    except (np.linalg.LinAlgError, ValueError):
        return None
    slower = replace(K, A=slow.A, B=slow.B, C=slow.C, D=D, state_labels=())
    return slower if all(np.isfinite(part).all() for part in (slower.B, slower.C, slower.D)) else None


def verified_candidate(plant: GeneralizedPlant, K: Lti, limit: float) -> Candidate | str:
    """Return a controller with its certificate if its loop is stable and its norm not above ``limit``; else why not."""
    try:
        parts = ClosedLoop(plant.system, K)
        loop = parts.system
    except ValueError as error:
        return str(error)
    slowest = float(rates_of(loop.eigensystem[0], loop.dt).real.max(initial=-np.inf))
    if slowest >= 0.0:
        return f"its loop has a pole with real part {slowest:.3g} rad/s"
    norm = matrices_norm(parts)
    if not norm.certified:
        return f"the norm of its loop could not be certified ({norm.method})"
    if norm.upper_bound > limit or norm.lower_bound == np.inf:
        return f"its loop has norm {norm.lower_bound:.6g}, more than {limit:.6g}"
    return Candidate(K, loop, norm, slowest)
