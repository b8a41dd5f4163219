"""Worst-case norm of a loop over a box of parameters: worst point of a search, and a proved upper bound."""

from dataclasses import dataclass
from functools import cache
from math import inf, isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.points import listed_values, pattern_search
from boomctl.analysis.box.polynomials import stable, value_at
from boomctl.analysis.box.prove import COST_RATIO, BoxProof, Statement, prove_box
from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.analysis.loops import sign_advice
from boomctl.analysis.norm import NAMES, NormBounds, matrices_norm
from boomctl.arrays import Array
from boomctl.checks import from_on, known, positive, whole
from boomctl.lti.rounding import LEVEL
from boomctl.lti.system import Lti, of
from boomctl.printing import count, sentence
from boomctl.progress import Listener, computing, tell
from boomctl.structure.families import Family
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import control

    from boomctl.analysis.box.level import LoopPart
    from boomctl.analysis.box.scheduled import ScheduledController

_CELLS = 60_000  # Largest number of cells at one level: about ten seconds.
_LARGEST = 1.0  # Largest tolerance.
_LOOSER = 10.0  # Factor on the tolerance when the cell budget is exhausted.
_LOOSENED = 2  # Largest number of such increases.
_LOST = "loop unstable or undamped"
_CHECKED = 8  # Random points of the box at which a bound is checked.


@dataclass(frozen=True)
class WorstCase:
    """Worst-case norm over a box of parameters: the largest computed norm, and an upper bound of the H-infinity norm.

    Attributes
    ----------
    worst_norm : NormBounds
        Norm at the worst point of the search; infinite if the loop is unstable there.
    worst_values : dict
        Parameter values of this point.
    nominal : NormBounds
        Norm at the midpoint of the box.
    nfev : int
        Number of points evaluated.
    upper_bound : float
        Proved upper bound of the norm at every point of the box; ``inf`` without a proof.
    cells : int
        Number of cells of the proof.
    message : str
        Reason why no bound was proved; empty if one was.
    method : str
        Numbers of cells of each kind in the proof; empty without a proof.
    """

    worst_norm: NormBounds
    worst_values: dict[str, float]
    nominal: NormBounds
    nfev: int
    upper_bound: float = inf
    cells: int = 0
    message: str = ""
    method: str = ""

    @property
    def lower_bound(self) -> float:
        """Largest computed norm: the lower bound of ``worst_norm``."""
        return self.worst_norm.lower_bound

    @property
    def relative_gap(self) -> float:
        """Relative gap between the upper and the lower bound."""
        return self.upper_bound / self.lower_bound - 1.0 if 0.0 < self.lower_bound < inf else 0.0

    def __repr__(self) -> str:
        return sentence("WorstCase", self.summary)

    @property
    def summary(self) -> str:
        """Return the worst case as text.

        Returns
        -------
        str
            A sentence.
        """
        where = f"at {listed_values(self.worst_values)}"
        if not isnan(self.worst_norm.peak_omega):
            where += f" and {self.worst_norm.peak_omega:.4g} rad/s"
        if self.lower_bound == inf:
            return f"{_LOST} {where}{self.message.removeprefix(_LOST)}"
        middle = f"at the midpoint {self.nominal.lower_bound:.5g}"
        proved = f"at most {from_on(self.upper_bound)} over the box, proved in {count(self.cells, 'cell')}"
        bound = proved if self.upper_bound < inf else f"no bound proved ({self.message})"
        least = f"{NAMES[self.worst_norm.kind]} norm of at least {self.worst_norm.lower_bound:.5g}"
        return f"{least} {where}; {bound}; {middle}; {count(self.nfev, 'evaluation')}"

    def __figures__(self) -> dict[str, float]:
        """Return the metrics for a comparison."""
        return {
            "largest norm found over the box": self.worst_norm.lower_bound,
            "proved upper bound over the box": self.upper_bound,
            "norm at the midpoint of the box": self.nominal.lower_bound,
        }


