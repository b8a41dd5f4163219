"""H-infinity norms of structures and state-space systems, with the split of symmetric structures.

A symmetric structure is represented by its two subsystems, whose singular values together are those of the structure.  The
state space of each is in its undamped modes, if it has real modes, or in its own coordinates; the response at the peak is
computed from the structure's matrices.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.norm import LOST, NO_RESPONSE, NormBounds, matrices_norm, norm_of_data
from boomctl.analysis.sum_over_modes import bounds
from boomctl.arrays import Array
from boomctl.lti.frequency import (
    ABOVE,
    BELOW,
    MODES,
    SEARCHED,
    Resonances,
    highest_peak,
    resonance_grid,
    singular_values,
)
from boomctl.lti.rounding import CERTIFIED, TINY
from boomctl.lti.system import beside, is_frequency_response, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.direct import direct_response, respond, respond_whole
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.poles import first_order_poles
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    LinearSystem = SecondOrderModel | control.StateSpace | control.TransferFunction | control.FrequencyResponseData

_SPARE = 3  # Additional modes: the number of rigid-body modes of a planar body.
# Largest number of coordinates for which the split is not used: the modes of both subsystems take longer than one norm.
_WHOLE = 24
# Ratio of the fastest rate to the lowest elastic frequency beyond which no state space represents both.
_HELD = 1e12
_WIDE = 1e7  # Largest ratio of a band's last mode to its lowest mode.


@one_blas_thread
def hinf_norm(system: "LinearSystem") -> NormBounds:
    """Return the certified H-infinity norm of a linear system; infinite if it is not stable.

    Poles on the imaginary axis (undamped or integrating modes) count only if they contribute to the response.  For a discrete
    system, the unit circle replaces the imaginary axis.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace, control.TransferFunction or control.FrequencyResponseData
        System, from all inputs to all outputs; a boom model without selected signals from platform actuators to tips, as in
        :func:`sigma`.  For frequency response data the largest value on their grid is returned, without an upper bound.

    Returns
    -------
    NormBounds
        Lower and upper bound of the norm, and the frequency of the peak [rad/s].

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type, an unspecified sampling time, or an entry that is not finite.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> oscillator = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    >>> norm = bc.hinf_norm(oscillator)
    >>> round(norm.lower_bound, 2), round(norm.peak_omega, 3), bool(norm.certified)
    (10.01, 0.997, True)
    """
    if isinstance(system, SecondOrderModel):
        system = system.between()
        # If a pole is not stable, exact arithmetic decides, whose run time grows with the fourth power of the states.
        if system.ncoordinates <= _WHOLE and (system._modal_form.eigensystem[0].real < 0.0).all():
            result = SplitModel(system, (system,)).norm()
            return result if result.status == "certified" else norm_of(system)
    elif not is_frequency_response(system):
        plain = of(system, sampled=True)
        return replace(norm_of(plain.balanced()), _given=plain)
    return norm_of(system)


def norm_of(system: Any) -> NormBounds:
    """Return the H-infinity norm of a structure, a balanced ``Lti`` or data, between all signals."""
    if is_frequency_response(system):
        return norm_of_data(np.asarray(system.omega, dtype=float), np.asarray(system.frdata))
    if isinstance(system, SecondOrderModel):
        return SplitModel.of(system).norm()
    return matrices_norm(system)


@dataclass(frozen=True)
class SplitModel:
    """Model with the parts whose singular values together are those of the model: two subsystems, or the model itself."""

    model: SecondOrderModel
    parts: tuple[SecondOrderModel, ...]

    @classmethod
    def of(cls, model: SecondOrderModel) -> "SplitModel":
        """Return a model with its parts; a subsystem without inputs or outputs is omitted."""
        return cls(model, (model,) if model._halves is None else model._halves)

    def singular_values(self, omega: Array) -> Array:
        """Return the singular values, descending, shape (min(outputs, inputs), frequencies)."""
        count = min(len(self.model.input_labels), len(self.model.output_labels))
        result = [singular_values(respond_whole(part.structure, part.ports, omega)) for part in self.parts]
        return -np.sort(-np.vstack([*result, np.zeros((count, len(omega)))]), axis=0)[:count]

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        return respond(self.model.structure, self.model.ports, omega)

    @cached_property
    def poles(self) -> Array:
        """Poles of all parts [rad/s]."""
        result = [np.zeros(0, complex)]
        for part in self.parts:
            try:
                wide = part.structure.strain_form if _is_wide(part) else None
                result.append(part._modal_form.poles if wide is None else wide.poles())
            except (
                ValueError
            ):  # An output needs a derivative of an input: the norm is not defined, but the response is.
                result.append(first_order_poles(part.M, part.C, part.K))
        return np.concatenate(result)

    def resonances(self, high: float | None = None) -> Resonances:
        """Return the poles up to a few times the eighth mode, or up to ``high`` [rad/s], with their frequency range."""
        parts = self.parts if len(self.parts) == 2 else (self.model,)
        try:
            modes = [undamped_modes(part.structure, min(MODES + _SPARE, part.ncoordinates))[0] for part in parts]
        except ValueError:  # no real modes
            modes = [np.zeros(0)]
        frequencies = np.sort(np.concatenate(modes))
        shown = frequencies[frequencies > 0.0][:MODES]
        shown = shown[shown <= _WIDE * shown[:1]]
        if not len(shown):
            return Resonances.of(first_order_poles(self.model.M, self.model.C, self.model.K), high)
        low, top = float(shown[0]), ABOVE * float(shown[-1]) if high is None else high
        return Resonances(self.poles[(self.poles.imag >= 0.0) & (np.abs(self.poles) <= top)], BELOW * low, top)

    @one_blas_thread
    def norm(self) -> NormBounds:
        """Return the certified H-infinity norm; infinite with undamped or integrating modes.

        Raises
        ------
        ValueError
            If the response is not proper (an output needs a derivative of an input).
        """
        if not self.parts:
            return NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, ("halves",), verified=True, _proved=True, _given=self.model)
        bounded = [(None if _is_wide(part) else bounds(part._modal_form), part) for part in self.parts]
        norms: list[NormBounds] = []
        for most, part in sorted(bounded, key=lambda item: -inf if item[0] is None else -item[0].norm):
            if most is None:  # No state space represents its fastest and its slowest motions.
                band, respond = SplitModel(part, (part,)).resonances(), partial(_response, part)
                grid = resonance_grid(band.poles, band.low, band.high, points=SEARCHED)
                peak, at = highest_peak(lambda omega, of=respond: singular_values(of(omega))[0], grid)
                norms.append(NormBounds(peak, inf, at, LOST))
            elif (
                not norms or most.norm > norms[0].lower_bound
            ):  # Otherwise its bound is below the norm of another part.
                norms.append(matrices_norm(part._modal_form, partial(_response, part), most))
        largest = max(norms, key=lambda norm: norm.lower_bound)
        widest = max(norms, key=lambda norm: norm.upper_bound)
        verified = largest.verified and widest.upper_bound <= largest.lower_bound * (1.0 + CERTIFIED) + TINY
        return replace(
            largest,
            upper_bound=widest.upper_bound,
            method=largest.method if verified else widest.method,  # Reason why it is not verified.
            stages=(*(() if self.parts == (self.model,) else ("halves",)), *map(_coordinates_of, self.parts)),
            verified=verified,
            _proved=all(norm._proved for norm in norms),
            _given=self.model,
        )


def _is_wide(part: SecondOrderModel) -> bool:
    form = part.structure.strain_form
    if form is None:
        return False
    frequencies = form.own_modes[0]
    moving = frequencies[frequencies > 0.0]
    fastest = max(float(frequencies[-1]), float(np.abs(part._modal_form.A.diagonal()).max()))
    return len(moving) > 0 and fastest > _HELD * moving[0]


def _coordinates_of(part: SecondOrderModel) -> str:
    """Return the coordinates of a structure's state space as text."""
    try:
        _ = part.structure.strain_form or undamped_modes(part.structure)
    except ValueError:
        return "given coordinates"
    return "undamped modes"


def _response(part: SecondOrderModel, omega: Array) -> Array:
    points = np.maximum(omega, beside(np.zeros(1))) if any(part.ports.integrators) else omega
    try:
        return direct_response(part.structure, part.ports, points)
    except ValueError:  # A frequency is that of an undamped mode, which may not contribute.
        if len(points) == 1:
            return direct_response(part.structure, part.ports, beside(points))
    return np.concatenate([_response(part, points[k : k + 1]) for k in range(len(points))], axis=2)
