"""What a reduction returns, and what it raises when it cannot vouch for a result."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import inf
from typing import TYPE_CHECKING, Any

from boomctl.analysis.claim import Claim
from boomctl.analysis.norm import NormBounds
from boomctl.analysis.sigma import SelectedSystem, drawn_grid
from boomctl.arrays import Array
from boomctl.lti.frequency import ABOVE, singular_values
from boomctl.lti.system import Lti, of
from boomctl.printing import between, compact
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class ReductionCurves:
    """Singular values before and after a reduction.

    Attributes
    ----------
    omega : (n,) ndarray
        Frequencies [rad/s] that show the lowest resonances of the full system and the largest error.
    full, reduced : (k, n) ndarray
        Singular values of the full and of the reduced system, descending.
    error : (n,) ndarray
        Largest singular value of their difference.

    Examples
    --------
    >>> import boomctl as bc
    >>> reduced = bc.reduce(bc.spray_boom(), order=10)
    >>> curves = reduced.curves
    >>> bool(curves.error.max() <= 1.001 * reduced.error_bound)
    True
    """

    omega: Array
    full: Array
    reduced: Array
    error: Array

    __repr__ = compact


@dataclass(frozen=True)
class ReductionResult:
    """A reduced system with a bound known beforehand and an error verified afterwards.

    Attributes
    ----------
    system : control.StateSpace or SecondOrderModel
        The reduced system, signals named as in the full one; a ``SecondOrderModel`` for the method "second-order".
        A ``StateSpace`` is made when it is first read.
    order : int
        Number of states of the reduced system, kept unstable and rigid-body states included.
    error_bound : float
        A priori bound of the largest singular value of the difference at any frequency; ``inf`` where none is known.
        Never below the verified error, in which rounding counts.
    error_norm : float
        H-infinity norm of the difference, within `omega_range` if there is one: a level 1 % above the largest error found
        that is verified not to be reached, and rounding.  Kept states are the system's own but for rounding, which beside an
        undamped pole changes the response by any amount: that is not in it.
    method : str
        How the system was reduced.
    certificate : NormBounds
        Bounds of the H-infinity norm of the difference between the stable parts; rounding counts in the upper one.
    hankel_singular_values : (n,) ndarray
        Hankel singular values of the stable part, descending; weighted by `omega_range` if there is one.
    retained_order : int
        Number of unstable, undamped and rigid-body states that are kept as they are, but for rounding.
    requested_order : int or None
        Number of states asked for; None where an error was.
    stages : tuple of str
        In which coordinates the stable part was reduced.
    omega_range : (float, float) or None
        Frequency range [rad/s] of ``error_norm``; ``error_bound`` holds at all frequencies.  None for all.
    full_system : control.StateSpace or SecondOrderModel
        The system that was reduced.
    full_order : int
        Number of states of the full system.
    """

    _full: Lti | SecondOrderModel = field(repr=False, compare=False)
    _reduced: Lti | SecondOrderModel = field(repr=False)
    order: int
    error_bound: float
    error_norm: float
    method: str
    certificate: NormBounds
    hankel_singular_values: Array = field(repr=False)
    retained_order: int = 0
    requested_order: int | None = None
    stages: tuple[str, ...] = ()
    omega_range: tuple[float, float] | None = None
    full_order: int = 0

    @cached_property
    def system(self) -> "control.StateSpace | SecondOrderModel":
        """The reduced system."""
        return self._reduced.statespace("reduced") if isinstance(self._reduced, Lti) else self._reduced

    @cached_property
    def full_system(self) -> "control.StateSpace | SecondOrderModel":
        """The system that was reduced, as python-control's where it is not a structure."""
        return self._full.statespace("full") if isinstance(self._full, Lti) else self._full

    def __claims__(self) -> Iterator[Claim]:
        """Yield what can be proved."""
        full, reduced = of(self._full, sampled=True), of(self._reduced, sampled=True)
        stands = "the state space that stands for the structure" if isinstance(self._full, SecondOrderModel) else ""
        if self.retained_order:  # The response near their poles is exact, regardless of the last digits.
            stands = "states that are kept as they are, but for rounding"
        norm, stable = (0.0, self.error_norm, self.certificate.peak_omega), None if self.retained_order else True
        yield Claim("the error", full, None, reduced, stable, norm, band=self.omega_range, rounded=stands)

    def __repr__(self) -> str:
        ends = between(self._reduced.input_labels, self._reduced.output_labels)
        kept = f", {self.retained_order} unstable or rigid-body states kept" if self.retained_order else ""
        within = "" if self.omega_range is None else " from {:.6g} to {:.6g} rad/s".format(*self.omega_range)
        everywhere = within and " at all frequencies"
        error = f"error {self.error_norm:.6g}{within}, verified; bound {self.error_bound:.6g}{everywhere}"
        asked = "" if self.requested_order in (None, self.order) else f" ({self.requested_order} asked for)"
        return (
            f"ReductionResult: {self.order} of {self.full_order} states{asked}, {self.method}: {ends}\n  {error}{kept}"
        )

    @cached_property
    @one_blas_thread
    def curves(self) -> ReductionCurves:
        """Singular values of the full system, of the reduced one and of their difference, computed when first asked for."""
        full, reduced, worst = SelectedSystem(self._full), SelectedSystem(self._reduced), self.certificate.peak_omega
        top = ABOVE * max(worst if worst < inf else 0.0, 0.0 if self.omega_range is None else self.omega_range[1])
        band = full.resonances()
        omega = drawn_grid(full.resonances(top) if top > band.high else band, [worst])
        before, after = (system.response(omega, quiet=True) for system in (full, reduced))
        error = singular_values(before - after)[0]
        return ReductionCurves(omega, singular_values(before), singular_values(after), error)

    def plot(self, ax: "Axes | None" = None, *, frequency_unit: str | None = None, **style: Any) -> "Axes":
        """Draw singular values before and after, the error, and what it is proven not to exceed.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis, by default Hz.
        **style
            Of all curves, as matplotlib's lines take it.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting.design").plot_reduction(self, ax, frequency_unit=frequency_unit, **style)
