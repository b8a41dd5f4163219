"""Result of a model reduction, and its error curves."""

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
    """A reduced system with an a priori error bound and a verified error.

    Attributes
    ----------
    system : control.StateSpace or SecondOrderModel
        The reduced system, signals named as in the full one; a ``SecondOrderModel`` for the method "second-order".
        A ``StateSpace`` is created on first access.
    order : int
        Number of states of the reduced system, including retained unstable and rigid-body states.
    error_bound : float
        A priori bound on the largest singular value of the difference at any frequency; ``inf`` if none is known.
        Never below the verified error, which includes rounding.
    error_norm : float
        H-infinity norm of the difference, within `omega_range` if there is one: a verified bound 1 % above the largest
        computed error, plus rounding.  Rounding of the retained states is not included, because near an undamped pole it
        may change the response by any amount.
    method : str
        Reduction method.
    certificate : NormBounds
        Bounds on the H-infinity norm of the difference between the stable parts, rounding included.
    hankel_singular_values : (n,) ndarray
        Hankel singular values of the stable part, descending; weighted by `omega_range` if there is one.
    retained_order : int
        Number of unstable, undamped and rigid-body states, which are retained unchanged except for rounding.
    requested_order : int or None
        Requested number of states; None if an error was requested.
    stages : tuple of str
        Coordinates in which the stable part was reduced.
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
        """Yield the claims that can be proved."""
        full, reduced = of(self._full, sampled=True), of(self._reduced, sampled=True)
        approximation = (
            "the state-space approximation of the structure" if isinstance(self._full, SecondOrderModel) else ""
        )
        if self.retained_order:  # The response near their poles is exact, regardless of the last digits.
            approximation = "states that are retained unchanged except for rounding"
        norm, stable = (0.0, self.error_norm, self.certificate.peak_omega), None if self.retained_order else True
        yield Claim("the error", full, None, reduced, stable, norm, band=self.omega_range, rounded=approximation)

    def __repr__(self) -> str:
        ends = between(self._reduced.input_labels, self._reduced.output_labels)
        retained = f", {self.retained_order} unstable or rigid-body states kept" if self.retained_order else ""
        within = "" if self.omega_range is None else " from {:.6g} to {:.6g} rad/s".format(*self.omega_range)
        everywhere = within and " at all frequencies"
        error = (
            f"error at most {self.error_norm:.6g}{within}, verified; a priori bound {self.error_bound:.6g}{everywhere}"
        )
        requested = "" if self.requested_order in (None, self.order) else f" ({self.requested_order} requested)"
        states = f"{self.order} of {self.full_order} states{requested}"
        return f"ReductionResult: {states}, {self.method}: {ends}\n  {error}{retained}"

    @cached_property
    @one_blas_thread
    def curves(self) -> ReductionCurves:
        """Singular values of the full and the reduced system and of their difference, computed on first access."""
        full, reduced, worst = SelectedSystem(self._full), SelectedSystem(self._reduced), self.certificate.peak_omega
        top = ABOVE * max(worst if worst < inf else 0.0, 0.0 if self.omega_range is None else self.omega_range[1])
        band = full.resonances()
        omega = drawn_grid(full.resonances(top) if top > band.high else band, [worst])
        before, after = (system.response(omega, quiet=True) for system in (full, reduced))
        error = singular_values(before - after)[0]
        return ReductionCurves(omega, singular_values(before), singular_values(after), error)

    def plot(self, ax: "Axes | None" = None, *, frequency_unit: str | None = None, **style: Any) -> "Axes":
        """Draw the singular values of the full and the reduced system, the error, and its verified bound.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on.  If None, a new figure is created.
        frequency_unit : {"Hz", "rad/s"}, optional
            Unit of the frequency axis, by default Hz.
        **style
            Line properties of all curves, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.design").plot_reduction(self, ax, frequency_unit=frequency_unit, **style)
