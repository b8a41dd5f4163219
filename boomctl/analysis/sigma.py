"""Singular values over frequency, on a grid that resolves every lightly damped peak, with a certified largest one."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.model_norm import SplitModel
from boomctl.analysis.norm import UNSTABLE, NormCertificate, matrices_norm
from boomctl.arrays import Array
from boomctl.checks import frequencies, names
from boomctl.lti.frequency import DRAWN, Resonances, resonance_grid, singular_values
from boomctl.lti.modal import side_of_axis
from boomctl.lti.system import Lti, is_frequency_response, of
from boomctl.printing import between
from boomctl.structure.matrices import dense
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import first_order_poles

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

_POINTS = 240  # of a curve, beside those at the resonances: about 100 a decade on a boom's band (a choice)
_PRINTED = 100  # coordinates up to which printing waits for the poles: tens of milliseconds (measured)
_BESIDE = 0.1  # share of it beside an undamped mode that is not drawn: half of the way to the next place (`DRAWN`)
NARROWEST = 1e-6  # share of its frequency as which a narrower resonance is drawn: no eye tells them apart (a choice)


@dataclass(frozen=True)
class _StateSpace:
    """A state-space system, asked the same as a :class:`SplitModel`."""

    system: Lti

    def singular_values(self, omega: Array, quiet: bool = False) -> Array:
        """Return the singular values, descending; ``quiet`` as in :meth:`Lti.response`."""
        return singular_values(self.system.response(omega, quiet=quiet))

    def resonances(self) -> Resonances:
        """Return the lowest resonances, and a band that shows them."""
        return Resonances.of(self.system.poles)

    def norm(self) -> NormCertificate:
        """Return the certified H-infinity norm."""
        return matrices_norm(self.system)


@dataclass(frozen=True)
class SigmaResult:
    """Singular values over frequency and the largest of all.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    sigma : (k, n) ndarray
        Singular values, descending.
    inputs, outputs : tuple of str
        Between which signals.
    peak, peak_omega : float
        Largest singular value and its frequency: the H-infinity norm of a model or state-space system (``inf`` with
        undamped, integrating or unstable modes that show), the largest value on the grid of measured data.
    certified : bool
        Whether ``peak`` lies between two bounds computed apart from each other; see ``certificate``.
    """

    omega: Array
    sigma: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    _of: SplitModel | _StateSpace | NormCertificate  # what the norm is of; the norm itself where it is known

    @cached_property
    def certificate(self) -> NormCertificate:
        """The norm and its bounds, computed when first asked for."""
        return self._of if isinstance(self._of, NormCertificate) else self._of.norm()

    def __repr__(self) -> str:
        span = f"{len(self.omega)} frequencies, {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s"
        if isinstance(self._of, NormCertificate) or "certificate" in self.__dict__:
            at = f" at {self.peak_omega:.6g} rad/s" if isfinite(self.peak_omega) else ""
            peak = f"peak {self.peak:.6g}{at}, {'certified' if self.certified else 'not certified'}"
        else:  # printing must not cost what the norm costs
            peak = f"largest of these {self.sigma.max():.6g}; the norm is computed when .peak is asked for"
            if isinstance(self._of, SplitModel) and self._of.model.n > _PRINTED:
                return f"SigmaResult: {between(self.inputs, self.outputs)}\n  {span}\n  {peak}"
        if self.unstable:
            span += "\n  unstable: these are no responses to sines, which would grow without bound"
        return f"SigmaResult: {between(self.inputs, self.outputs)}\n  {span}\n  {peak}"

    @cached_property
    def unstable(self) -> bool:
        """Whether the system has an unstable pole: no response to a sine is then as large as its singular value."""
        if "certificate" in self.__dict__ or isinstance(self._of, NormCertificate):
            return self.certificate.method == UNSTABLE
        if isinstance(self._of, _StateSpace):
            poles = self._of.system.poles
        else:
            m = self._of.model
            poles = first_order_poles(dense(m.M), dense(m.C), dense(m.K)) if m.n <= _PRINTED else None
        return self.certificate.method == UNSTABLE if poles is None else bool((side_of_axis(poles) > 0).any())

    @property
    def peak(self) -> float:
        """Largest singular value."""
        return self.certificate.lower

    @property
    def peak_omega(self) -> float:
        """Frequency of the largest singular value [rad/s]."""
        return self.certificate.omega

    @property
    def certified(self) -> bool:
        """Whether the peak is certified."""
        return self.certificate.certified

    def plot(self, label: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the singular values over frequency; return the axes.  The picture says so if the system is unstable."""
        return import_module("boomctl.plotting").plot_sigma(self, label=label, ax=ax)


