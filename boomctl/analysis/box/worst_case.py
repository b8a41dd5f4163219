"""The worst case of a loop over a box of parameters, from both sides: the worst point found, and a bound proved over all."""

from dataclasses import dataclass
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.points import listed_values, pattern_search
from boomctl.analysis.box.polynomials import stable, value_at
from boomctl.analysis.box.prove import WORTH, BoxProof, Statement, prove_box
from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.analysis.loops import sign_advice
from boomctl.analysis.norm import NAMES, NormBounds, matrices_norm
from boomctl.arrays import Array
from boomctl.checks import from_on, known, positive, whole
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

_CELLS = 60_000  # most cells that are tried at one level (a choice of patience: some ten seconds)
_LARGEST = 1.0  # a tolerance beyond which a bound says nothing (a choice)
_LOOSER = 10.0  # times the tolerance: the next level where cells run out (a choice)
_LOOSENED = 2  # times at most (a choice)
_LOST = "the loop is unstable there, or undamped"
_CHECKED = 8  # points drawn in the box at which a bound is tried again (a choice)
_COMPARED = 3  # points drawn at which the loops that are proved are compared with those closed anew (a choice)
_SAME = 1e-6  # relative distance of norms, as far as certified, by two routes that are the same (a choice)


@dataclass(frozen=True)
class WorstCase:
    """The largest norm over a box of parameters: the largest found, and for the H-infinity norm what none exceeds.

    Attributes
    ----------
    worst_norm : NormBounds
        The norm at the worst point found; infinite where the loop is unstable.
    worst_values : dict
        Parameter values of that point.
    nominal : NormBounds
        The norm in the middle of the box.
    nfev : int
        Number of points tried.
    upper_bound : float
        The norm is proved to be below this at every point of the box; ``inf`` where none is.
    cells : int
        Cells in which it was proved.
    message : str
        Why no bound was proved; empty where one was.
    method : str
        How many cells of which kind proved it; empty where none was.
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
        """The largest norm found: that of ``worst_norm``."""
        return self.worst_norm.lower_bound

    @property
    def relative_gap(self) -> float:
        """How far the bound lies above the worst point found, relative."""
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
        if self.worst_norm.kind == "hinf":
            where += f" and {self.worst_norm.peak_omega:.4g} rad/s"
        middle = f"in the middle of the box {self.nominal.lower_bound:.5g}"
        proved = f"none above {from_on(self.upper_bound)} anywhere in the box, proved in {count(self.cells, 'cell')}"
        bound = proved if self.upper_bound < inf else f"no bound proved ({self.message})"
        name = NAMES[self.worst_norm.kind]
        return (
            f"{name} norm up to {self.worst_norm.lower_bound:.5g} {where}; {bound}; {middle}; {self.nfev} points tried"
        )

    def __figures__(self) -> dict[str, float]:
        """Return what a comparison shows."""
        return {
            "worst case found over the box": self.worst_norm.lower_bound,
            "worst case at most, proved": self.upper_bound,
            "the same in its middle": self.nominal.lower_bound,
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
    """Return the largest norm of the loop ``u = K y`` over a box of parameters, the H-infinity norm from both sides.

    From below, the box's middle, faces and corners are tried, then the neighborhood of the worst of them, and the middles of
    cells that resist a proof.  From above, the box is cut until in each cell no singular value can reach the level: cells of
    parameters, and at every fifth halving smaller ones of parameters and frequencies (:mod:`boomctl.analysis.box.prove`).
    A bound proves besides that the loop is stable over the box.

    A discrete controller makes sampled loops, as :func:`boomctl.feedback_loop` has them: disturbances are held from sample to
    sample, and outputs are those at the samples.  The loop is then a polynomial of the parameters
    (:mod:`boomctl.analysis.box.sampled`): what it misses is measured at points drawn, and counted ten times.

    Parameters
    ----------
    family : AffineFamily or PolynomialFamily
        The plants, such as :func:`boomctl.boom_family` or ``.family()`` of a hub-beam returns; its controls are forces.
    controller : control.StateSpace or ScheduledController
        ``u = K y``; its inputs are outputs of the family, its outputs inputs of it.  One that follows a parameter of the
        family (:func:`boomctl.gain_schedule`) is taken at each constant value, as in :func:`boomctl.robust_stability`.
    inputs, outputs : str or sequence of str, optional
        Signals of the closed loop (:func:`boomctl.feedback_loop`) between which the norm is taken; by default from all
        disturbances and injected signals to all outputs of the family.
    norm : {"hinf", "h2"}
        Largest singular value over frequency, or RMS of the outputs to white noise.  Of the H2 norm only the worst point
        is looked for; no bound is proved, and ``message`` says so.
    rtol : float or None
        How far the bound may lie above the worst point found, relative.  Where that would take too many cells, ten and a
        hundred times as much is tried.  None: no bound is asked for.
    max_cells : int
        About the largest number of cells of parameters and frequencies tried at one level in a part of the box, of which
        most boxes are one; of parameters alone, which take longer, are at most one in 150 of it.
    delay : float, optional
        Time between a sample and the moment its control acts [s]; only with a discrete controller.
    injection_points : str or sequence of str, optional
        Controls and measurements at which a signal is injected, as in :func:`boomctl.feedback_loop`: ``inputs`` then may
        name ``"force_injected"``, a disturbance at the control input ``"force"``.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `progress_callback` hears whatever runs within it.

    Returns
    -------
    WorstCase
        The norm, the parameter values at which it was found, the bound that none exceeds, and the norm in the middle of
        the box.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; names that do not meet; controls that impose motion, of a controller in continuous time; a
        delay that the loop cannot have; unknown signals or norm; a tolerance or a number of cells out of range.

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
        """Return the certificate of the norm at a point."""
        return norm_at(delta.tobytes())

    def peak(point: Array) -> float:
        tell("points of the box", 1 + norm_at.cache_info().currsize)
        return at(point).lower_bound

    with computing("worst case", progress):
        delta, _, tried = pattern_search(peak, family.nparameters, 1.0)
        middle = np.zeros(family.nparameters)
        nominal, bound, proof = at(middle), inf, BoxProof(False)
        if norm == "h2":
            reason = "found, not proved: an H2 norm"
        elif wanted is None:
            reason = "none was asked for"
        elif at(delta).lower_bound == inf:
            reason = _LOST
        else:
            tell("loop over the box")
            level = _Level(at, delta, wanted)
            proof, reason = _proved(loops, loop_at(middle), level, limit)
            delta, bound = level.worst, level.level if proof.proved else inf
    if nominal.lower_bound == inf and isinstance(loops.controller, Lti):
        advice = sign_advice(of(family.at(middle), sampled=True), loops.controller, loops.delay)
        reason = f"{reason}; {advice}" if advice else reason
    cells = proof.dear + proof.cheap
    return WorstCase(at(delta), family.denormalize(delta), nominal, tried, bound, cells, reason, proof.method)


