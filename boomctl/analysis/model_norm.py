"""Second-order models over frequency: singular values, resonances and certified norms, without their state space.

A symmetric model stands as its two halves, one of many coordinates as a core.  A core speaks for the model up to the
frequency it was built for; above it, dissipation bounds the response: with ``D = K - omega^2 M + i omega C`` and ``C``
positive definite, ``|L D^-1 B(omega)| <= |C^-1/2 L^T| |C^-1/2 B(omega)|/omega``.

The ways to a norm, in the order tried; a certificate's ``stages`` names those that were taken:

==================  ================================================  ==================================================
way                 where                                             why
==================  ================================================  ==================================================
halves              a mirror, signals in pairs of images; not the     the larger of two norms; each goes on below, but a
                    norm alone of a small model that decays           small half that stays below the other's is not
                                                                      searched for a peak of its own
core                40 coordinates and more, real modes               a few motions stand for all; goes on below
undamped modes      real modes                                        light damping costs no digits
given coordinates   no real modes                                     always holds
==================  ================================================  ==================================================

The last two give a state-space system, whose norm is that of :mod:`boomctl.analysis.norm`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.marginal_poles import MarginalPoles, marginal_poles
from boomctl.analysis.norm import NormBounds, matrices_norm, norm_of_data
from boomctl.arrays import Array
from boomctl.lti.frequency import (
    ABOVE,
    BELOW,
    MODES,
    Resonances,
    Response,
    singular_values,
)
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, beside, is_frequency_response, of
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import Ports
from boomctl.structure.response.direct import direct_response, ports_rounding, respond, respond_parts
from boomctl.structure.response.modal_form import elastic
from boomctl.structure.response.poles import first_order_poles, undamped_modes
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    LinearSystem = SecondOrderModel | control.StateSpace | control.TransferFunction | control.FrequencyResponseData

# coordinates up to which halves cost one norm more than they save: each needs its modes (measured)
_WHOLE = 24
CORE_FROM = 40  # coordinates from which on a core, or its bound, is worth its building (a choice)
# verified error of a core, relative, that a norm may be certified with: a hundredth of what that allows
_CORE_ERROR = 1e-7
FEWER = 0.8  # share of a part's coordinates that a core has at most; of more, it is no smaller problem (a choice)
_CORE_ABOVE = 4.0  # where a core ends, relative to the band's last mode: above it dissipation does the rest (a choice)
_WIDE = 1e7  # ratio of a band's last mode to its lowest: beyond, it ends below (a choice)
# ratio of a small structure's fastest pole to its lowest mode, from which on no state space holds both: some 1e-3/eps
_HELD = 1e12
_KEPT = 4.0  # times the top of the band, up to where modes are kept: their error falls with the eighth power (a choice)
# times the top of the band: a motion faster than that follows at once, so that it may be as slow as that (its share of the
# response, small as it is, changes by the inverse square of it)
_FASTEST = 1e4
_DROP = 1e-6  # of the largest motion at rest; what others add to it below that shows in the response by the square
_SPARE = 3  # modes asked for beyond these, so that as many are left without the rigid ones of a plane body


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
    if is_frequency_response(system):
        return norm_of_data(np.asarray(system.omega, dtype=float), np.asarray(system.frdata))
    if isinstance(system, SecondOrderModel):
        system = system.between()
        # where a pole does not decay exact arithmetic tells, whose time grows with the fourth power of the states
        small = system._mirror is not None and system.ncoordinates <= _WHOLE
        if small and (system._modal_form.eigensystem[0].real < 0.0).all():
            result = SplitModel(system, (system,)).norm()
            if result.certified:
                return result
        return SplitModel.of(system).norm()
    handed = of(system, sampled=True)
    return replace(matrices_norm(handed.balanced()), _given=handed)


@dataclass(frozen=True)
class SplitModel:
    """A model and the parts whose singular values together are its own: its two halves if it splits, or itself."""

    model: SecondOrderModel
    parts: tuple[SecondOrderModel, ...]

    @cached_property
    def bands(self) -> tuple["_Band | None", ...]:
        """The band of each part that is not taken whole; None of one that is, or has no real modes."""
        return tuple(_Band.of(part) if part.ncoordinates >= CORE_FROM else None for part in self.parts)

    @cached_property
    def realized(self) -> tuple["_Realized", ...] | None:
        """The state spaces of two small parts; None of others, and where there are none that hold all poles."""
        if len(self.parts) < 2 or any(part.ncoordinates >= CORE_FROM for part in self.parts):
            return None
        try:
            result = tuple(_Realized.of(part) for part in self.parts)
        except ValueError:  # an output that needs a derivative of an input: its norm is refused, not its response
            return None
        return None if any(part.wide for part in result) else result

    @classmethod
    def of(cls, model: SecondOrderModel) -> "SplitModel":
        """Return a model with its parts; a half without inputs or outputs is none."""
        return cls(model, (model,) if model._halves is None else model._halves)

    def singular_values(self, omega: Array, quiet: bool = False) -> Array:
        """Return the singular values, descending, shape (min(outputs, inputs), frequencies)."""
        del quiet  # nothing is answered from beside a frequency: an infinite response is refused
        return singular_values_together([self], omega)[0]

    def _from_parts(self, answers: Sequence[Array], points: int) -> Array:
        """Return the singular values, descending, from the responses of the parts."""
        count = min(len(self.model.input_labels), len(self.model.output_labels))
        result = [singular_values(answer) for answer in answers]
        if [len(values) for values in result] == [1, 1]:
            return np.array([np.maximum(*result)[0], np.minimum(*result)[0]])[:count]
        return -np.sort(-np.vstack([*result, np.zeros((count, points))]), axis=0)[:count]

    def response(self, omega: Array, quiet: bool = False) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        del quiet
        return respond(self.model.structure, self.model.ports, omega).values

    def resonances(self, high: float | None = None) -> Resonances:
        """Return the poles up to a few times the eighth mode, or up to ``high`` [rad/s], and a band that shows them."""
        shown = _modal_band(*(self.parts if len(self.parts) == 2 else [self.model]))
        if shown is None:
            return Resonances.of(first_order_poles(self.model.M, self.model.C, self.model.K), high)
        low, top = shown[0], ABOVE * shown[1] if high is None else high
        if self.realized is not None:
            result = [_upper(part.system.poles, top) for part in self.realized]
        else:
            result = [_poles(part, band, top) for part, band in zip(self.parts, self.bands, strict=True)]
        return Resonances(np.concatenate([np.zeros(0, complex), *result]), BELOW * low, top)

    @one_blas_thread
    def norm(self) -> NormBounds:
        """Return the certified H-infinity norm; infinite with undamped or integrating modes.

        Raises
        ------
        ValueError
            A response that is not proper (an output that needs a derivative of an input).
        """
        if not self.parts:
            return NormBounds(0.0, 0.0, 0.0, "no response", ("halves",))
        if self.realized is not None:
            result = _norms_of_small(self.realized)
        else:
            result = [_part_norm(part, band) for part, band in zip(self.parts, self.bands, strict=True)]
        largest, widest = max(result, key=lambda norm: norm.lower_bound), max(result, key=lambda norm: norm.upper_bound)
        stages = () if self.parts == (self.model,) else ("halves",)
        stages = sum((norm.stages for norm in result), stages)
        both = replace(largest, upper_bound=widest.upper_bound, stages=stages, _given=self.model)
        return both if both.certified else replace(both, method=widest.method)  # why it is not


def singular_values_together(given: Sequence[SplitModel], omega: Array) -> list[Array]:
    """Return the singular values of each model; small parts of one size are computed in one call."""
    parts = [(part.structure, part.ports) for item in given for part in item.parts]
    answers = iter(respond_parts(parts, omega))
    return [item._from_parts([next(answers).values for _ in item.parts], len(omega)) for item in given]


def _modal_band(*parts: SecondOrderModel) -> tuple[float, float] | None:
    """Return the lowest and the eighth elastic frequency of all [rad/s]; None for matrices that have no real modes."""
    try:
        result = [undamped_modes(part.structure, min(MODES + _SPARE, part.ncoordinates))[0] for part in parts]
    except ValueError:
        return None
    frequencies = np.sort(np.concatenate(result))
    shown = frequencies[elastic(frequencies)][:MODES]
    shown = shown[shown <= _WIDE * shown[:1]]
    return (float(shown[0]), float(shown[-1])) if len(shown) else None


@dataclass(frozen=True)
class _Core:
    """A structure of many coordinates seen through a few motions: its lowest modes, and how it answers at rest.

    Modes left out follow forces as at rest, up to the second power of frequency squared: that is two motions for each column
    through which inputs act and outputs read, and for each damper that couples them with the modes kept.  Inputs and outputs
    share the basis, so that the error of the core's response is of second order in the error of the basis.  It is measured
    at the frequencies that matter, against the structure itself.

    Attributes
    ----------
    structure, ports : Structure, Ports
        The small one, over motions of mass one.
    whole : tuple of Structure and Ports
        The large one.
    """

    structure: Structure
    ports: Ports
    whole: tuple[Structure, Ports]

    @classmethod
    def of(cls, structure: Structure, ports: Ports, top: float) -> "_Core":
        """Return a core for frequencies up to ``top`` [rad/s].

        It is taken from strain coordinates where the structure has them, which keep the digits of the slow motions.  Motions
        so fast that no state space holds them beside the slow ones get more mass: see :data:`_FASTEST`.

        Raises
        ------
        ValueError
            A structure without real modes.
        """
        form = structure.strain_form
        if form is None:
            (frequencies, own), seen, damping = undamped_modes(structure), ports, structure.C
        else:
            B, L = form.seen(ports)
            (frequencies, own), seen, damping = form.own_modes, replace(ports, B=B, L=L), form.C
        low = frequencies <= _KEPT * top
        slow, fast, rates = own[:, low], own[:, ~low], frequencies[~low]
        coupled, size, _ = np.linalg.svd(fast.T @ damping @ slow, full_matrices=False)
        resisted = np.einsum("ij,ij->j", slow, damping @ slow).max(initial=0.0)
        ports_loads = fast.T @ np.hstack([*seen.B, *(line.T for line in seen.L)])
        loads = np.hstack([ports_loads, coupled[:, size > ALIKE * resisted]])
        still = np.hstack([loads / rates[:, None] ** 2, loads / rates[:, None] ** 4])
        size = np.linalg.norm(still, axis=0)
        Q, spread, _ = np.linalg.svd(still[:, size > 0.0] / size[size > 0.0], full_matrices=False)
        Q = Q[:, spread > _DROP * spread.max(initial=0.0)]
        stiffness, mixed = linalg.eigh(Q.T @ (rates[:, None] ** 2 * Q))
        basis = np.hstack([slow, fast @ (Q @ mixed)])
        stiffness = np.concatenate([frequencies[low] ** 2, stiffness])
        decay = np.einsum("ij,ij->j", basis, damping @ basis)
        mass = np.maximum(1.0, np.maximum(stiffness / (_FASTEST * top) ** 2, decay / (_FASTEST * top)))
        basis = basis / np.sqrt(mass)
        names = tuple(f"v{i}" for i in range(len(mass)))
        small = Structure(names, (np.eye(len(mass)), basis.T @ damping @ basis, np.diag(stiffness / mass)))
        return cls(small, seen.congruent(basis), (structure, ports))

    def error(self, omega: Array) -> float:
        """Return how far outputs are off at frequencies [rad/s], each input's largest for one, rounding included."""
        structure, ports = self.whole
        true = direct_response(structure, ports, omega)
        off, size = (
            np.abs(values).max(axis=0) for values in (direct_response(self.structure, self.ports, omega) - true, true)
        )
        form = structure.strain_form
        motions = np.eye(structure.n) if form is None else form.V
        rounding = ports_rounding(structure.in_strains, ports, motions, omega)
        return float((off[size > 0.0] / size[size > 0.0]).max(initial=0.0)) + rounding


