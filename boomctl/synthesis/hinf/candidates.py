"""The H-infinity controller of the lowest level that passes two tests: slow enough poles, and a verified closed loop."""

from bisect import bisect_left
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from boomctl.analysis.norm import NormBounds, matrices_norm
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import split
from boomctl.lti.rounding import SOLVED
from boomctl.lti.system import ClosedLoop, Lti, rates_of
from boomctl.progress import Deadline
from boomctl.synthesis.hinf.bounds import FIRST_LEVEL, Bounds
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.hinf.two_riccati import Level, level_of, suboptimal_controller
from boomctl.synthesis.plants.partition import GeneralizedPlant, with_feedthrough

_NORM_RTOL = 0.01  # Excess of the norm of a loop over the level of its controller, by rounding of the solver.
_WANTED_LEVELS = (0.9999, 0.99)  # Levels below a wanted norm; the second one leaves more for rounding.
# Excess of the first levels over the lower bound, relative to rtol. The nearer one has faster poles, further from those
# that are retained if they are residualized.
_FIRST_LEVELS = (FIRST_LEVEL, 0.5)
# Largest excess over the lower bound with poles below the default limit, and with no limit or one that the user set.
_MAX_EXCESS, _MAX_EXCESS_STRICT = 1.0, 100.0
_LEVELS = 255  # Between rtol and the largest excess; bisection takes eight of them.


@dataclass(frozen=True)
class Task:
    """A plant, lower bounds of its loops, the lowest level reached, and the requirements on a controller."""

    plant: GeneralizedPlant
    ready: NormalizedPlant
    bounds: Bounds
    reached: Level
    fastest: float
    rtol: float
    deadline: Deadline
    wanted: float | None = None

    def level(self, excess: float) -> float:
        """Return a level by its excess over the lower bound, not below the one that is reached."""
        reached = self.bounds.reached
        level = (self.bounds.lower or reached) * (1.0 + excess)
        return level if level >= reached else reached * (1.0 + 0.1 * self.rtol)


@dataclass(frozen=True)
class Candidate:
    """A controller, its verified closed loop with norm and spectral abscissa, and the log of the search."""

    K: Lti
    loop: Lti
    norm: NormBounds
    abscissa: float
    stages: tuple[str, ...] = ()


def lowest_controller(task: Task, strict: bool) -> Candidate:
    """Return the controller of the lowest level whose poles are slow enough and whose loop is verified.

    If there is none up to twice the lower bound, and unless ``strict``, the limit on the poles is dropped.

    Raises
    ------
    SynthesisError
        If no controller passes, with the reasons.
    OutOfTimeError
        If the time is up.
    """
    log: list[str] = []
    limits = {task.fastest: _MAX_EXCESS_STRICT} if strict else {task.fastest: _MAX_EXCESS, np.inf: _MAX_EXCESS_STRICT}
    for fastest, most in limits.items():
        passed: dict[float, Candidate] = {}
        passes = partial(_passes, replace(task, fastest=fastest), passed, log)
        if task.wanted is not None:
            any(passes(max(task.wanted * factor, task.bounds.reached)) for factor in _WANTED_LEVELS)
        elif not any(passes(task.level(factor * task.rtol)) for factor in _FIRST_LEVELS):
            levels = [task.level(excess) for excess in np.geomspace(task.rtol, most, _LEVELS)]
            bisect_left(levels, True, key=passes)
        if passed:
            return replace(passed[min(passed)], stages=tuple(log))
    raise SynthesisError(f"No controller passed verification: {'; '.join(log[-2:])}.")


def _passes(task: Task, passed: dict[float, Candidate], log: list[str], gamma: float) -> bool:
    """Return whether the controller of a level passes, without its poles that are too fast; append the outcome to the log."""
    task.deadline.check(f"computing a controller for gamma = {gamma:.6g}")
    name, level = "two Riccati equations", f"at gamma = {gamma:.6g}"
    try:
        K = _controller(task, gamma)
        if (speed := largest_pole(K)) > task.fastest:
            log.append(f"{name} {level}: a pole at {speed:.3g} rad/s where {task.fastest:.3g} are allowed")
            name, K = f"{name}, fast poles residualized", without_fast_poles(K, task.fastest)
        passed[gamma] = verified_candidate(task.plant, K, task.wanted or (1.0 + _NORM_RTOL) * gamma)
    except ValueError as error:  # Also `numpy.linalg.LinAlgError`.
        log.append(f"{name} {level}: {error}")
        return False
    log.append(f"{name} {level}: passed")
    return True


def _controller(task: Task, gamma: float) -> Lti:
    """Return the controller of a level in the signals of the plant.

    Raises
    ------
    ValueError
        If the level is not reached, or if the controller is not finite or its loop not well-posed.
    """
    ready, D22 = task.ready, task.plant.D22
    outward, inward = ready.from_controls, ready.from_measurements
    level = task.reached if abs(gamma / task.reached.gamma - 1.0) <= SOLVED else level_of(ready, gamma)
    if level.reason:
        raise ValueError(level.reason)
    K = suboptimal_controller(ready, level, inward @ D22 @ outward)
    K = Lti(K.A, K.B @ inward, outward @ K.C, outward @ K.D @ inward)
    if not all(np.isfinite(part).all() for part in (K.A, K.B, K.C, K.D)):
        raise ValueError("a controller that is not finite")
    return with_feedthrough(K, D22)


def largest_pole(K: Lti) -> float:
    """Return the largest magnitude of a controller's poles [rad/s]."""
    return float(np.abs(K.poles).max(initial=0.0))


def without_fast_poles(K: Lti, fastest: float) -> Lti:
    """Return a controller with the poles above a magnitude [rad/s] replaced by their static gain.

    Raises
    ------
    ValueError
        If these poles cannot be separated.
    """
    parts = split(K, np.abs(K.poles) > fastest)
    fast, slow = parts.retained, parts.rest
    D = slow.D - fast.C @ np.linalg.solve(fast.A, fast.B)
    if not all(np.isfinite(part).all() for part in (slow.B, slow.C, D)):
        raise ValueError("fast poles cannot be separated")
    return replace(K, A=slow.A, B=slow.B, C=slow.C, D=D, state_labels=())


def verified_candidate(plant: GeneralizedPlant, K: Lti, limit: float, fastest: float = np.inf) -> Candidate:
    """Return a controller whose loop is stable, with a verified norm up to ``limit``, and its poles up to ``fastest``.

    Raises
    ------
    ValueError
        If the controller does not pass, with the reason.
    """
    if (speed := largest_pole(K)) > fastest:
        raise ValueError(f"a pole at {speed:.3g} rad/s where {fastest:.3g} are allowed")
    parts = ClosedLoop(plant.system, K)
    loop = parts.system
    abscissa = float(rates_of(loop.eigensystem[0], loop.dt).real.max(initial=-np.inf))
    if abscissa >= 0.0:
        raise ValueError(f"its loop has a pole with real part {abscissa:.3g} rad/s")
    norm = matrices_norm(parts)
    if not norm.verified:
        raise ValueError(f"the norm of its loop could not be verified ({norm.method})")
    if norm.upper_bound > limit or norm.lower_bound == np.inf:
        raise ValueError(f"its loop has norm {norm.lower_bound:.6g}, more than {limit:.6g}")
    return Candidate(K, loop, norm, abscissa)