class _Level(Statement):
    """That no norm over a box reaches a level, which is raised where a worse point is met, and where cells run out."""

    def __init__(self, at: "Callable[[Array], NormBounds]", worst: Array, gap: float) -> None:
        self.at, self.worst, self.lower, self.gap, self.loosened = at, worst, at(worst).lower_bound, gap, 0
        super().__init__(lambda point: at(point).lower_bound < inf, self.lower * (1.0 + gap))

    def met(self, gain: float, point: Array) -> None:
        if gain > self.lower * (1.0 + _SAME):
            worst, most, _ = pattern_search(lambda d: self.at(d).lower_bound, len(point), 1.0, point)
            if most > self.lower:  # a gain of the polynomials may lie above that of the loop
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


def _proved(loops: BoxLoops, judged: Lti, level: _Level, limit: int) -> tuple[BoxProof, str]:
    """Prove a level between the signals of a loop, and return why it is not proved."""
    try:
        parts = loops.parts(judged.input_labels, judged.output_labels)
    except ValueError as error:
        return BoxProof(False), str(error)
    if reason := _hindrance(parts, level):
        return BoxProof(False), reason
    result = prove_box(parts, level, limit / WORTH)
    if result.proved:
        drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_CHECKED, len(level.worst)))
        if max(level.at(point).lower_bound for point in drawn) > level.level:
            raise ArithmeticError(f"worst_case: a norm above the level proved, {level.level:.9g}, at a point drawn")
        return result, ""
    if result.refuted is not None:
        level.worst = result.refuted
    elif level.level < inf:
        return result, f"it would take more than max_cells = {limit} at {level.level:.5g}"
    return result, _LOST


def _hindrance(parts: "Sequence[LoopPart]", level: _Level) -> str:
    """Return why there is no bound to be looked for; empty where there may be one.

    The loops that are proved are those whose norms were found: they are compared at the worst point, or what is nearest to it
    in a part of the box, in the middle, and at points drawn.
    """
    for part in parts:
        nearest = np.clip((level.worst - part.cell.middle) / part.cell.reach, -1.0, 1.0)
        drawn = np.random.default_rng(1).uniform(-1.0, 1.0, (_COMPARED, len(nearest)))
        for point in (nearest, 0.0 * nearest, *drawn):
            if not stable(value_at(part.pencils, point)):
                return "a pole that does not decay hides from these signals"
            here, there = level.at(part.cell.point(point)), matrices_norm(part.at(point))
            known = [(x.lower_bound, x.upper_bound if x.verified else x.lower_bound) for x in (here, there)]
            if max(low for low, _ in known) > min(high for _, high in known) * (1.0 + _SAME):
                return f"two routes to the norm differ: {here.lower_bound:.9g} and {there.lower_bound:.9g}"
    return "" if level.lower > 0.0 else "nothing comes through at any point tried"