@dataclass(frozen=True)
class _Band:
    """The band of a part's lowest modes [rad/s], and a core for them and some way above, where there is a small one."""

    low: float
    last: float
    core: _Core | None

    @classmethod
    def of(cls, part: SecondOrderModel) -> "_Band | None":
        band = _modal_band(part)
        if band is None:
            return None
        core = _Core.of(part.structure, part.ports, _CORE_ABOVE * band[1])
        return cls(
            *band,
            core
            if core is None or core.structure.n < FEWER * part.ncoordinates or part.ncoordinates < CORE_FROM
            else None,
        )


def _poles(part: SecondOrderModel, band: _Band | None, top: float) -> Array:
    """Return the poles of a part up to a frequency."""
    small = part.structure if band is None or band.core is None else band.core.structure
    if small.elastic is not None and small.noise > top**2 and small.strain_form is not None:
        poles = small.strain_form.poles()
    else:
        poles = first_order_poles(small.M, small.C, small.K)
    return _upper(poles, top)


def _upper(poles: Array, top: float) -> Array:
    return poles[(poles.imag >= 0.0) & (np.abs(poles) <= top)]


def _part_norm(part: SecondOrderModel, band: _Band | None) -> NormBounds:
    """Return the norm of a part by a core, or of the part as it is."""
    if band is None:
        given = _Realized.of(part)
        band = _Band.of(part) if given.wide else None
        if band is None:
            return given.norm()
    low, top, core = band.low, _CORE_ABOVE * band.last, band.core
    if core is None:
        return _Realized.of(part).norm()
    inside = _Realized.of(SecondOrderModel.of(core.structure, core.ports)).norm()
    inside = replace(inside, stages=(f"core of {core.structure.n}", *inside.stages))
    if inf in (inside.lower_bound, inside.upper_bound):
        return inside
    error = core.error(np.array([BELOW * low, np.clip(inside.peak_omega, BELOW * low, top), ABOVE * band.last, top]))
    if error > _CORE_ERROR:
        lower = inside.lower_bound * max(1.0 - error, 0.0)
        return replace(inside, lower_bound=lower, upper_bound=inf, method="a core that could not be verified")
    upper = max(inside.upper_bound * (1.0 + error), _dissipation_bound(part, top))
    return replace(inside, upper_bound=upper, method=f"{inside.method}; dissipation above {top:.3g} rad/s")


