"""Minimum time of a nonlinear plant: the durations of a bang-bang torque's arcs, to the accuracy of the integration.

``min sum d_i`` subject to the terminal conditions, with the durations d_i of the arcs as the only unknowns. The multipliers
give the costate, whose backward propagation gives the switching function. Its sign must be that of the torque; otherwise the
torque has too few arcs, and linear programs along the motion determine their number. Of a slew whose second half mirrors the
first, only the first half is computed.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SlewError
from boomctl.lti.rounding import SUMMED
from boomctl.slew.end_map import CHORDS, MOST_STEPS, STEP_FRACTION, EndMap, end_map
from boomctl.slew.least_time.arc_count import counted
from boomctl.slew.problem import SlewProblem
from boomctl.slew.replay import Candidate
from boomctl.slew.torque import TorqueProfile, bang_bang, held

_GRIDS = (200, 600)  # intervals on which arcs are counted; the finer grid if the switching function has a wrong sign
_NEWTON = 40  # Newton steps at most
_EMPTY = 3e-6  # fraction of the duration below which an arc is removed; _SETTLED if the end conditions require it
_FOURTH_ORDER = 15.0  # 2^4 - 1: ratio of the change of the end by halved steps to their remaining error
_SERVES = 0.2  # ratio of successive moves below which the Hessian is reused
_SETTLED = 1e-11  # scaled terminal residual, and arc or move over the duration, at rounding level
_ENOUGH = 0.1  # predicted time saved by reversing wrong signs of the torque, as a fraction of the tolerance
_POSITIVE, _MAX_MOVE = 0.8, 0.1  # largest fraction of an arc that a move removes; largest move over the duration
_EXTREMAL = 1e-4  # relative gap above which the torque is assumed to have too few arcs
_CURVED = 1e-8  # smallest curvature over the largest: bounds moves along flat directions


@dataclass(frozen=True, eq=False)
class _Arcs:
    """Durations of a bang-bang torque's arcs [s] and the sign of the first, with data on their optimality.

    Sensitivity of the end to the durations, multipliers of the end conditions, Hessian of the weighted end; the predicted
    time [s] saved by other durations, and that by reversing wrong signs of the torque, over the duration.
    """

    durations: Array
    sign: float
    slope: Array = field(default_factory=lambda: np.zeros((0, 0)))
    weights: Array = field(default_factory=lambda: np.zeros(0))
    hessian: Array = field(default_factory=lambda: np.zeros((0, 0)))
    predicted: float = np.inf
    wrong: float = np.inf

    @staticmethod
    def of(profile: TorqueProfile) -> "_Arcs":
        return _Arcs(np.diff(profile.edges), float(np.sign(profile.start_values[0])))

    def profile(self, limit: float) -> TorqueProfile:
        edges = np.cumsum(self.durations)
        return bang_bang(edges[:-1], float(edges[-1]), limit, self.sign)

    def without_shortest(self) -> "_Arcs":
        """Remove the shortest arc and join its neighbors."""
        d, k = self.durations, int(np.argmin(self.durations))
        if k == 0:
            return replace(self, durations=d[1:], sign=-self.sign)
        return replace(self, durations=np.concatenate([d[: k - 1], [d[k - 1 : k + 2 : 2].sum()], d[k + 2 :]]))


def least_time_arcs(problem: SlewProblem, first: TorqueProfile) -> tuple[Candidate | None, tuple[str, ...]]:
    """Compute the minimum-time durations of a bang-bang torque; None if it is not an extremal; and the stages.

    If the second half of the slew mirrors the first, only the first is computed. The gap is the sum of three times over the
    duration: the time saved by reversing wrong signs of the torque, the time equivalent of the integration error at the end,
    and the decrease predicted for other durations.
    """
    half = halved(problem)
    ends = end_map(half or problem, first)
    start = first_half(first) if half else first
    best, stages = _stationary(ends, _Arcs.of(start), 1), ("durations of arcs", *(["first half"] if half else []))
    for intervals in _GRIDS:
        if best is not None and best.wrong < _ENOUGH * problem.planning_rtol:
            break
        try:
            torque = counted(ends, start if best is None else best.profile(problem.limits.torque), intervals)
        except SlewError:  # a motion overflows
            if best is None:
                raise
            break
        more = None if torque is None else _stationary(ends, _Arcs.of(torque), 1)
        best = min((item for item in (more, best) if item is not None), key=lambda item: item.wrong, default=None)
        stages = (*stages, f"arcs counted on {intervals} intervals")
    result = None if best is None else _refined(ends, best)
    if result is None or result.gap >= _EXTREMAL:
        return None, ("durations of arcs: none found",)
    return (replace(result, profile=doubled(result.profile)) if half else result), stages


def led_to_end(ends: EndMap, profile: TorqueProfile, defect: Array) -> TorqueProfile | None:
    """Correct the durations of a torque's arcs for a residual of the scaled end; None if an arc would vanish."""
    arcs = _Arcs.of(profile)
    steps = ends.steps(arcs.sign, arcs.durations, _counts(ends, arcs.durations))
    d = arcs.durations - np.linalg.lstsq(ends.sensitivity(steps).by_duration, defect, rcond=None)[0]
    return replace(arcs, durations=d).profile(ends.problem.limits.torque) if d.min() > _shortest(ends, d) else None


