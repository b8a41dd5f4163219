"""H-infinity norms of structures and state-space systems, and structures seen through their halves.

A symmetric structure stands as its two halves, whose singular values together are its own.  The state space of each is that
of its undamped modes, where it has them, or of its own coordinates; the response at its peak comes from its matrices.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.norm import LOST, NO_RESPONSE, NormBounds, agree, matrices_norm, norm_of_data
from boomctl.analysis.sum_over_modes import Bounded, bounds
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
from boomctl.lti.system import beside, is_frequency_response, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.direct import direct_response, respond, respond_whole
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.poles import first_order_poles
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    LinearSystem = SecondOrderModel | control.StateSpace | control.TransferFunction | control.FrequencyResponseData

_SPARE = 3  # Modes asked for beyond these, so that as many are left without the rigid ones of a plane body.
# Coordinates up to which halves cost one norm more than they save: each needs its modes (measured).
_WHOLE = 24
# Ratio of the fastest rate to the lowest elastic frequency beyond which no state space holds both.
_HELD = 1e12
_WIDE = 1e7  # Ratio of a band's last mode to its lowest: beyond, it ends below (a choice).


@one_blas_thread
def hinf_norm(system: "LinearSystem") -> NormBounds:
    """Return the certified H-infinity norm of a linear system; infinite if it is not stable.

    Poles on the imaginary axis count only if they show in the response (undamped or integrating modes).  Of a discrete
    system it is the largest singular value on the unit circle, and such poles are those on the circle.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace, control.TransferFunction or control.FrequencyResponseData
        The system, from all its inputs to all its outputs; a boom model without selected signals from its platform
        actuators to its tips, as in :func:`sigma`.  Of frequency response data the largest value on their grid is returned,
        which certifies nothing.

    Returns
    -------
    NormBounds
        Lower and upper bound of the norm, and the frequency of the peak [rad/s].

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time that does not say its sampling time, not finite.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> swing = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    >>> norm = bc.hinf_norm(swing)
    >>> round(norm.lower_bound, 2), round(norm.peak_omega, 3), bool(norm.certified)
    (10.01, 0.997, True)
    """
    if isinstance(system, SecondOrderModel):
        system = system.between()
        # where a pole does not decay exact arithmetic tells, whose time grows with the fourth power of the states
        if system.ncoordinates <= _WHOLE and (system._modal_form.eigensystem[0].real < 0.0).all():
            result = SplitModel(system, (system,)).norm()
            return result if result.status == "certified" else norm_of(system)
        return norm_of(system)
    if is_frequency_response(system):
        return norm_of(system)
    handed = of(system, sampled=True)
    return replace(norm_of(handed.balanced()), _given=handed)


def norm_of(system: Any) -> NormBounds:
    """Return the H-infinity norm of a structure, a balanced ``Lti`` or data, all signals of which are meant."""
    if is_frequency_response(system):
        return norm_of_data(np.asarray(system.omega, dtype=float), np.asarray(system.frdata))
    if isinstance(system, SecondOrderModel):
        return SplitModel.of(system).norm()
    return matrices_norm(system)


@dataclass(frozen=True)
class SplitModel:
    """A model and the parts whose singular values together are its own: its two halves if it splits, or itself."""

    model: SecondOrderModel
    parts: tuple[SecondOrderModel, ...]

    @classmethod
    def of(cls, model: SecondOrderModel) -> "SplitModel":
        """Return a model with its parts; a half without inputs or outputs is none."""
        return cls(model, (model,) if model._halves is None else model._halves)

    def singular_values(self, omega: Array) -> Array:
        """Return the singular values, descending, shape (min(outputs, inputs), frequencies)."""
        count = min(len(self.model.input_labels), len(self.model.output_labels))
        result = [singular_values(respond_whole(part.structure, part.ports, omega)) for part in self.parts]
        if [len(values) for values in result] == [1, 1]:
            return np.array([np.maximum(*result)[0], np.minimum(*result)[0]])[:count]
        return -np.sort(-np.vstack([*result, np.zeros((count, len(omega)))]), axis=0)[:count]

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        return respond(self.model.structure, self.model.ports, omega)

    @cached_property
    def poles(self) -> Array:
        """The poles of all parts [rad/s]."""
        return np.concatenate([np.zeros(0, complex), *map(_poles, self.parts)])

    def resonances(self, high: float | None = None) -> Resonances:
        """Return the poles up to a few times the eighth mode, or up to ``high`` [rad/s], and a band that shows them."""
        parts = self.parts if len(self.parts) == 2 else (self.model,)
        try:
            found = [undamped_modes(part.structure, min(MODES + _SPARE, part.ncoordinates))[0] for part in parts]
        except ValueError:  # no real modes
            found = [np.zeros(0)]
        frequencies = np.sort(np.concatenate(found))
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
            A response that is not proper (an output that needs a derivative of an input).
        """
        if not self.parts:
            return NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, ("halves",), verified=True, _proved=True, _given=self.model)
        bounded = [(Bounded() if _is_wide(part) else bounds(part._modal_form), part) for part in self.parts]
        norms: list[NormBounds] = []
        # Of a part whose bound is below the norm of another one nothing else is asked.
        for most, part in sorted(bounded, key=lambda item: -item[0].norm):
            if not norms or most.norm > norms[0].lower_bound:
                norms.append(_part_norm(part, most))
        largest = max(norms, key=lambda norm: norm.lower_bound)
        widest = max(norms, key=lambda norm: norm.upper_bound)
        verified = agree(largest.lower_bound, widest.upper_bound) and largest.verified
        return replace(
            largest,
            upper_bound=widest.upper_bound,
            method=largest.method if verified else widest.method,  # Why it is not verified.
            stages=(*(() if self.parts == (self.model,) else ("halves",)), *map(_coordinates_of, self.parts)),
            verified=verified,
            _proved=all(norm._proved for norm in norms),
            _given=self.model,
        )


