"""The loops of a family and a controller, which may be scheduled over one of the family's parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.loop_pencil import LoopPencil, closed_pencil
from boomctl.analysis.box.prove import StablePart
from boomctl.analysis.box.zero_exclusion import Cell, Terms, value_at
from boomctl.analysis.loops import Loop, joined, signals_of
from boomctl.arrays import Array
from boomctl.checks import exactly, instance, known, nonnegative
from boomctl.lti.controllers.scheduled import ScheduledController, frozen
from boomctl.lti.sampled import time_of_loop
from boomctl.lti.system import Lti, controller_of, lower_lft, of
from boomctl.structure.families import Family
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel

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
                    f"controller: expected continuous time, got a sampling time of {exactly(K.dt)} s; of sampled loops "
                    "boomctl.robust_stability and boomctl.worst_case have proofs"
                )
            signals_of(K, family.nominal.input_labels, family.nominal.output_labels)
            family, K = without_feedthrough(family, K)
            return cls(family, 0, (Stretch(-np.inf, np.inf, _terms(family, K, None, 0)),))
        if controller.dt != 0.0:
            raise ValueError(f"controller: expected continuous time, got a sampling time of {controller.dt:g} s")
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
        raise ValueError(f"delay = {exactly(delay)}: expected 0 with a controller in continuous time")
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
    """Return the loop with ``K + delta slope``, ``delta`` that of one parameter, as a polynomial of the parameters."""
    center = family.nominal.select(K.output_labels, K.input_labels)
    acting = [family.nominal.input_labels.index(name) for name in K.output_labels]
    read = [family.nominal.output_labels.index(name) for name in K.input_labels]
    empty = np.zeros((center.ncoordinates, center.ncoordinates))
    bare = Structure.of(empty, empty, empty, center.coordinates)
    unforced, unread = np.zeros_like(center.ports.B), np.zeros_like(center.ports.L)

    def pencil(B: Array, L: Array, structure: Structure = bare) -> LoopPencil:
        return closed_pencil(SecondOrderModel.of(structure, replace(center.ports, B=B, L=L)), K)

    result: dict[tuple[int, ...], LoopPencil] = {(): closed_pencil(center, K)}

    def add(power: tuple[int, ...], *parts: LoopPencil) -> None:
        """Add one pencil less others."""
        more = parts[0]
        for part in parts[1:]:
            more = LoopPencil(more.E - part.E, more.A - part.A)
        before = result.get(power := tuple(sorted(power)))
        result[power] = more if before is None else LoopPencil(before.E + more.E, before.A + more.A)

    B0, L0, changes = center.ports.B, center.ports.L, family._terms
    rest = pencil(unforced, unread)
    columns = {power: change.B[:, :, acting] for power, change in changes if change.B[:, :, acting].any()}
    lines = {power: change.L[:, read] for power, change in changes if change.L.any() and change.L[:, read].any()}
    if slope is not None and (columns or lines):
        raise ValueError(
            "controller: expected no schedule over a family in which the controls act otherwise from point to point, or the"
            " outputs read otherwise"
        )
    for power, change in changes:
        B = columns.get(power, unforced)
        moved = Structure.of(change.M, change.C, change.K, center.coordinates)
        add(power, pencil(B, L0, moved), pencil(unforced, L0))
        if power in lines:
            add(power, pencil(B0, lines[power]), pencil(B0, unread))
    for (p, B), (q, L) in product(columns.items(), lines.items()):  # what acts times what is read
        both = pencil(B, L)
        acted, seen = pencil(B, unread), pencil(unforced, L)
        add((*p, *q), LoopPencil(both.E + rest.E, both.A + rest.A), acted, seen)
    if slope is not None:
        plain = SecondOrderModel.of(bare, center.ports)
        add((axis,), closed_pencil(plain, slope), closed_pencil(plain, _combined((slope, slope), (1.0, -1.0))))
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
