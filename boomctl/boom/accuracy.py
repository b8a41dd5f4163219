"""The coarsest mesh of the boom whose response is as exact as asked for, up to a frequency: tried against the exact beam."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.exact import exact_boom, fine_mesh
from boomctl.boom.model import boom_discretization, boom_model
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import exactly
from boomctl.exceptions import AccuracyWarning
from boomctl.lti.frequency import DRAWN, resonance_grid, singular_values
from boomctl.lti.modal import side_of_axis
from boomctl.printing import compact
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.direct import respond
from boomctl.structure.response.poles import damped_poles

# Accuracies that can be requested: rounding of slow strokes limits the lower one.
ACCURACIES = (1e-7, 1.0)
_SLOWEST = 1e-3  # Lowest frequency compared, in bands: slower motion is as quasi-static.
_BEYOND = 1.2  # Bands up to which resonances are looked for: one just outside contributes within.
_POINTS = 400  # Frequencies compared in addition to those at resonances: enough for the dips between these.
_ELEMENTS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
_ORDERS = (3, 14)  # Of the elements: lowest, and where rounding ends what a higher one gains.
_SAFETY = 0.8  # Fraction of the accuracy that a mesh may use: errors between the frequencies compared are larger.


@dataclass(frozen=True, repr=False)
class MeshChoice:
    """A mesh that was chosen for its accuracy, and what was tried.

    Attributes
    ----------
    accuracy, max_frequency_hz : float
        What was asked for.
    elements, order : int
        What was chosen: elements of ``"high-order"``, and their polynomial order.
    error : float
        The largest relative error of the response up to ``max_frequency_hz`` that was found, against the exact beam.
    tried : tuple of (int, int, float)
        Elements, order and error of each mesh that was tried, in turn.
    """

    accuracy: float
    max_frequency_hz: float
    elements: int
    order: int
    error: float
    tried: tuple[tuple[int, int, float], ...]

    __repr__ = compact

    def __str__(self) -> str:
        return (
            f"{self.elements} high-order elements of order {self.order}: error {self.error:.1e} up to "
            f"{self.max_frequency_hz:g} Hz, "
            f"{self.accuracy:.3g} asked for"
        )


@lru_cache(maxsize=16)
def chosen_mesh(
    p: BoomParameters, accuracy: float, max_frequency_hz: float, excitation: str, nozzles: tuple[float, ...] = ()
) -> MeshChoice:
    """Return the first number of elements that reaches an accuracy, and the lowest order that does.

    The error at a frequency is the largest singular value of the error of the response over that of the exact response:
    the largest such, of the motions of tips, strokes and slip, to motions of actuators and to forces, each by itself.

    Raises
    ------
    ValueError
        Values out of range; the exact response is not finite at a resonance, or no mesh is as exact as asked for.
    """
    if not ACCURACIES[0] <= accuracy <= ACCURACIES[1]:
        raise ValueError(f"accuracy = {exactly(accuracy)}: expected {ACCURACIES[0]:g} to {ACCURACIES[1]:g}")
    imposed = "force" if excitation == "force" else "displacement"
    error = _error_of(p, max_frequency_hz, imposed, nozzles)
    tried: list[tuple[int, int, float]] = []

    def reached(elements: int, order: int) -> bool:
        mesh = boom_discretization(p, "high-order", elements, order)
        tried.append((elements, order, error(boom_model(p, mesh, imposed, nozzles=nozzles))))
        return tried[-1][2] <= _SAFETY * accuracy

    for elements in _ELEMENTS:
        if not reached(elements, _ORDERS[1]):
            continue
        low, high = _ORDERS[0] - 1, _ORDERS[1]  # not enough, and enough
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if reached(elements, middle) else (middle, high)
        result = next(item for item in tried if item[:2] == (elements, high))
        return MeshChoice(accuracy, max_frequency_hz, *result, tuple(tried))
    best = min(tried, key=lambda each: each[2])
    raise ValueError(
        f"accuracy = {exactly(accuracy)}: expected at least {1.3 * best[2]:.1g} with max_frequency_hz = "
        f"{exactly(max_frequency_hz)}; {best[0]} "
        f"elements of order {best[1]} come as near as any"
    )


def _error_of(
    p: BoomParameters, max_frequency_hz: float, imposed: str, nozzles: tuple[float, ...]
) -> Callable[[SecondOrderModel], float]:
    """Return the function from a model to its error; the exact response is computed once."""
    exact, top = exact_boom(p, imposed, nozzles), 2.0 * np.pi * max_frequency_hz
    count = int(exact.count_below(np.array([_BEYOND * top]))[0]) + 1
    poles = damped_poles(boom_model(p, fine_mesh(p, count), imposed).structure, count)
    within = poles[poles.imag <= top]
    undamped = within[side_of_axis(within) == 0]
    if len(undamped):
        raise ValueError(
            f"accuracy: the exact response is infinite at {undamped[0].imag / (2.0 * np.pi):.4g} Hz, where nothing damps it;"
            f" expected damping, or a band below it"
        )
    ports = exact.ports
    rows = _groups(ports.outputs, ("tip", "nozzle"), ("stroke",), ("cradle",))
    columns = _groups(ports.inputs, ("actuator",), ("suspension", "cradle"))
    blocks = [np.ix_(i, j) for i in rows for j in columns]

    def sizes(response: Array) -> Array:
        return np.array([singular_values(response[at])[0] for at in blocks])

    omega = resonance_grid(poles, _SLOWEST * top, top, points=_POINTS, places=DRAWN)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)  # Of 1e-9, far below the accuracies above.
        wanted = exact.response(omega, ports.inputs, ports.outputs)
    allowed = sizes(wanted)

    def error(model: SecondOrderModel) -> float:
        result = respond(model.structure, model.ports, omega, available=model.ports)
        return float((sizes(result - wanted) / allowed).max())

    return error


def _groups(names: tuple[str, ...], *stems: tuple[str, ...]) -> list[list[int]]:
    """Return the places of the signals that begin with each of the stems."""
    return [[k for k, name in enumerate(names) if name.startswith(stem)] for stem in stems]