def _part_norm(part: SecondOrderModel, bounded: Bounded) -> NormBounds:
    """Return the norm of a part; not verified where no state space holds its fastest motions beside the slowest ones."""
    if not _is_wide(part):
        return matrices_norm(part._modal_form, partial(_response, part), bounded)
    found = SplitModel(part, (part,)).resonances()
    grid = resonance_grid(found.poles, found.low, found.high, points=SEARCHED)
    peak, at = highest_peak(lambda omega: singular_values(_response(part, omega))[0], grid)
    return NormBounds(peak, inf, at, LOST)


def _is_wide(part: SecondOrderModel) -> bool:
    form = part.structure.strain_form
    if form is None:
        return False
    frequencies = form.own_modes[0]
    moving = frequencies[frequencies > 0.0]
    fastest = max(float(frequencies[-1]), float(np.abs(part._modal_form.A.diagonal()).max()))
    return len(moving) > 0 and fastest > _HELD * moving[0]


def _poles(part: SecondOrderModel) -> Array:
    try:
        wide = part.structure.strain_form if _is_wide(part) else None
        return part._modal_form.poles if wide is None else wide.poles()
    except ValueError:  # An output that needs a derivative of an input: its norm is refused, not its response.
        return first_order_poles(part.M, part.C, part.K)


def _coordinates_of(part: SecondOrderModel) -> str:
    """Return over which coordinates the state space of a structure is."""
    try:
        _ = part.structure.strain_form or undamped_modes(part.structure)
    except ValueError:
        return "given coordinates"
    return "undamped modes"


def _response(part: SecondOrderModel, omega: Array) -> Array:
    seen = np.maximum(omega, beside(np.zeros(1))) if any(part.ports.integrators) else omega
    try:
        return direct_response(part.structure, part.ports, seen)
    except ValueError:  # one of the frequencies is that of an undamped mode, which may not show
        if len(seen) == 1:
            return direct_response(part.structure, part.ports, beside(seen))
    return np.concatenate([_response(part, seen[k : k + 1]) for k in range(len(seen))], axis=2)
