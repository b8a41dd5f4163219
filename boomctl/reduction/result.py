"""What a reduction returns, and what it raises when it cannot vouch for a result."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from boomctl.analysis.norm import NormCertificate
from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.printing import between
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control


class ReductionError(RuntimeError):
    """A reduced system could not be verified; the message says what failed."""


@dataclass(frozen=True)
class ReductionResult:
    """A reduced system with a bound known beforehand and an error verified afterwards.

    Attributes
    ----------
    system : control.StateSpace or SecondOrderModel
        The reduced system, signals named as in the full one; a ``SecondOrderModel`` for the method "second-order".
        A ``StateSpace`` is made when it is first read.
    order : int
        Number of its states, kept unstable and rigid-body states included.
    error_bound : float
        A priori bound of the largest singular value of the difference at any frequency; ``inf`` where none is known.
    measured_error : float
        H-infinity norm of the difference, within the band where one was asked for: a level proven not to be reached,
        the bound of the modes left out of the core included.
    method : str
        How the system was reduced.
    certificate : NormCertificate
        Of the difference between the core and the reduced system.
    truncation_bound : float
        Bound, in closed form, of what the core leaves out of the full system; part of both errors.
    hankel_values : (n,) ndarray
        Hankel singular values of the stable part, descending; of the weighted one where a band was asked for.
    kept : int
        Number of unstable and rigid-body states that are kept exactly.
    path : tuple of str
        What stood for the system, smaller cores first: each larger one was needed.
    """

    _reduced: Lti | SecondOrderModel = field(repr=False)
    order: int
    error_bound: float
    measured_error: float
    method: str
    certificate: NormCertificate
    truncation_bound: float
    hankel_values: Array = field(repr=False)
    kept: int = 0
    path: tuple[str, ...] = ()

    @cached_property
    def system(self) -> "control.StateSpace | SecondOrderModel":
        """The reduced system."""
        return self._reduced.statespace("reduced") if isinstance(self._reduced, Lti) else self._reduced

    def __repr__(self) -> str:
        ends = between(self._reduced.inputs, self._reduced.outputs)
        kept = f", {self.kept} unstable or rigid-body states kept" if self.kept else ""
        error = f"error {self.measured_error:.6g}, verified; bound {self.error_bound:.6g}"
        return f"ReductionResult: {self.order} states, {self.method}: {ends}\n  {error}{kept}"
