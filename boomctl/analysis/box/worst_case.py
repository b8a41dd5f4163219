"""The worst case of a loop over a box of parameters, from both sides: the worst point found, and a bound proved over all."""

from dataclasses import dataclass
from itertools import count
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.bound import LARGEST, LOST, bounded, bounded_in_parts
from boomctl.analysis.box.level import DrivenLoops
from boomctl.analysis.box.loops import BoxLoops, controller_at
from boomctl.analysis.box.robustness import listed_values, pattern_search
from boomctl.analysis.box.sampled_level import SampledLoops
from boomctl.analysis.h2 import H2Certificate, h2_norm
from boomctl.analysis.loops import joined, signals_of
from boomctl.analysis.norm import NormCertificate, matrices_norm
from boomctl.analysis.sampled_loops.sampled_plant import time_of_loop
from boomctl.arrays import Array
from boomctl.checks import exactly, from_on, instance, known, nonnegative, positive, whole
from boomctl.lti.controllers.scheduled import ScheduledController
from boomctl.lti.system import Lti, of
from boomctl.printing import sentence
from boomctl.progress import Listener, computing
from boomctl.structure.families import Family

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control

_NORMS = ("hinf", "h2")
_CELLS = 60_000  # most cells that are tried at one level (a choice of patience: some ten seconds)


@dataclass(frozen=True)
class WorstCase:
    """The largest norm over a box of parameters: the largest found, and for the H-infinity norm what none exceeds.

    Attributes
    ----------
    norm : NormCertificate or H2Certificate
        The norm at the worst point found; infinite where the loop is unstable.
    values : dict
        Parameter values of that point.
    nominal : NormCertificate or H2Certificate
        The norm in the middle of the box.
    evaluations : int
        Number of points tried.
    upper_bound : float
        The norm is proved to be below this at every point of the box; ``inf`` where none is.
    cells : int
        Cells in which it was proved.
    reason : str
        Why no bound was proved; empty where one was.
    """

    norm: NormCertificate | H2Certificate
    values: dict[str, float]
    nominal: NormCertificate | H2Certificate
    evaluations: int
    upper_bound: float = inf
    cells: int = 0
    reason: str = ""

    @property
    def gap(self) -> float:
        """How far the bound lies above the worst point found, relative."""
        return self.upper_bound / self.norm.lower - 1.0 if 0.0 < self.norm.lower < inf else 0.0

    def __repr__(self) -> str:
        return sentence("WorstCase", self.render())

    def render(self) -> str:
        """Return the worst case as text.

        Returns
        -------
        str
            A sentence.
        """
        name, where = "H2", f"at {listed_values(self.values)}"
        if isinstance(self.norm, NormCertificate):
            name, where = "H-infinity", f"{where} and {self.norm.omega:.4g} rad/s"
        middle = f"in the middle of the box {self.nominal.lower:.5g}"
        proved = f"none above {from_on(self.upper_bound)} anywhere in the box, proved in {self.cells} cells"
        bound = proved if self.upper_bound < inf else f"no bound proved ({self.reason})"
        return f"{name} norm up to {self.norm.lower:.5g} {where}; {bound}; {middle}; {self.evaluations} points tried"

    def __figures__(self) -> dict[str, float]:
        """Return what a comparison shows."""
        return {
            "worst case found over the box": self.norm.lower,
            "worst case at most, proved": self.upper_bound,
            "the same in its middle": self.nominal.lower,
        }