@dataclass(frozen=True)
class _Realized:
    """A small model in state space: over its undamped modes, or without them over its own coordinates.

    The response at its peak comes from its matrices, which is more accurate than any state space.  One whose poles lie too
    ``wide`` apart has no state space that holds them all.
    """

    system: Lti
    respond: Response
    stages: tuple[str, ...]
    wide: bool = False

    @classmethod
    def of(cls, small: SecondOrderModel) -> "_Realized":
        respond, system, form = partial(_response, small), small._modal_form, small.structure.strain_form
        if form is None:
            try:
                undamped_modes(small.structure)
            except ValueError:
                return cls(system, respond, ("given coordinates",))
            return cls(system, respond, ("undamped modes",))
        frequencies = form.own_modes[0]
        moving = frequencies[elastic(frequencies)]
        fastest = max(float(frequencies[-1]), float(np.abs(system.A.diagonal()).max()))
        return cls(system, respond, ("undamped modes",), len(moving) > 0 and fastest > _HELD * moving[0])

    def norm(self, axis: MarginalPoles | None = None) -> NormBounds:
        """Return the norm between its bounds; ``axis`` is what is known of its poles."""
        return replace(matrices_norm(self.system, self.respond, axis), stages=self.stages)


def _norms_of_small(systems: tuple["_Realized", ...]) -> list[NormBounds]:
    """Return the norms of small parts; of one proved to stay below another's norm, the other's bound alone."""
    axes = [marginal_poles(part.system) for part in systems]
    order = sorted(range(len(systems)), key=lambda i: -axes[i].bound)
    first = systems[order[0]].norm(axes[order[0]])
    result = {order[0]: first}
    for i in order[1:]:
        below = axes[i].bound <= first.lower_bound
        bound = NormBounds(0.0, first.upper_bound, first.peak_omega, first.method, systems[i].stages)
        result[i] = bound if below else systems[i].norm(axes[i])
    return [result[i] for i in range(len(systems))]


