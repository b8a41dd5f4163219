"""Singular values over frequency, on a grid that resolves every lightly damped peak, with a certified largest one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.model_norm import model_norm, orthonormal_parts, resonances
from boomctl.analysis.norm import NormCertificate, matrices_norm
from boomctl.arrays import Array
from boomctl.checks import frequencies, names
from boomctl.lti.frequency import DRAWN, Resonances, resonance_grid, singular_values
from boomctl.lti.system import Lti, is_frequency_response, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.direct import respond, respond_part

if TYPE_CHECKING:
    import control

_POINTS = 240  # of a curve, beside those at the resonances: about 100 a decade on a boom's band (a choice)
NARROWEST = 1e-6  # share of its frequency as which a narrower resonance is drawn: no eye tells them apart (a choice)


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
    _norm: Callable[[], NormCertificate] = field(repr=False)

    @cached_property
    def certificate(self) -> NormCertificate:
        """The norm and its bounds, computed when first asked for."""
        return self._norm()

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

    def plot(self, label: str | None = None, ax: Any = None) -> Any:
        """Draw the singular values over frequency; return the axes."""
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
        Another kind of system; unknown signals; frequencies negative or not finite; ``omega`` given for measured data.
    """
    if is_frequency_response(system):
        return _of_data(system, omega, inputs, outputs)
    if isinstance(system, SecondOrderModel):
        first = system.primary or (None, None)
        model = system.select(first[0] if inputs is None else inputs, first[1] if outputs is None else outputs)
        signals = model.inputs, model.outputs
        norm, poles, values = partial(model_norm, model), partial(resonances, model), partial(_model_values, model)
    else:
        matrices = of(system, expected="SecondOrderModel, StateSpace or FrequencyResponseData").select(inputs, outputs)
        signals, matrices = (matrices.inputs, matrices.outputs), matrices.balanced()
        norm, poles = partial(matrices_norm, matrices), lambda: Resonances.of(matrices.poles)
        values = partial(_matrix_values, matrices)
    if omega is not None:
        grid = frequencies("omega", omega)
        return SigmaResult(grid, values(grid), *signals, norm)
    found, certificate = poles(), norm()
    peak = [certificate.omega] if found.low <= certificate.omega < np.inf else []
    grid = resonance_grid(
        found.poles, found.low, found.high, points=_POINTS, places=DRAWN, narrowest=NARROWEST, also=peak
    )
    return SigmaResult(grid, values(grid), *signals, lambda: certificate)


def _model_values(model: SecondOrderModel, omega: Array) -> Array:
    parts = orthonormal_parts(model)
    if len(parts) == 1:
        return singular_values(respond(parts[0], omega))
    values = np.vstack([singular_values(respond_part(part, omega)) for part in parts])
    return -np.sort(-values, axis=0)[: min(len(model.inputs), len(model.outputs))]


def _matrix_values(system: Lti, omega: Array) -> Array:
    return singular_values(system.response(omega))


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
    return SigmaResult(grid, values, ins, outs, lambda: certificate)
