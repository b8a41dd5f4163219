"""Closed loops of a family and a controller, which may be sampled, or scheduled over one of the family's parameters.

In continuous time a loop is ``E x' = A x + B w``, ``z = C x + D w`` with polynomials of the parameters.  States are
coordinates, velocities, two of each output's filter, and the controller's states.  In a loop with inputs, momenta replace
velocities, so that no derivative of an input appears.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.box.level import LoopPart
from boomctl.analysis.box.polynomials import Cell, Polynomial, poles_of, product_of, sum_of, value_at, within
from boomctl.analysis.box.sampled import sampled_loops, sampled_parts
from boomctl.analysis.box.scheduled import ScheduledController, frozen
from boomctl.analysis.loops import Loop, injected, joined, signals_of
from boomctl.arrays import Array
from boomctl.checks import exactly, instance, known, nonnegative
from boomctl.lti.modal import sides
from boomctl.lti.sampled import time_of_loop
from boomctl.lti.system import Lti, controller_of, lower_lft, rates_of, static
from boomctl.structure.families import Family, Slope
from boomctl.structure.ports import FILTER_DAMPING

if TYPE_CHECKING:
    import control

Sums = defaultdict[tuple[int, ...], Array]
"""Polynomial under summation."""


@dataclass(frozen=True)
class BoxLoops:
    """Closed loops ``u = K y`` over a box of parameters, ``-1 <= delta <= 1``.

    Attributes
    ----------
    family : Family
        The plants.
    controller : Lti or ScheduledController
        ``K``.
    delay : float
        Computation delay of a sampled loop [s].
    alone : sequence of LoopPart
        Parts that cover the box, without inputs of the loop; empty for a sampled loop, whose parts are expensive.
    """

    family: Family
    controller: Lti | ScheduledController
    delay: float
    alone: Sequence[LoopPart]

    @classmethod
    def of(cls, family: Family, controller: control.StateSpace | ScheduledController, delay: float = 0.0) -> BoxLoops:
        """Return the loops.

        Raises
        ------
        TypeError, ValueError
            If a system has an unsupported type, signal names do not match, a control is a displacement, the schedule
            follows no parameter, or the loop cannot have this delay.
        """
        instance("family", family, Family, "AffineFamily or PolynomialFamily")
        late = nonnegative("delay", delay)
        if isinstance(controller, ScheduledController):
            K, one = controller, controller.systems[0]
            if one.dt:
                raise ValueError(f"`controller` must be in continuous time, got a sampling time of {one.dt:g} s.")
            known("parameter that the controller follows", controller.signal, family.names)
        else:
            K = one = controller_of(controller, "StateSpace or ScheduledController", sampled=True).balanced()
        signals_of(one, family.nominal.input_labels, family.nominal.output_labels)
        if one.dt:
            time_of_loop(static(one.D), one, late)  # checks the delay
        elif late:
            raise ValueError(f"`delay` must be 0 with a controller in continuous time, got {exactly(delay)} s.")
        return cls(family, K, late, () if one.dt else [*_continuous(family, K, (), ())])

    def at(self, delta: Array) -> Loop:
        """Return the loop at a point, closed by name."""
        return joined(self.family.at(delta), controller_at(self.family, self.controller, delta), self.delay)

    @cached_property
    def _sampled(self) -> Callable[[Array], Lti]:
        """Function that returns the sampled loop at a point."""
        assert isinstance(self.controller, Lti)
        return sampled_loops(self.family, self.controller, (), (), self.delay)

    def poles(self, delta: Array) -> Array:
        """Return the poles at a point, without the poles of ignorable coordinates."""
        if not self.alone:
            return self._sampled(delta).balanced().poles
        part = min(self.alone, key=lambda item: float(np.abs((delta - item.cell.middle) / item.cell.reach).max()))
        return poles_of(value_at(part.pencils, (delta - part.cell.middle) / part.cell.reach))

    def abscissa(self, delta: Array) -> float:
        """Return the largest real part of the poles at a point [rad/s], or of ``log(z)/dt`` for a sampled loop."""
        return float(rates_of(self.poles(delta), self.controller.dt).real.max())

    def stable(self, delta: Array) -> bool:
        """Return whether the loop is stable at a point."""
        return bool((sides(self.poles(delta), self.controller.dt) < 0).all())

    def parts(self, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> Sequence[LoopPart]:
        """Return the loops between signals, of :meth:`Loop.closed`, in parts that cover the box; without any for stability.

        Raises
        ------
        ValueError
            If a sampled loop changes too fast over the box, or, in continuous time, a signal needs more derivatives.
            Measured outputs may be positions, speeds, or accelerations behind a filter; evaluated ones may not be speeds, and
            must be the same over the box.
        """
        if self.alone:
            return [*_continuous(self.family, self.controller, inputs, outputs)] if outputs else self.alone
        assert isinstance(self.controller, Lti)
        return sampled_parts(self.family, self.controller, inputs, outputs, self.delay)


def _continuous(
    family: Family, K: Lti | ScheduledController, inputs: Sequence[str], outputs: Sequence[str]
) -> Iterator[LoopPart]:
    """Yield the loops in continuous time, one for each interval over which the controller is affine."""
    ports, axis, ends = family.nominal.ports, 0, [-1.0, 1.0]
    acting = [ports.inputs.index(name) for name in K.output_labels]
    read = [ports.outputs.index(name) for name in K.input_labels]
    filtered = np.array([ports.bandwidths[o] is not None for o in read])
    if isinstance(K, ScheduledController):
        axis, filtered = family.names.index(K.signal), np.ones(len(read), bool)
        nodes = [float(family.normalize({K.signal: value})[axis]) for value in K.values]
        ends = np.unique(np.clip([*ends, *nodes], -1.0, 1.0)).tolist()
    for i, name in zip(acting, K.output_labels, strict=True):
        late = [ports.B[1:, :, i], ports.E[1:, read, i], *(change.B[1:, :, i] for _, change in family.coefficients)]
        if ports.moved[i] or ports.E[0, read, i][filtered].any() or any(X.any() for X in late):
            raise ValueError(
                f"`controller` must drive forces, got {name!r}, a displacement or an input with direct feedthrough."
            )
    along = np.eye(family.nparameters)[axis]
    direct = ports.E[0][np.ix_(read, acting)]
    for low, high in pairwise(ends):
        first, last = (_inside(controller_at(family, K, x * along), direct) for x in (low, high))
        pairs = {letter: (getattr(first, letter), getattr(last, letter)) for letter in "ABCD"}
        law = {
            letter: {(): (high * X - low * Y) / (high - low), (axis,): (Y - X) / (high - low)}
            for letter, (X, Y) in pairs.items()
        }
        cell = Cell.whole(family.nparameters)
        cell.middle[axis], cell.reach[axis] = 0.5 * (low + high), 0.5 * (high - low)
        pencils, B, C, D = _closed(family, law, (K.input_labels, K.output_labels), inputs, outputs)
        errors = np.zeros_like(pencils[()][0]), np.zeros_like(B[()])
        yield LoopPart(cell, within(pencils, cell), within(B, cell), C, D, errors)


def controller_at(family: Family, K: Lti | ScheduledController, delta: Array) -> Lti:
    """Return the controller at a point of the box."""
    return frozen(K, family.denormalize(delta)[K.signal]) if isinstance(K, ScheduledController) else K


def _inside(K: Lti, direct: Array) -> Lti:
    """Return a controller in a loop with the plant's feedthrough ``direct``.

    Its inputs are the measurements without the feedthrough of its controls, and signals added to its controls; its outputs
    are the controls.

    Raises
    ------
    ValueError
        If the loop of the plant's and the controller's feedthrough is not well-posed.
    """
    p, m = direct.shape
    none, eye = np.zeros((m, p)), np.eye(m)
    D = np.block([[none, eye, eye], [np.eye(p), direct, direct]])
    return lower_lft(static(D), K)


def _open(family: Family, rows: Sequence[int], forced: Array, driven: bool, more: int) -> tuple[Sums, Sums, Polynomial]:
    """Return ``E``, ``A`` and the rows of outputs ``a + b' + c''`` of the plants, over the states and the loop's inputs.

    ``forced`` is the map from the loop's inputs to the plant's; ``more`` states follow those of the plant and its filters.
    """
    ports, n, m = family.nominal.ports, family.nominal.ncoordinates, forced.shape[1]
    filters = [(j, b) for j, o in enumerate(rows) if (b := ports.bandwidths[o]) is not None]
    positions, rates, size = slice(n), slice(n, 2 * n), 2 * (n + len(filters)) + more
    moving = positions if driven else rates  # whose derivatives the mass matrix multiplies
    E, A = (defaultdict(lambda: np.zeros((size, size + m))) for _ in range(2))
    E[()] = np.eye(size, size + m)
    E[()][moving, moving] = 0.0
    A[()][positions, rates] = np.eye(n)
    lines: dict[tuple[int, ...], Array] = {}
    for power, X in (((), family.nominal), *family.coefficients):
        B, L = (X.B, X.L) if isinstance(X, Slope) else (ports.B, ports.L)
        E[power][moving, moving] += X.M
        A[power][moving, moving] -= X.C
        A[power][rates, positions] -= X.K
        A[power][rates, size:] += B[0] @ forced
        A[power][positions, size:] += B[1] @ forced
        if power and not L.any():
            continue
        line = np.zeros((3, len(rows), size + m))
        line[:, :, positions] = L[:, rows]
        if not driven:  # speeds are states
            line[:2, :, rates], line[1:, :, positions] = L[1:, rows], 0.0
        if not power:
            line[:, :, size:] = ports.E[:, rows] @ forced
        for first, (j, b) in zip(range(2 * n, size - more, 2), filters, strict=True):
            turn, (position, speed, acceleration) = 2.0 * FILTER_DAMPING * b, b**2 * line[:, j]
            A[power][first] += speed - turn * acceleration
            A[power][first + 1] += position - b**2 * acceleration
            line[0, j], line[1:, j] = acceleration, 0.0
            if not power:
                line[0, j, first] = A[()][first, first + 1] = 1.0
                A[()][first : first + 2, first] -= turn, b**2
        lines = sum_of(lines, {power: line})
    return E, A, lines


def _closed(
    family: Family,
    law: Mapping[str, Polynomial],
    signals: tuple[Sequence[str], Sequence[str]],
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> tuple[Polynomial, Polynomial, Array, Array]:
    """Return pencils, ``B``, ``C``, ``D`` of the loop with a control law from measurements and injected signals to controls.

    Raises
    ------
    ValueError
        See :meth:`BoxLoops.parts`.
    """
    ports, n, (measured, controls) = family.nominal.ports, family.nominal.ncoordinates, signals
    acting, read = [ports.inputs.index(name) for name in controls], [ports.outputs.index(name) for name in measured]
    evaluated = [ports.outputs.index(name) for name in outputs if name in ports.outputs]
    rows, k = sorted({*read, *evaluated}), len(law["A"][()])
    labels = (*ports.inputs, *map(injected, (*measured, *controls)))
    entry = np.zeros((len(labels), max(1, len(inputs))))
    entry[[labels.index(name) for name in inputs], range(len(inputs))] = 1.0
    forced, added = np.split(entry, [len(ports.inputs)])
    E, A, lines = _open(family, rows, forced, bool(outputs), k)
    size, wide = E[()].shape
    own, rates, states = slice(size - k, size), slice(n, 2 * n), {(): np.eye(k, wide, size - k)}
    at, padding = [rows.index(o) for o in read], ((0, len(acting)), (0, 0))
    a, b = ({q: np.pad(line[i, at], padding) for q, line in lines.items()} for i in (0, 1))
    a[()][:, size:] += added
    changes = [{q: X.B[0][:, acting]} for q, X in family.coefficients if X.B.any()]
    pushing = sum_of({(): ports.B[0][:, acting]}, *changes)
    sent, late = sum_of(product_of(law["C"], states), product_of(law["D"], a)), product_of(law["D"], b)
    _add(A, own, sum_of(product_of(law["A"], states), product_of(law["B"], a)))
    _add(E, own, product_of(law["B"], b), -1.0)
    _add(A, rates, product_of(pushing, sent))
    _add(E, rates, product_of(pushing, late), -1.0)
    # Evaluated signals: rows of the plant's outputs, and the controller's outputs.
    wanted = outputs or ("",)
    pick = np.array([[float(name == ports.outputs[o]) for o in rows] for name in wanted])
    through = np.array([[float(name == control) for control in controls] for name in wanted])
    through += pick @ ports.E[0][np.ix_(rows, acting)]
    z = sum_of({q: pick @ line[0] for q, line in lines.items()}, product_of({(): through}, sent))
    if any((X.B[2] @ forced).any() for X in (ports, *(change for _, change in family.coefficients))):
        raise ValueError(
            "the equations of motion contain the acceleration of a displacement input: attach the bodies to GROUND, so "
            "that their coordinates are absolute"
        )
    unfit = [
        *(X for line in lines.values() for X in (line[2], line[1, :, size:], pick @ line[1])),
        *(ports.E[0 if ports.bandwidths[o] else 1 :, o, acting] for o in evaluated),
    ]
    if any(X.any() for X in unfit):
        raise ValueError(
            "`outputs` must be positions, or accelerations with a filter (measurements may also be speeds)."
        )
    if any((through @ X).any() for X in late.values()):
        raise ValueError("`controller` must send no speed on at once if its controls are among `outputs`.")
    if any(X.any() for q, X in z.items() if q):
        raise ValueError("`outputs` must not change with the parameters in continuous time; of sampled loops they may.")
    pencils = {q: np.array([E[q], A[q]])[:, :, :size] for q in dict.fromkeys((*E, *A))}

    def alone(i: int) -> bool:
        """Return whether nothing in the loop depends on a state."""
        unit = np.eye(size)[i]
        return all(not X[1, :, i].any() and (X[0, :, i] == (0.0 if q else unit)).all() for q, X in pencils.items())

    states_used = [i for i in range(size) if outputs or i not in family._unfelt or not alone(i)]
    pencils = {q: X[:, states_used][:, :, states_used] for q, X in pencils.items() if not q or X.any()}
    B = {q: X[states_used, size:] for q, X in A.items() if not q or X[:, size:].any()}
    return pencils, B, z[()][:, states_used], z[()][:, size:]


def _add(total: Sums, rows: slice, terms: Polynomial, sign: float = 1.0) -> None:
    for power, X in terms.items():
        total[power][rows] += sign * X