def _refined(ends: EndMap, arcs: _Arcs) -> Candidate | None:
    """Halve the steps until the terminal state changes by less than the tolerance."""
    tolerance, error, finer = ends.problem.planning_rtol, np.inf, 1
    while error > STEP_FRACTION * tolerance and finer * _counts(ends, arcs.durations).sum() < MOST_STEPS:
        finer *= 2
        near, error = _corrected(ends, arcs, finer)
        if near is None:
            near = _stationary(ends, arcs, finer)
        if near is None:
            return None
        arcs = near
    settled = _stationary(ends, arcs, finer)
    if settled is None:
        return None
    profile = settled.profile(ends.problem.limits.torque)
    time_error = float(np.abs(settled.weights).sum()) * error / _FOURTH_ORDER
    gap = settled.wrong + (settled.predicted + time_error) / profile.duration
    return Candidate(profile, "switching times", gap, "extremal")


def _corrected(ends: EndMap, arcs: _Arcs, finer: int) -> tuple[_Arcs | None, float]:
    """Correct the durations for finer steps by the coarser ones' derivatives, or None; return the initial residual too."""
    counts, d, errors = finer * _counts(ends, arcs.durations), arcs.durations, []
    for _ in range(CHORDS):
        ends.problem.deadline.check(f"durations of {d.size} arcs in {counts.sum()} steps", float(d.sum()))
        defect = ends.defect(ends.steps(arcs.sign, d, counts))
        errors.append(float(np.abs(defect).max()))
        d = d - np.linalg.lstsq(arcs.slope, defect, rcond=None)[0]
        if not errors[-1] <= errors[0] or d.min() <= _shortest(ends, d):
            return None, errors[0]
        if errors[-1] < _SETTLED:
            break
    return replace(arcs, durations=d), errors[0]


def _counts(ends: EndMap, durations: Array) -> Array:
    """Return the number of steps of every arc."""
    return np.maximum(2, np.ceil(durations * ends.step_frequency)).astype(int)


def _shortest(ends: EndMap, d: Array) -> float:
    """Return the duration below which an arc is removed: rounding level if the end conditions require all arcs."""
    return float(d.sum()) * (_EMPTY if d.size >= ends.rows.shape[0] + 2 else _SETTLED)


def _stationary(ends: EndMap, arcs: _Arcs, finer: int) -> _Arcs | None:
    """Return stationary durations without vanishing arcs; None if there are too few arcs or Newton's method fails."""
    while arcs.durations.size >= ends.rows.shape[0]:
        answer = _newton(ends, arcs, finer * _counts(ends, arcs.durations))
        if answer is None or answer.durations.min() > _shortest(ends, answer.durations):
            return answer
        arcs = answer.without_shortest()
    return None