@one_blas_thread
def worst_case(
    family: Family,
    controller: "control.StateSpace | ScheduledController",
    inputs: "str | Sequence[str] | None" = None,
    outputs: "str | Sequence[str] | None" = None,
    *,
    norm: str = "hinf",
    rtol: float | None = 1e-3,
    max_cells: int = _CELLS,
    delay: float = 0.0,
    injection_points: "str | Sequence[str]" = (),
    progress: "Listener | None" = None,
) -> WorstCase:
    """Compute bounds on the worst-case norm of the loop ``u = K y`` over a parameter box.

    The lower bound comes from local searches that start at the midpoint, faces and vertices of the box, and at the
    midpoints of undecided cells.  The upper bound comes from branch and bound: the box is bisected until in every cell the
    norm is proved to be below the bound (:mod:`boomctl.analysis.box.prove`).  A finite upper bound implies robust stability
    over the box.

    With a discrete-time controller the loop is that of :func:`boomctl.feedback_loop`: disturbances are held between
    samples, and outputs are sampled.  The loop is approximated by a polynomial in the parameters
    (:mod:`boomctl.analysis.box.sampled`); the proof allows for ten times the error estimated at random points.

    Parameters
    ----------
    family : AffineFamily or PolynomialFamily
        Plants, such as :func:`boomctl.boom_family` or ``.family()`` of a hub-beam.  Control inputs must be forces.
    controller : control.StateSpace or ScheduledController
        Controller with ``u = K y``.  Signals are matched by name.  A scheduled controller
        (:func:`boomctl.gain_schedule`) is evaluated at frozen parameter values, as in :func:`boomctl.robust_stability`.
    inputs, outputs : str or sequence of str, optional
        Signals of the closed loop (:func:`boomctl.feedback_loop`) between which the norm is computed.  If None, all
        disturbances and injected signals, and all outputs of the family.
    norm : {"hinf", "h2"}
        Largest singular value over frequency, or RMS of the outputs for white noise.  No upper bound is computed for H2.
    rtol : float or None
        Relative gap between the bounds at which the search stops.  If `max_cells` is exceeded, the gap is relaxed to ten,
        then a hundred times `rtol`.  If None, no upper bound is computed.
    max_cells : int
        Approximate limit on the number of cells in parameters and frequency, for each bound that is tried.  For cells in
        parameters alone, which take longer, the limit is ``max_cells / 150``.
    delay : float, optional
        Computation delay [s].  Requires a discrete-time controller.
    injection_points : str or sequence of str, optional
        Controls and measurements at which a signal is injected, as in :func:`boomctl.feedback_loop`: ``inputs`` may then
        contain ``"force_injected"``, a disturbance at the control input ``"force"``.
    progress : callable, optional
        Called with a `Progress` at each stage.  If None, a progress line is shown after 3 s; `progress_callback` receives
        the stages of all computations in its block.

    Returns
    -------
    WorstCase
        Bounds, worst-case parameter values, and norm at the midpoint of the box.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, signal names do not match, a continuous-time controller drives a
        displacement, `delay` is not possible for the loop, or `inputs`, `outputs`, `norm`, `rtol` or `max_cells` is invalid.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": "stroke_anti", "outputs": "suspension_anti"}
    >>> damper = control.ss([[-30.0]], [[30.0]], [[3000.0]], [[-3000.0]], **signals)  # 100 N s/m
    >>> worst = bc.worst_case(bc.boom.yaw_family(subsystem="yaw"), damper, "actuator_anti", "tip_anti")
    >>> round(worst.nominal.lower_bound, 1), round(worst.worst_norm.lower_bound, 1), worst.upper_bound < 97.8
    (76.1, 97.7, True)
    """
    limit = whole("max_cells", max_cells)
    wanted = None if rtol is None else positive("rtol", rtol)
    if wanted is not None and wanted > _LARGEST:
        raise ValueError(f"`rtol` must be at most {_LARGEST:g}, got {wanted:g}.")
    known("norm", norm, NAMES)
    loops = BoxLoops.of(family, controller, delay)

    def loop_at(delta: Array) -> Lti:
        loop = loops.at(delta).closed(injection_points)
        return loop.select(inputs, family.nominal.output_labels if outputs is None else outputs)

    @cache
    def norm_at(point: bytes) -> Any:
        loop = loop_at(np.frombuffer(point))
        return matrices_h2_norm(loop) if norm == "h2" else matrices_norm(loop.balanced())

    def at(delta: Array) -> Any:
        """Return the norm bounds at a point."""
        return norm_at(delta.tobytes())

    def peak(point: Array) -> float:
        tell("points of the box", 1 + norm_at.cache_info().currsize)
        return at(point).lower_bound

    with computing("worst case", progress):
        delta, _, nfev = pattern_search(peak, family.nparameters)
        middle = np.zeros(family.nparameters)
        nominal, bound, proof = at(middle), inf, BoxProof(False)
        if at(delta).lower_bound == inf:
            reason = _LOST
        elif norm == "h2":
            reason = "no proofs for H2 norms"
        elif wanted is None:
            reason = "not requested"
        else:
            tell("loop over the box")
            level = _Level(at, delta, wanted)
            proof, reason = _proved(loops, loop_at(middle), level, limit)
            delta, bound = level.worst, level.level if proof.proved else inf
    if nominal.lower_bound == inf and isinstance(loops.controller, Lti):
        advice = sign_advice(of(family.at(middle), sampled=True), loops.controller, loops.delay)
        reason = f"{reason}; {advice}" if advice else reason
    cells = proof.parameter_cells + proof.frequency_cells
    return WorstCase(at(delta), family.denormalize(delta), nominal, nfev, bound, cells, reason, proof.method)