def _response(small: SecondOrderModel, omega: Array) -> Array:
    seen = np.maximum(omega, beside(np.zeros(1))) if any(small.ports.integrators) else omega
    try:
        return direct_response(small.structure, small.ports, seen)
    except ValueError:  # one of the frequencies is that of an undamped mode, which may not show
        if len(seen) > 1:
            return np.concatenate([_response(small, seen[k : k + 1]) for k in range(len(seen))], axis=2)
    return direct_response(small.structure, small.ports, beside(seen))


def _dissipation_bound(model: SecondOrderModel, omega: float) -> float:
    """Return a bound of the response at all frequencies from ``omega`` on; ``inf`` where there is none."""
    form, ports = model.structure.strain_form, model.ports
    if ports.B[2].any() or any(line.any() for line in ports.L[1:]) or any(e.any() for e in ports.E[1:]):
        return inf
    C, (B, L) = (model.C, (ports.B, ports.L)) if form is None else (form.C, form.seen(ports))
    try:
        half = linalg.cholesky(0.5 * (C + C.T), lower=True)  # gyroscopic terms dissipate nothing
    except linalg.LinAlgError:
        return inf
    weighed = (linalg.solve_triangular(half, columns, lower=True) for columns in (L[0].T, B[0], B[1]))
    reading, *acting = (float(np.linalg.norm(columns, 2)) for columns in weighed)
    return reading * (acting[0] / omega + acting[1]) + float(np.linalg.norm(ports.E[0], 2))
