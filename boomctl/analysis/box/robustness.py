"""Robust stability of a loop over a box of real parameters, and its margin."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.points import listed_values, pattern_search
from boomctl.analysis.box.prove import COST_RATIO, Statement, prove_box
from boomctl.analysis.box.scheduled import ScheduledController
from boomctl.checks import positive, whole
from boomctl.lti.system import Lti, of
from boomctl.printing import count, sentence
from boomctl.progress import Listener, computing, tell
from boomctl.structure.families import Family, Slope
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_CELLS = 500  # Largest number of cells of a proof: seconds to a minute.
_MARGIN_CELLS = 100  # Largest number of cells of each proof of a margin.
_PROOFS = 24  # Largest number of proofs of a margin: enough for a relative gap of 1e-5.


@dataclass(frozen=True)
class RobustStability:
    """Robust stability of a loop over a box of parameters.

    Attributes
    ----------
    proved : bool
        True if the loop is proved stable at every point of the box: no pole touches the imaginary axis, or the unit circle,
        in any of the cells that cover it.  The proof of a sampled loop uses polynomials.  Their error is not proved: it is
        estimated at random points and multiplied by ten.
    destabilizing_values : dict or None
        Parameter values of the first point at which the loop was computed to be unstable, or None.
    cells : int
        Number of cells of the proof, or of the attempt.
    spectral_abscissa : float
        Largest real part of the poles at the points evaluated [rad/s]; a lower bound of its maximum over the box.
    worst_values : dict
        Parameter values at which the largest real part was computed.
    message : str
        Reason and location at which the proof stopped; empty if it is complete.
    method : str
        Numbers of cells of each kind in the proof; empty without a proof.
    small_gain : float
        Largest computed gain around the unmodeled dynamics, relative to their bounds: below one at every point if proved;
        NaN without `additive_uncertainty`, or if the loop is not proved stable without unmodeled dynamics.
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
        """Return the result as text.

        Returns
        -------
        str
            A sentence.
        """
        rate = f"{self.spectral_abscissa:.4g} rad/s"
        if self.destabilizing_values is not None:
            return f"unstable at {listed_values(self.destabilizing_values)} (pole with real part {rate})"
        verdict = "proved stable over the box" if self.proved else "stable at all evaluated points, not proved,"
        verdict = f"{verdict} in {count(self.cells, 'cell')}{f' ({self.message})' if self.message else ''}"
        result = f"{verdict}; largest real part of a pole found {rate}, at {listed_values(self.worst_values)}"
        if isnan(self.small_gain):
            return result
        return f"{result}; largest small-gain norm found {self.small_gain:.4g} (limit 1)"