def sigma(
    system: "SecondOrderModel | control.StateSpace | control.FrequencyResponseData",
    omega: ArrayLike | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> SigmaResult:
    """Return the singular values of a system over frequency.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or control.FrequencyResponseData
    omega : array_like, optional
        Angular frequencies [rad/s].  By default a grid that spans the lowest modes and resolves each of their peaks,
        the certified one included.
    inputs, outputs : str or sequence of str, optional
        Between which signals.  By default all; of a boom model, platform actuators and tips.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown signals; frequencies negative or not finite; ``omega`` given for measured data; a
        response beyond all floating-point numbers.
    """
    if is_frequency_response(system):
        return _of_data(system, omega, inputs, outputs)
    if isinstance(system, SecondOrderModel):
        first = system.ports.primary or (None, None)
        chosen = system.select(first[0] if inputs is None else inputs, first[1] if outputs is None else outputs)
        given = SplitModel.of(chosen)
    else:
        expected = "SecondOrderModel, StateSpace or FrequencyResponseData"
        chosen = of(system, expected=expected).select(inputs, outputs).balanced()
        given = _StateSpace(chosen)
    if omega is not None:
        grid = frequencies("omega", omega)
        return SigmaResult(grid, _finite(grid, given.singular_values(grid)), chosen.inputs, chosen.outputs, given)
    found, certificate = given.resonances(), given.norm()
    grid = resonance_grid(
        found.poles,
        found.low,
        found.high,
        points=_POINTS,
        places=DRAWN,
        narrowest=NARROWEST,
        also=[certificate.omega] if found.low <= certificate.omega < np.inf else (),
    )
    undamped = np.abs(found.poles[side_of_axis(found.poles) == 0].imag)  # where the response cannot be asked
    grid = grid[(np.abs(grid[:, None] - undamped) > _BESIDE * NARROWEST * undamped).all(axis=1)]
    values = _finite(grid, given.singular_values(grid, quiet=True))
    return SigmaResult(grid, values, chosen.inputs, chosen.outputs, certificate)


def _finite(omega: Array, values: Array) -> Array:
    """Return singular values; those beyond all floating-point numbers are refused."""
    bad = ~np.isfinite(values).all(axis=0)
    if bad.any():
        raise ValueError(
            f"system: its response at {omega[bad][0]:g} rad/s is beyond all floating-point numbers;"
            " expected a system in units in which it is not"
        )
    return values


def _of_data(
    data: "control.FrequencyResponseData",
    omega: ArrayLike | None,
    inputs: str | Sequence[str] | None,
    outputs: str | Sequence[str] | None,
) -> SigmaResult:
    if omega is not None:
        raise ValueError("omega: frequency response data have their own frequencies; leave it out")
    ins, outs = names("input", inputs, data.input_labels), names("output", outputs, data.output_labels)
    o, i = [data.output_labels.index(n) for n in outs], [data.input_labels.index(n) for n in ins]
    response: Array = np.asarray(data.frdata)[np.ix_(o, i)]
    grid, values = np.asarray(data.omega, dtype=float), singular_values(response)
    if not np.isfinite(values).all():
        raise ValueError("system: expected finite frequency response data")
    best = int(np.argmax(values[0]))
    certificate = NormCertificate(
        float(values[0, best]), np.inf, float(grid[best]), "largest value on the grid of the data"
    )
    return SigmaResult(grid, values, ins, outs, certificate)
