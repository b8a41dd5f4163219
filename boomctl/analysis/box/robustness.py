"""Stability and performance of a loop over a whole box of real parameters: a proof, and the worst point found."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.points import listed_values, pattern_search
from boomctl.analysis.box.prove import WORTH, Statement, prove_box
from boomctl.analysis.box.scheduled import ScheduledController
from boomctl.checks import positive, whole
from boomctl.lti.system import Lti, of
from boomctl.printing import count, sentence
from boomctl.progress import Listener, computing, tell
from boomctl.structure.families import Family, Slope
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_CELLS = 500  # most cells of a proof (a choice of patience: seconds to a minute)
_MARGIN_CELLS = 100  # most cells of each of the proofs of a margin (a choice)
_PROOFS = 24  # at most, of a margin: enough for bounds 1e-5 apart (a choice)


@dataclass(frozen=True)
class RobustStability:
    """Whether a loop is stable over a whole box of parameters.

    Attributes
    ----------
    proved : bool
        Whether the loop is proved stable at every point of the box: no pole touches the imaginary axis, or the unit circle,
        in any of the cells that cover it.  Of sampled loops what the polynomials miss, by which they are proved, is not
        itself proved: it is measured at points drawn, and counted ten times.
    destabilizing_values : dict or None
        Parameter values at which the loop is unstable, the first that were found; None where none were.
    cells : int
        Cells in which it was proved (or tried).
    spectral_abscissa : float
        Largest real part of the poles at the points tried [rad/s]; a lower bound of that over the box.
    worst_values : dict
        Parameter values at which the largest real part was found.
    message : str
        Why the proof was given up, and where; empty where it was not.
    method : str
        How many cells of which kind proved it; empty where it was not.
    small_gain : float
        Largest gain found around what is not modeled, in its bounds: below one at every point where it is proved; ``nan``
        where nothing was said to be unmodelled, or the loop is not proved stable without it.
    """

    proved: bool
    destabilizing_values: dict[str, float] | None
    cells: int
    spectral_abscissa: float
    worst_values: dict[str, float]
    message: str = ""
    method: str = ""
    small_gain: float = nan

    def __repr__(self) -> str:
        return sentence("RobustStability", self.summary)

    @property
    def summary(self) -> str:
        """Return the verdict as text.

        Returns
        -------
        str
            A sentence.
        """
        rate = f"{self.spectral_abscissa:.4g} rad/s"
        if self.destabilizing_values is not None:
            return f"unstable at {listed_values(self.destabilizing_values)} (pole with real part {rate})"
        verdict = "stable over the whole box, proved" if self.proved else "stable where tried, but not proved,"
        verdict = f"{verdict} in {count(self.cells, 'cell')}{f' ({self.message})' if self.message else ''}"
        result = f"{verdict}; real parts of poles found up to {rate}, at {listed_values(self.worst_values)}"
        if isnan(self.small_gain):
            return result
        return f"{result}; gain around what is not modeled found up to {self.small_gain:.4g} of its bounds"


@dataclass(frozen=True)
class RobustStabilityMargin:
    """How many times the box may grow about its middle before the loop may become unstable.

    Attributes
    ----------
    lower_bound : float
        The loop is proved stable over the box enlarged by this factor.
    upper_bound : float
        The loop is unstable at a point of the box enlarged by this factor; ``inf`` if none was found.
    destabilizing_values : dict or None
        Parameter values of that point.
    """

    lower_bound: float
    upper_bound: float
    destabilizing_values: dict[str, float] | None

    @property
    def mu_lower(self) -> float:
        """Lower bound of the structured singular value for these real parameters, 1 being the box itself."""
        return 1.0 / self.upper_bound if self.upper_bound > 0.0 else inf

    @property
    def mu_upper(self) -> float:
        """Upper bound of it."""
        return 1.0 / self.lower_bound if self.lower_bound > 0.0 else inf

    def __repr__(self) -> str:
        return sentence("RobustStabilityMargin", self.summary)

    @property
    def summary(self) -> str:
        """Return both bounds as text.

        Returns
        -------
        str
            A sentence.
        """
        proved = f"proved stable over the box enlarged {self.lower_bound:.4g} times"
        if self.destabilizing_values is None:
            return f"{proved}; no instability found"
        return f"{proved}; unstable at {self.upper_bound:.4g} times: {listed_values(self.destabilizing_values)}"


@one_blas_thread
def robust_stability(
    family: Family,
    controller: "control.StateSpace | ScheduledController",
    max_cells: int = _CELLS,
    *,
    delay: float = 0.0,
    additive_uncertainty: "control.StateSpace | None" = None,
    injection_points: str | Sequence[str] = (),
    progress: "Listener | None" = None,
) -> RobustStability:
    """Prove that a loop ``u = K y`` is stable over a whole box of parameters, or find where it is not.

    The box is halved until in each cell no pole can touch the imaginary axis; what such cells leave is proved by smaller ones
    of parameters and frequencies (:mod:`boomctl.analysis.box.prove`).  With a discrete controller the loop is a polynomial of
    the parameters (:mod:`boomctl.analysis.box.sampled`): what it misses is measured at points drawn, and counted ten
    times.

    Parameters
    ----------
    family : AffineFamily or PolynomialFamily
        The plants, such as :func:`boomctl.boom_family` or ``.family()`` of a hub-beam returns; its controls are forces.
    controller : control.StateSpace or ScheduledController
        ``u = K y``; its inputs are outputs of the family, its outputs inputs of it.  A discrete one makes sampled loops.  One
        that follows a parameter of the family (:func:`boomctl.gain_schedule`) is proved at each constant value; the proof
        does not cover a changing one.
    max_cells : int
        Largest number of cells of a part of the box, of which most boxes are one; after so many neither stability nor
        instability is claimed.  Of those of parameters and frequencies, which are smaller, some 150 times as many are tried.
    delay : float, optional
        Time between a sample and the moment its control acts [s]; only with a discrete controller.
    additive_uncertainty : control.StateSpace, optional
        Bounds of what the family does not model, in continuous time, such as
        :func:`boomctl.identification.uncertainty_weight` makes: from the controls to what is measured, by name.  The plants
        are all those of the family with any stable dynamics added, each entry below that of the bounds at every frequency.
        With a discrete controller bounds must fall with frequency; what samples fold back is in the proof.
    injection_points : str or sequence of str, optional
        As in :func:`boomctl.worst_case`, so that both accept the same arguments.  Names are checked; the result is the same
        for all of them, because an injected signal changes no pole and all poles count.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `progress_callback` hears whatever runs within it.

    Returns
    -------
    RobustStability
        Whether it was proved, or parameter values at which the loop is unstable.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; names that do not meet; controls that impose motion; a delay that the loop cannot have; bounds
        that are not stable, or beside a controller that follows a parameter.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> family = bc.boom_family(subsystem="yaw")
    >>> spring = control.ss([], [], [], [[-100.0]], inputs="stroke_anti", outputs="suspension_anti")
    >>> bc.robust_stability(family, spring).proved
    True
    >>> W = bc.low_pass(1e-4, 20.0, order=2)  # m/N
    >>> W.update_names(inputs=["suspension_anti"], outputs=["stroke_anti"])
    >>> around = bc.robust_stability(family, spring, additive_uncertainty=W)
    >>> around.proved, round(around.small_gain, 3)
    (True, 0.353)
    """
    limit = whole("max_cells", max_cells)
    if additive_uncertainty is not None:
        of(additive_uncertainty, "additive_uncertainty", "StateSpace")
        if isinstance(controller, ScheduledController):
            raise ValueError(
                "`additive_uncertainty` must be None beside a controller that follows a parameter, got a bound."
            )
    loops = BoxLoops.of(family, controller, delay)
    if not isinstance(injection_points, Sequence) or injection_points:
        loops.at(np.zeros(family.nparameters)).injections(injection_points)
    with computing("robust stability", progress):
        tell("points of the box")
        at, rate = pattern_search(loops.abscissa, family.nparameters, 1.0, enough=0.0)[:2]
        worst = family.denormalize(at)
        if not loops.stable(at):
            return RobustStability(False, worst, 0, rate, worst)
        tell("loop over the box")
        try:
            parts = loops.parts()
        except ValueError as error:
            return RobustStability(False, None, 0, rate, worst, str(error))
        result = prove_box(parts, Statement(loops.stable), limit)
        cells, bad = result.dear + result.cheap, result.refuted
        if bad is not None:
            return RobustStability(False, family.denormalize(bad), cells, loops.abscissa(bad), family.denormalize(bad))
        reason = ""
        if result.left is not None:
            where = f"{listed_values(family.denormalize(result.left))}, where poles have real parts up to"
            reason = (
                f"given up at {where} {loops.abscissa(result.left):.4g} rad/s: it would take more than max_cells = {limit}, "
                f"or smaller ones than 1/{limit} of the box"
            )
        alone = RobustStability(result.proved, None, cells, rate, worst, reason, result.method)
        if additive_uncertainty is None or not result.proved:
            return alone
        from boomctl.analysis.box.unmodelled import small_gain  # which brings worst cases

        assert isinstance(loops.controller, Lti)
        around = small_gain(family, loops.controller, additive_uncertainty, delay, WORTH * limit)
    gain, below = around.lower_bound, around.upper_bound < 1.0
    if gain >= 1.0:
        reason = f"gain {gain:.4g} around what is not modeled at {listed_values(around.worst_values)}"
    else:
        reason = "" if below else f"gain around what is not modeled not proved below one; worst_case: {around.message}"
    method = f"{alone.method}; {around.method} with what is not modeled" if below else ""
    cells += around.cells
    return replace(alone, proved=below, cells=cells, message=reason, method=method, small_gain=gain)


@one_blas_thread
def robust_stability_margin(
    family: Family,
    controller: "control.StateSpace | ScheduledController",
    max_factor: float = 4.0,
    rtol: float = 0.05,
    max_cells: int = _MARGIN_CELLS,
    *,
    delay: float = 0.0,
    progress: "Listener | None" = None,
) -> RobustStabilityMargin:
    """Return how many times the box may grow about its middle before the loop ``u = K y`` becomes unstable.

    It is found by bisection over :func:`robust_stability` of the enlarged box.

    Parameters
    ----------
    family, controller, max_cells, delay
        As for :func:`robust_stability`; of sampled loops, each enlarged box takes as long as one there.
    max_factor : float
        The box is not enlarged beyond this factor; where no instability is known up to there, ``upper_bound`` is
        infinite.
    rtol : float
        Wanted relative distance of the two bounds.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `progress_callback` hears whatever runs within it.

    Returns
    -------
    RobustStabilityMargin
        A factor up to which the loop is proved stable, and one at which it is unstable.

    Raises
    ------
    TypeError, ValueError
        As for :func:`robust_stability`; a factor or a tolerance out of range.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> family = bc.boom.yaw_family(subsystem="yaw")  # springs of 1100 to 2375 N/m
    >>> spring = control.ss([], [], [], [[-100.0]], inputs="stroke_anti", outputs="suspension_anti")
    >>> margin = bc.analysis.robust_stability_margin(family, spring)
    >>> round(margin.lower_bound, 1), round(margin.upper_bound, 1)
    (2.8, 2.9)
    """
    top, close, limit = positive("max_factor", max_factor), positive("rtol", rtol), whole("max_cells", max_cells)
    loops = BoxLoops.of(family, controller, delay)
    middle = np.zeros(family.nparameters)
    if not loops.stable(middle):
        return RobustStabilityMargin(0.0, 0.0, family.denormalize(middle))
    # factors up to which it is proved, from which on it is not, at which no instability was found, and at which one was
    good, ceiling, calm, bad, where, tried = 0.0, top, 0.0, inf, None, top
    with computing("structured margin", progress):
        for _ in range(_PROOFS):
            found = robust_stability(_enlarged(family, tried), controller, limit, delay=delay)
            if found.destabilizing_values is None:
                calm = max(calm, tried)
            else:
                where = found.destabilizing_values
                bad = float(np.abs(family.normalize(where)).max())
            good, ceiling = (tried, ceiling) if found.proved else (good, min(ceiling, tried, bad))
            unproved, unknown = ceiling - good, bad - calm if bad < inf else 0.0
            if max(unproved, unknown) <= 0.5 * close * ceiling:
                break
            tried = good + 0.5 * unproved if unproved >= unknown else calm + 0.5 * unknown
    return RobustStabilityMargin(good, bad, where)


def _enlarged(family: Family, factor: float) -> Family:
    """Return a family over its box enlarged by a factor about its middle."""
    middle, reach = 0.5 * (family.low + family.high), 0.5 * factor * (family.high - family.low)
    changes = tuple(
        (power, Slope(*(factor ** len(power) * getattr(change, letter) for letter in "MCKBL")))
        for power, change in family.coefficients
    )
    return replace(family, low=middle - reach, high=middle + reach, coefficients=changes)