@dataclass(frozen=True)
class RobustStabilityMargin:
    """Scaling of the parameter box about its midpoint up to which a loop remains stable.

    Attributes
    ----------
    lower_bound : float
        The loop is proved stable over the box enlarged by this factor.
    upper_bound : float
        The loop is unstable at a point of the box enlarged by this factor; ``inf`` if no such point is known.
    destabilizing_values : dict or None
        Parameter values of this point, or None.
    """

    lower_bound: float
    upper_bound: float
    destabilizing_values: dict[str, float] | None

    @property
    def mu_lower(self) -> float:
        """Lower bound of the structured singular value for these real parameters; 1 corresponds to the box itself."""
        return 1.0 / self.upper_bound if self.upper_bound > 0.0 else inf

    @property
    def mu_upper(self) -> float:
        """Upper bound of the structured singular value."""
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
    """Prove that a loop ``u = K y`` is stable over a box of parameters, or find a point at which it is unstable.

    The box is halved until in each cell no pole can touch the imaginary axis.  The remaining cells are divided into
    cells of parameters and frequencies (:mod:`boomctl.analysis.box.prove`).  With a discrete controller the loop is
    approximated by a polynomial of the parameters (:mod:`boomctl.analysis.box.sampled`); its error is estimated at
    random points and multiplied by ten.

    Parameters
    ----------
    family : AffineFamily or PolynomialFamily
        Plants, such as :func:`boomctl.boom_family` or ``.family()`` of a hub-beam.  Its control inputs must be forces.
    controller : control.StateSpace or ScheduledController
        Controller with ``u = K y``.  Signals are matched by name.  A discrete-time controller defines sampled loops.  A
        controller that follows a parameter of the family (:func:`boomctl.gain_schedule`) is proved at each constant value;
        the proof does not cover a changing value.
    max_cells : int
        Maximum number of cells in a part of the box (most boxes have one part); if it is exceeded, the result is
        undecided.  The number of cells of parameters and frequencies, which are smaller, may be about 150 times as
        large.
    delay : float, optional
        Computation delay [s].  Requires a discrete-time controller.
    additive_uncertainty : control.StateSpace, optional
        Weight of the unmodeled dynamics in continuous time, such as :func:`boomctl.identification.uncertainty_weight`
        returns, from controls to measurements by name.  The plants are those of the family with any stable dynamics added, of
        which each entry is bounded by the weight's entry at every frequency.  With a discrete controller the weight must be
        strictly proper; the proof includes aliasing.
    injection_points : str or sequence of str, optional
        As in :func:`boomctl.worst_case`, so that both accept the same arguments.  Names are checked; they do not change the
        result, because an injected signal changes no pole.
    progress : callable, optional
        Called with a `Progress` at each stage.  If None, a progress line is shown after 3 s; `progress_callback` receives
        the stages of all computations in its block.

    Returns
    -------
    RobustStability
        Proof, or parameter values at which the loop is unstable.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, signal names do not match, a control is a displacement, the loop cannot have this
        delay, or `additive_uncertainty` is unstable or used with a controller that follows a parameter.

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
                "`additive_uncertainty` must be None for a controller that follows a parameter, got a bound."
            )
    loops = BoxLoops.of(family, controller, delay)
    if not isinstance(injection_points, Sequence) or injection_points:
        loops.at(np.zeros(family.nparameters)).injections(injection_points)
    with computing("robust stability", progress):
        tell("points of the box")
        at, rate = pattern_search(loops.abscissa, family.nparameters, enough=0.0)[:2]
        worst = family.denormalize(at)
        if not loops.stable(at):
            return RobustStability(False, worst, 0, rate, worst)
        tell("loop over the box")
        try:
            parts = loops.parts()
        except ValueError as error:
            return RobustStability(False, None, 0, rate, worst, str(error))
        result = prove_box(parts, Statement(loops.stable), limit)
        cells, bad = result.parameter_cells + result.frequency_cells, result.refuted
        if bad is not None:
            return RobustStability(False, family.denormalize(bad), cells, loops.abscissa(bad), family.denormalize(bad))
        reason = ""
        if result.left is not None:
            where = f"{listed_values(family.denormalize(result.left))}, where poles have real parts up to"
            reason = (
                f"not decided at {where} {loops.abscissa(result.left):.4g} rad/s: it takes more than max_cells = {limit}, "
                f"or cells below 1/{limit} of the box"
            )
        alone = RobustStability(result.proved, None, cells, rate, worst, reason, result.method)
        if additive_uncertainty is None or not result.proved:
            return alone
        from boomctl.analysis.box.unmodeled import small_gain  # imports worst_case

        assert isinstance(loops.controller, Lti)
        around = small_gain(family, loops.controller, additive_uncertainty, delay, COST_RATIO * limit)
    gain, below = around.lower_bound, around.upper_bound < 1.0
    if gain >= 1.0:
        reason = f"small-gain norm {gain:.4g} at {listed_values(around.worst_values)}"
    else:
        reason = "" if below else f"small-gain norm not proved below 1; worst_case: {around.message}"
    method = f"{alone.method}; {around.method} with unmodeled dynamics" if around.method else alone.method
    method = method if below else ""
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
    """Compute the scaling of the parameter box about its midpoint up to which the loop ``u = K y`` remains stable.

    The factor is computed by bisection over :func:`robust_stability` of the enlarged box.

    Parameters
    ----------
    family, controller, max_cells, delay
        See :func:`robust_stability`.
    max_factor : float
        Largest scaling of the box.  If no instability is known up to this factor, ``upper_bound`` is infinite.
    rtol : float
        Relative gap between the bounds at which the search stops.
    progress : callable, optional
        Called with a `Progress` at each stage.  If None, a progress line is shown after 3 s; `progress_callback` receives
        the stages of all computations in its block.

    Returns
    -------
    RobustStabilityMargin
        Lower and upper bound of the factor.

    Raises
    ------
    TypeError, ValueError
        As in :func:`robust_stability`, or if a factor or a tolerance is out of range.

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
    # Factors: largest proved, smallest unproved, largest without a known instability, smallest with one.
    good, ceiling, calm, bad, where, factor = 0.0, top, 0.0, inf, None, top
    with computing("structured margin", progress):
        for _ in range(_PROOFS):
            result = robust_stability(_enlarged(family, factor), controller, limit, delay=delay)
            if result.destabilizing_values is None:
                calm = max(calm, factor)
            else:
                where = result.destabilizing_values
                bad = float(np.abs(family.normalize(where)).max())
            good, ceiling = (factor, ceiling) if result.proved else (good, min(ceiling, factor, bad))
            unproved, unknown = ceiling - good, bad - calm if bad < inf else 0.0
            if max(unproved, unknown) <= 0.5 * close * ceiling:
                break
            factor = good + 0.5 * unproved if unproved >= unknown else calm + 0.5 * unknown
    return RobustStabilityMargin(good, bad, where)


def _enlarged(family: Family, factor: float) -> Family:
    """Return a family over its box enlarged by a factor about its midpoint."""
    middle, reach = 0.5 * (family.low + family.high), 0.5 * factor * (family.high - family.low)
    changes = tuple(
        (power, Slope(*(factor ** len(power) * getattr(change, letter) for letter in "MCKBL")))
        for power, change in family.coefficients
    )
    return replace(family, low=middle - reach, high=middle + reach, coefficients=changes)
