"""Signals in units of their own: what counts as one of each, so that a design weighs like with like."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import finite_array, known, mapping, positive
from boomctl.lti.system import Lti, controller_of, of

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


def in_units(system: "control.StateSpace | SecondOrderModel", units: Mapping[str, float]) -> "control.StateSpace":
    """Return a system whose signals count in units of their own, such as millimetres; names stay.

    A synthesis weighs numbers that are all near one better than metres beside newtons.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        The system, signals named.
    units : mapping from signal to float
        For each signal what counts as one, in the system's own units: 0.05 for a stroke of 50 mm.  Signals left out keep
        theirs.

    Returns
    -------
    control.StateSpace
        Inputs are multiplied by their unit, outputs divided by theirs.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; a unit that is not a number above zero or of an unknown signal.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> spring = control.ss([[-1.0]], [[1.0]], [[0.001]], 0.0, inputs="force", outputs="place")  # 1 mm/N
    >>> scaled = bc.in_units(spring, {"force": 100.0, "place": 0.001})  # 100 N, 1 mm
    >>> float(abs(scaled.dcgain()).round(3))
    100.0
    """
    plain = of(system, any_time=True)
    _check(units)
    for name in units:
        known("signal in units", name, (*plain.inputs, *plain.outputs))
    scaled = _scaled(plain, _sizes(units, plain.inputs), _inverse(units, plain.outputs))
    return scaled.statespace(getattr(system, "name", "plant"))


def from_units(controller: "control.StateSpace", units: Mapping[str, float]) -> "control.StateSpace":
    """Return the controller in SI units that was designed for a plant made by :func:`in_units`.

    Parameters
    ----------
    controller : control.StateSpace
        ``u = K y`` for the plant in units: its inputs are outputs of that plant, its outputs inputs.
    units : mapping from signal to float
        As given to :func:`in_units`; signals that the controller does not know are left alone.

    Returns
    -------
    control.StateSpace
        The same controller, from SI units to SI units.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, entries that are not finite; a unit that is not a number above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> gain = control.ss([], [], [], [[-2.0]], inputs="place", outputs="force")  # of 1 mm, in 100 N
    >>> bc.from_units(gain, {"force": 100.0, "place": 0.001}).D.round(1)  # N/m
    array([[-200000.]])
    """
    plain = controller_of(controller, any_time=True)
    _check(units)
    return _scaled(plain, _inverse(units, plain.inputs), _sizes(units, plain.outputs)).statespace(controller.name)


def _check(units: Mapping[str, float]) -> None:
    for name, value in mapping("units", units, "signals to what counts as one").items():
        positive(f"units[{name!r}]", value)


def _sizes(units: Mapping[str, float], labels: Sequence[str]) -> Array:
    return np.array([float(units.get(label, 1.0)) for label in labels])


def _inverse(units: Mapping[str, float], labels: Sequence[str]) -> Array:
    with np.errstate(over="ignore"):
        return 1.0 / _sizes(units, labels)


def _scaled(system: Lti, entry: Array, leave: Array) -> Lti:
    with np.errstate(over="ignore", invalid="ignore"):
        B, C, D = system.B * entry, leave[:, None] * system.C, leave[:, None] * system.D * entry
    for name, matrix in (("B", B), ("C", C), ("D", D)):
        finite_array(f"{name} in these units", matrix)
    return replace(system, B=B, C=C, D=D)
