"""The loops of a family and a controller, which may be scheduled over one of the family's parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.loop_pencil import LoopPencil
from boomctl.analysis.box.prove import StablePart
from boomctl.analysis.box.scheduled import ScheduledController, frozen
from boomctl.analysis.box.zero_exclusion import Cell, Terms, value_at
from boomctl.analysis.loops import Loop, joined, signals_of
from boomctl.arrays import Array
from boomctl.checks import exactly, instance, known, nonnegative
from boomctl.lti.sampled import time_of_loop
from boomctl.lti.system import Lti, controller_of, lower_lft, of
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import FILTER_DAMPING

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Stretch:
    """The part of a box in which a controller is a straight line in one parameter.

    Attributes
    ----------
    low, high : float
        Its ends along that parameter, as ``delta``; infinite where it goes on.
    terms : Terms
        The closed loop in it, a polynomial of all ``delta``.
    """

    low: float
    high: float
    terms: Terms


@dataclass(frozen=True)
class BoxLoops:
    """The closed loop over a box of parameters, ``-1 <= delta <= 1``.

    Attributes
    ----------
    family : Family
        The plants.
    axis : int
        The parameter that the controller follows; 0 where it follows none.
    stretches : tuple of Stretch
        Side by side along that parameter; one where the controller follows none.
    """

    family: Family
    axis: int
    stretches: tuple[Stretch, ...]

    @classmethod
    def of(cls, family: Family, controller: control.StateSpace | ScheduledController) -> BoxLoops:
        """Return the loops ``u = K y``.

        Raises
        ------
        TypeError, ValueError
            Other kinds of system; names that do not meet; controls that impose motion; a schedule over no parameter.
        """
        instance("family", family, Family, "AffineFamily or PolynomialFamily")
        if not isinstance(controller, ScheduledController):
            K = of(controller_at(family, controller, np.zeros(family.nparameters)), any_time=True)
            if K.dt != 0.0:
                raise ValueError(
                    f"`controller` must be in continuous time, got a sampling time of {exactly(K.dt)} s. Of sampled loops "
                    "boomctl.robust_stability and boomctl.worst_case have proofs."
                )
            signals_of(K, family.nominal.input_labels, family.nominal.output_labels)
            family, K = without_feedthrough(family, K)
            return cls(family, 0, (Stretch(-np.inf, np.inf, _terms(family, K, None, 0)),))
        if controller.dt != 0.0:
            raise ValueError(f"`controller` must be in continuous time, got a sampling time of {controller.dt:g} s.")
        known("parameter that the controller follows", controller.signal, family.names)
        signals_of(controller.systems[0], family.nominal.input_labels, family.nominal.output_labels)
        axis = family.names.index(controller.signal)
        middle, width = 0.5 * (family.low + family.high)[axis], 0.5 * (family.high - family.low)[axis]
        places = (controller.values - middle) / width
        first, *_, last = controller.systems
        result = [Stretch(-np.inf, float(places[0]), _terms(family, first, None, axis))]
        for k, (low, high) in enumerate(pairwise(places.tolist())):
            a, b = controller.systems[k : k + 2]
            slope = _combined((b, a), (1.0 / (high - low), -1.0 / (high - low)))
            start = _combined((a, slope), (1.0, -low))
            result.append(Stretch(float(low), float(high), _terms(family, start, slope, axis)))
        result.append(Stretch(float(places[-1]), np.inf, _terms(family, last, None, axis)))
        return cls(family, axis, tuple(result))

    def at(self, delta: Array) -> LoopPencil:
        """Return the loop at a point."""
        here = next(item for item in self.stretches if delta[self.axis] <= item.high)
        return value_at(here.terms, delta)

    def abscissa(self, delta: Array) -> float:
        """Return the largest real part of the poles at a point [rad/s]."""
        return self.at(delta).abscissa

    def stable(self, delta: Array) -> bool:
        """Return whether the loop is stable at a point."""
        return self.at(delta).stable

    def terms(self, cell: Cell) -> Terms:
        """Return the loop over a cell that lies in one stretch."""
        return next(item for item in self.stretches if cell.middle[self.axis] <= item.high).terms

    def parts(self, factor: float) -> list[StablePart]:
        """Return the box, enlarged by a factor, as one part a stretch."""
        result = []
        for item in self.stretches:
            low, high = max(item.low, -factor), min(item.high, factor)
            if low < high:
                middle, reach = np.zeros(self.family.nparameters), np.full(self.family.nparameters, factor)
                middle[self.axis], reach[self.axis] = 0.5 * (low + high), 0.5 * (high - low)
                result.append(StablePart.of(item.terms, Cell(middle, reach)))
        return result


def checked_controller(
    family: Family, controller: control.StateSpace | ScheduledController, delay: float
) -> tuple[Lti | None, float]:
    """Return a controller, None if it follows a parameter, and its delay [s], refused where they make no sampled loop."""
    instance("family", family, Family, "AffineFamily or PolynomialFamily")
    late = nonnegative("delay", delay)
    scheduled = isinstance(controller, ScheduledController)
    K = None if scheduled else controller_of(controller, "StateSpace or ScheduledController", sampled=True)
    if K is not None and K.dt != 0.0:
        signals_of(K, family.nominal.input_labels, family.nominal.output_labels)
        time_of_loop(Lti(K.A, K.B, K.C, K.D), K, late)  # what a delay may be
    elif late:
        raise ValueError(f"`delay` must be 0 with a controller in continuous time, got {exactly(delay)} s.")
    return K, late


def controller_at(
    family: Family, controller: control.StateSpace | ScheduledController, delta: Array
) -> control.StateSpace | Lti:
    """Return a controller as it is at a point of the box, in the states that it has in `BoxLoops`."""
    if not isinstance(controller, ScheduledController):
        return controller_of(controller, "StateSpace or ScheduledController", any_time=True).balanced()
    return frozen(controller, family.denormalize(delta)[controller.signal])


def joined_at(family: Family, controller: control.StateSpace | ScheduledController, delay: float, delta: Array) -> Loop:
    """Return the closed loop at a point of the box."""
    return joined(family.at(delta), controller_at(family, controller, delta), delay)


def without_feedthrough(family: Family, K: Lti) -> tuple[Family, Lti]:
    """Return plants without feedthrough from the controls to the measurements, and the controller that closes the same loops.

    Feedthrough is the same over the family: with ``y = y0 + E u`` the law ``u = K y`` is one between ``y0`` and ``u``.

    Raises
    ------
    ValueError
        The loop of the feedthrough and the controller's is not well-posed.
    """
    ports = family.nominal.ports
    acting = [ports.inputs.index(name) for name in K.output_labels]
    read = [ports.outputs.index(name) for name in K.input_labels]
    E = ports.E[0][np.ix_(read, acting)]
    if not E.any() or any(ports.bandwidths[o] is not None for o in read):
        return family, K
    p, m = E.shape
    direct = np.block([[np.zeros((m, p)), np.eye(m)], [np.eye(p), E]])
    signals = (*K.input_labels, *K.output_labels), (*K.output_labels, *K.input_labels)
    closed = lower_lft(Lti(np.zeros((0, 0)), np.zeros((0, p + m)), np.zeros((m + p, 0)), direct, *signals), K)
    without = ports.E.copy()
    without[0][np.ix_(read, acting)] = 0.0
    center = SecondOrderModel.of(family.nominal.structure, replace(ports, E=without))
    return replace(family, nominal=center), closed  # type: ignore[type-var]


def _combined(systems: tuple[Lti, Lti], shares: tuple[float, float]) -> Lti:
    A, B, C, D = (sum(w * getattr(item, x) for w, item in zip(shares, systems, strict=True)) for x in "ABCD")
    first: Any = systems[0]
    return Lti(np.asarray(A), np.asarray(B), np.asarray(C), np.asarray(D), first.input_labels, first.output_labels)


def _terms(family: Family, K: Lti, slope: Lti | None, axis: int) -> Terms:
    """Return the loop with ``K + delta slope``, ``delta`` that of one parameter, as a polynomial of the parameters.

    States are coordinates, velocities, two of each output's filter, and those of the controller.

    Raises
    ------
    ValueError
        An input that imposes motion, or that an output feels at once.
    """
    center = family.nominal.select(K.output_labels, K.input_labels)
    acting = [family.nominal.input_labels.index(name) for name in K.output_labels]
    read = [family.nominal.output_labels.index(name) for name in K.input_labels]
    ports, n = center.ports, center.ncoordinates
    for i, name in enumerate(K.output_labels):
        late = [ports.B[1:, :, i], ports.E[:, :, i], *(change.B[1:, :, acting[i]] for _, change in family.coefficients)]
        if ports.moved[i] or any(X.any() for X in late):
            raise ValueError(
                f"`controller` must drive forces, got {name!r}, an input that imposes motion or is felt at once."
            )
    filtered = [(o, b, 2 * (n + j)) for j, (o, b) in enumerate((o, b) for o, b in enumerate(ports.bandwidths) if b)]
    size = 2 * n + 2 * len(filtered) + len(K.A)
    places, speeds, own = slice(n), slice(n, 2 * n), slice(size - len(K.A), size)
    result: dict[tuple[int, ...], LoopPencil] = {}

    def part(*powers: tuple[int, ...]) -> LoopPencil:
        power = tuple(sorted(sum(powers, ())))
        return result.setdefault(power, LoopPencil(np.zeros((size, size)), np.zeros((size, size))))

    here = part(())
    np.fill_diagonal(here.E, 1.0)
    here.E[speeds, speeds], here.A[places, speeds] = 0.0, np.eye(n)
    for _, b, first in filtered:
        here.A[first, first + 1], here.A[first + 1, first] = 1.0, -(b**2)
        here.A[first + 1, first + 1] = -2.0 * FILTER_DAMPING * b
    for power, X in (((), center), *family.coefficients):
        part(power).E[speeds, speeds] += X.M
        part(power).A[speeds, places] -= X.K
        part(power).A[speeds, speeds] -= X.C
    columns = {(): ports.B[0]} | {
        power: X.B[0][:, acting] for power, X in family.coefficients if X.B[:, :, acting].any()
    }
    lines = {(): ports.L} | {power: X.L[:, read] for power, X in family.coefficients if X.L.any()}
    controllers = {(): K} if slope is None else {(): K, (axis,): slope}
    for power, law in controllers.items():
        part(power).A[own, own] += law.A
        for p, B in columns.items():
            part(power, p).A[speeds, own] += B @ law.C
    for q, L in lines.items():
        reading, rate = np.zeros((len(read), size)), np.zeros((len(read), size))
        reading[:, places], reading[:, speeds], rate[:, speeds] = L
        for o, b, first in filtered:
            part(q).A[first + 1] += b**2 * reading[o]
            part(q).E[first + 1] -= b**2 * rate[o]
            reading[o], rate[o] = 0.0, 0.0
            reading[o, first] = float(not q)
        for power, law in controllers.items():
            part(power, q).A[own] += law.B @ reading
            part(power, q).E[own] -= law.B @ rate
            for p, B in columns.items():
                part(power, p, q).A[speeds] += B @ law.D @ reading
                part(power, p, q).E[speeds] -= B @ law.D @ rate
    return without(result, family._unfelt)


def without(terms: Terms, positions: tuple[int, ...]) -> Terms:
    """Return the loop without those positions that nothing in it feels."""
    size = len(terms[()].E)
    unit = np.eye(size)

    def alone(i: int) -> bool:
        return all(not x.A[:, i].any() and (x.E[:, i] == (0.0 if p else unit[i])).all() for p, x in terms.items())

    kept = [i for i in range(size) if i not in positions or not alone(i)]
    if len(kept) == size:
        return terms
    return {power: LoopPencil(x.E[np.ix_(kept, kept)], x.A[np.ix_(kept, kept)]) for power, x in terms.items()}