def worst_case(
    family: Family,
    controller: "control.StateSpace | ScheduledController",
    inputs: "str | Sequence[str] | None" = None,
    outputs: "str | Sequence[str] | None" = None,
    *,
    norm: str = "hinf",
    tolerance: float | None = 1e-3,
    max_cells: int = _CELLS,
    delay: float = 0.0,
    progress: "Listener | None" = None,
) -> WorstCase:
    """Return the largest norm of the loop ``u = K y`` over a box of parameters, the H-infinity norm from both sides.

    From below, points of a grid over the box are tried, then the neighbourhood of the worst of them, and the middles of
    cells that resist a proof.  From above, the box is cut until in each cell no singular value can reach the level: cells of
    parameters and frequencies (:mod:`boomctl.analysis.box.response_cells`), and cells of parameters alone where many poles
    are lightly damped (:mod:`boomctl.analysis.box.level`).  A bound proves besides that the loop is stable over the box.

    A discrete controller makes sampled loops, as :func:`boomctl.feedback_loop` has them: disturbances are held from sample to
    sample, and outputs are those at the samples.  The loop is then a polynomial of the parameters
    (:mod:`boomctl.analysis.box.sampled_level`): what it misses is measured at points drawn, and counted ten times.

    Parameters
    ----------
    family : AffineFamily or PolynomialFamily
        The plants, such as :func:`boomctl.boom_family` or ``.family()`` of a hub-beam returns; its controls are forces.
    controller : control.StateSpace or ScheduledController
        ``u = K y``; its inputs are outputs of the family, its outputs inputs of it.
    inputs, outputs : str or sequence of str, optional
        Signals of the closed loop (:func:`boomctl.feedback_loop`) between which the norm is taken; by default from all
        disturbances to all outputs of the family.
    norm : {"hinf", "h2"}
        Largest singular value over frequency, or RMS of the outputs to white noise.  Of the H2 norm only the worst point
        is looked for; no bound is proved, and ``reason`` says so.
    tolerance : float or None
        How far the bound may lie above the worst point found, relative.  Where that would take too many cells, ten and a
        hundred times as much is tried.  None: no bound is asked for.
    max_cells : int
        Largest number of cells of parameters and frequencies tried at one level; of parameters alone, which take longer,
        are at most one in 150 of it.
    delay : float, optional
        Time between a sample and the moment its control acts [s]; only with a discrete controller.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `listening` hears whatever runs within it.

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
    >>> worst = bc.worst_case(bc.yaw_family(half="yaw"), damper, "actuator_anti", "tip_anti")
    >>> round(worst.nominal.lower, 1), round(worst.norm.lower, 1), worst.upper_bound < 97.8
    (76.1, 97.7, True)
    """
    limit = whole("max_cells", max_cells)
    wanted = None if tolerance is None else positive("tolerance", tolerance)
    if wanted is not None and wanted > LARGEST:
        raise ValueError(f"tolerance = {wanted:g}: expected at most {LARGEST:g}")
    known("norm", norm, _NORMS)
    K, late = _checked(family, controller, delay)

    def loop_at(delta: Array) -> Lti:
        loop = joined(family.at(delta), controller_at(family, controller, delta), late).closed()
        return loop.select(inputs, family.centre.outputs if outputs is None else outputs)

    seen: dict[bytes, Any] = {}

    def at(delta: Array) -> Any:
        """Return the certificate of the norm at a point."""
        found = seen.get(delta.tobytes())
        if found is None:
            loop = loop_at(delta)
            found = h2_norm(loop.statespace("loop")) if norm == "h2" else matrices_norm(loop.balanced())
            seen[delta.tobytes()] = found
        return found

    looked_at = count(1)
    with computing("worst case", progress) as tell:

        def peak(point: Array) -> float:
            tell("points of the box", next(looked_at))
            return at(point).lower

        delta, _, tried = pattern_search(peak, family.size, 1.0)
        nominal = at(np.zeros(family.size))
        bound, cells, reason = inf, 0, ""
        if norm == "h2":
            reason = "found, not proved: an H2 norm"
        elif wanted is None:
            reason = "none was asked for"
        elif at(delta).lower == inf:
            reason = LOST
        elif K is None:
            reason = "none is tried for controllers that follow a parameter"
        else:
            tell("loop over the box")
            loops, reason = _loops(family, K, loop_at(np.zeros(family.size)), late)
            if loops is not None:
                prove = bounded_in_parts if isinstance(loops, tuple) else bounded
                found = prove(loops, at, delta, tolerance=wanted, limit=limit, tell=tell)  # type: ignore[arg-type]
                delta, bound, cells, reason = found.delta, found.level, found.cells, found.reason
    return WorstCase(at(delta), family.values(delta), nominal, tried, bound, cells, reason)


def _loops(
    family: Family, K: Lti, judged: Lti, late: float
) -> tuple[DrivenLoops | tuple[SampledLoops, ...] | None, str]:
    """Return the loops whose level is to be proved, between the signals judged, or why there are none."""
    try:
        if K.dt == 0.0:
            return DrivenLoops.of(family, K.balanced(), judged.inputs, judged.outputs), ""
        return SampledLoops.over(family, K, judged.inputs, judged.outputs, late), ""
    except ValueError as error:
        return None, str(error)


def _checked(
    family: Family, controller: "control.StateSpace | ScheduledController", delay: float
) -> tuple[Lti | None, float]:
    """Return a controller, None if it follows a parameter, and its delay [s], refused where they make no loop."""
    instance("family", family, Family, "AffineFamily or PolynomialFamily")
    late = nonnegative("delay", delay)
    scheduled = isinstance(controller, ScheduledController)
    K = None if scheduled else of(controller, "controller", "StateSpace or ScheduledController", sampled=True)
    if K is not None and K.dt != 0.0:
        signals_of(K, family.centre.inputs, family.centre.outputs)
        time_of_loop(Lti(K.A, K.B, K.C, K.D), K, late)
        return K, late
    if late:
        raise ValueError(f"delay = {exactly(delay)}: expected 0 with a controller in continuous time")
    BoxLoops.of(family, controller)
    return K, late