def _newton(ends: EndMap, arcs: _Arcs, counts: Array) -> _Arcs | None:
    """Minimize the sum of the durations by Newton's method; stop when an arc vanishes.

    The Hessian is reused while the moves shrink fast enough.
    """
    size, before, total, count = np.inf, np.inf, float(arcs.durations.sum()), arcs.durations.size
    for _ in range(_NEWTON):
        ends.problem.deadline.check(f"durations of {count} arcs in {counts.sum()} steps", total)
        reached = ends.sensitivity(ends.steps(arcs.sign, arcs.durations, counts))
        defect, slope = reached.end - ends.target, reached.by_duration
        if not np.isfinite(slope).all():
            return None
        arcs = replace(arcs, slope=slope, weights=reached.multipliers)
        if count > defect.size and (arcs.hessian.shape[0] != count or size > _SERVES * before):
            arcs = replace(arcs, hessian=ends.hessian(reached, reached.multipliers))
        normal, tangential, predicted = _newton_step(defect, slope, arcs.hessian)
        before, size = size, float(np.abs(normal + tangential).max() / total)
        flat = predicted < SUMMED * total
        if flat and np.abs(normal).max() < _SETTLED * total:
            wrong = np.maximum((reached.multipliers @ reached.by_torque) * reached.steps.u, 0.0)
            return replace(arcs, predicted=predicted, wrong=2.0 * float(np.sum(wrong)) / total)
        d = _moved(arcs.durations, normal)
        arcs = replace(arcs, durations=d if flat else _moved(d, tangential))
        if arcs.durations.min() < _shortest(ends, arcs.durations):
            return arcs
    return None


def _moved(d: Array, move: Array) -> Array:
    """Return the durations after a damped move: they remain positive, none changes by more than a tenth of their sum."""
    shrink = float(np.max(np.maximum(-move, 0.0) / d))
    far = float(np.abs(move).max() / d.sum())
    return d + move * min(1.0, _POSITIVE / max(shrink, _POSITIVE), _MAX_MOVE / max(far, _MAX_MOVE))


def _newton_step(defect: Array, slope: Array, hessian: Array) -> tuple[Array, Array, float]:
    """Return the normal step to the end, the tangential step to the least sum, and the decrease predicted for it, s."""
    m, q = slope.shape
    whole, triangle = np.linalg.qr(slope.T, mode="complete")
    normal = whole[:, :m] @ np.linalg.lstsq(triangle[:m].T, -defect, rcond=1e-14)[0]
    if q == m:
        return normal, np.zeros(q), 0.0
    free = whole[:, m:]
    values, vectors = np.linalg.eigh(free.T @ hessian @ free)
    values = np.maximum(np.abs(values), _CURVED * np.abs(values).max() + 1e-300)
    downhill = vectors.T @ (free.T @ (np.ones(q) + hessian @ normal))
    return normal, -free @ (vectors @ (downhill / values)), 0.5 * float(np.sum(downhill**2 / values))


def halved(problem: SlewProblem) -> SlewProblem | None:
    """Return the first half of a slew whose second half is its mirror image; None if there is no such symmetry.

    Undamped beams from rest to rest are reversible: ``u(t) = -u(T - t)``, with positions mirrored about the middle. The
    first half must then end at T/2 with the positions in the middle; the rates are free.
    """
    damped = any(np.any(plant.A[plant.n // 2 :, plant.n // 2 :]) for plant in problem.plants)
    if problem.linear or problem.angle is None or problem.final_speed or damped:
        return None
    rows = [own.start + np.arange(1 if k else 0, plant.n // 2) for k, (plant, own) in enumerate(problem.parts)]
    return replace(problem, ends=np.eye(problem.start.size)[np.concatenate(rows)], target=0.5 * problem.target)


def first_half(profile: TorqueProfile) -> TorqueProfile:
    """Return a torque up to the middle of its duration."""
    middle = 0.5 * profile.duration
    # an edge counts as before the middle if the distance exceeds rounding error
    inner = profile.edges[profile.edges < middle * (1.0 - SUMMED)]
    edges = np.append(inner, middle)
    return held(edges, profile.start_values[: inner.size])


def doubled(profile: TorqueProfile) -> TorqueProfile:
    """Return a torque that is held on arcs, followed by its negative mirror image."""
    widths = np.diff(profile.edges)
    edges = np.concatenate([[0.0], np.cumsum(np.concatenate([widths, widths[::-1]]))])
    return held(edges, np.concatenate([profile.start_values, -profile.start_values[::-1]]))