class _Level(Statement):
    """Statement that no norm over a box reaches a level, which rises at a worse point or when the cells are exhausted."""

    def __init__(self, at: "Callable[[Array], NormBounds]", worst: Array, gap: float) -> None:
        self.at, self.worst, self.lower, self.gap, self.loosened = at, worst, at(worst).lower_bound, gap, 0
        super().__init__(lambda point: at(point).lower_bound < inf, self.lower * (1.0 + gap))

    def met(self, gain: float, point: Array) -> None:
        if gain > self.lower * (1.0 + LEVEL):
            worst, most, _ = pattern_search(lambda d: self.at(d).lower_bound, len(point), point)
            if most > self.lower:  # the gain of the polynomials may exceed the loop's
                self.worst, self.lower = worst, most
            if self.lower * (1.0 + 0.5 * self.gap) > self.level:
                self.level = self.lower * (1.0 + self.gap)

    def holds(self, point: Array) -> bool:
        self.met(self.at(point).lower_bound, point)
        return self.stable(point)

    def looser(self) -> bool:
        if self.loosened == _LOOSENED or self.gap >= _LARGEST:
            return False
        self.gap, self.loosened = min(_LOOSER * self.gap, _LARGEST), self.loosened + 1
        self.level = self.lower * (1.0 + self.gap)
        return True


def _proved(loops: BoxLoops, loop: Lti, level: _Level, limit: int) -> tuple[BoxProof, str]:
    """Prove that a loop's gain stays below a level; return the proof, and the reason if it failed."""
    try:
        parts = loops.parts(loop.input_labels, loop.output_labels)
    except ValueError as error:
        return BoxProof(False), str(error)
    if reason := _hindrance(parts, level):
        return BoxProof(False), reason
    result = prove_box(parts, level, limit / COST_RATIO)
    if result.proved:
        drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_CHECKED, len(level.worst)))
        if max(level.at(point).lower_bound for point in drawn) > level.level:
            raise ArithmeticError(f"worst_case: a norm at a random point exceeds the proved level {level.level:.9g}.")
        return result, ""
    if result.refuted is not None:
        level.worst = result.refuted
    elif level.level < inf:
        return result, f"it would take more than max_cells = {limit} at {level.level:.5g}"
    return result, _LOST


def _hindrance(parts: "Sequence[LoopPart]", level: _Level) -> str:
    """Return the reason why no bound can be proved; empty if there is none.

    The loops of the proof must be those whose norms were computed: both are compared at the worst point, or the nearest point
    in a part of the box, and at the midpoint.
    """
    for part in parts:
        nearest = np.clip((level.worst - part.cell.middle) / part.cell.reach, -1.0, 1.0)
        for point in (nearest, 0.0 * nearest):
            if not stable(value_at(part.pencils, point)):
                return "a pole that is not stable is unobservable or uncontrollable from these signals"
            here, there = level.at(part.cell.point(point)), matrices_norm(part.at(point))
            known = [(x.lower_bound, x.upper_bound if x.verified else x.lower_bound) for x in (here, there)]
            if max(low for low, _ in known) > min(high for _, high in known) * (1.0 + LEVEL):
                return f"two methods for the norm differ: {here.lower_bound:.9g} and {there.lower_bound:.9g}"
    return "" if level.lower > 0.0 else "the norm is zero at all evaluated points"
