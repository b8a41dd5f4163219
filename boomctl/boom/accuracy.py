"""Selection of the coarsest mesh of the boom that meets a requested accuracy, with the exact beam as reference."""

from __future__ import annotations

import warnings
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.exact import exact_boom, fine_mesh
from boomctl.boom.model import boom_discretization, boom_model
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import exactly, within
from boomctl.exceptions import AccuracyWarning
from boomctl.lti.frequency import DRAWN, resonance_grid, singular_values
from boomctl.lti.modal import side_of_axis
from boomctl.printing import compact
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.direct import respond
from boomctl.structure.response.poles import damped_poles

# Accuracies that can be requested: rounding of slow strokes limits the lower one.
_ACCURACIES = (1e-7, 1.0)
_SLOWEST = 1e-3  # Lowest frequency compared, in bands: slower motion is as quasi-static.
_BEYOND = 1.2  # Bands up to which resonances are looked for: one just outside contributes within.
_POINTS = 400  # Frequencies compared in addition to those at resonances: enough for the dips between these.
_ELEMENTS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
_ORDERS = range(3, 15)  # Rounding errors end the gain of higher orders.
# Stems of the signals of one magnitude: errors are relative to the response between two of these groups.
_OUTPUTS, _INPUTS = (("tip", "nozzle"), ("stroke",), ("cradle",)), (("actuator",), ("suspension", "cradle"))
_SAFETY = 0.8  # Fraction of the accuracy that a mesh may use: errors between the frequencies compared are larger.


@dataclass(frozen=True, repr=False)
class MeshChoice:
    """A mesh selected for its accuracy, with the tested candidates.

    Attributes
    ----------
    accuracy, max_frequency_hz : float
        Requested accuracy and frequency limit [Hz].
    elements, order : int
        Selected number of ``"high-order"`` elements, and their polynomial order.
    error : float
        Largest computed relative error of the response up to ``max_frequency_hz``, relative to the exact beam.
    tried : tuple of (int, int, float)
        Elements, order and error of each tested mesh, in the order of the tests.
    """

    accuracy: float
    max_frequency_hz: float
    elements: int
    order: int
    error: float
    tried: tuple[tuple[int, int, float], ...]

    __repr__ = compact

    def __str__(self) -> str:
        error = f"error {self.error:.1e} up to {self.max_frequency_hz:g} Hz, {self.accuracy:.3g} requested"
        return f"{self.elements} high-order elements of order {self.order}: {error}"


@lru_cache(maxsize=16)
def chosen_mesh(
    p: BoomParameters, accuracy: float, max_frequency_hz: float, excitation: str, nozzles: tuple[float, ...] = ()
) -> MeshChoice:
    """Select the first number of elements that meets an accuracy, and the lowest order that does.

    The error at a frequency is the largest singular value of the error of the response over that of the exact response.
    It is computed separately for each group of outputs (tips, strokes, slip) and inputs (actuator motions, forces).

    Raises
    ------
    ValueError
        If a value is out of range, if the exact response is infinite at a resonance, or if no mesh meets the accuracy.
    """
    within("accuracy", accuracy, *_ACCURACIES)
    imposed = "force" if excitation == "force" else "displacement"
    error = _error_of(p, max_frequency_hz, imposed, nozzles)
    errors: dict[tuple[int, int], float] = {}

    def reached(elements: int, order: int) -> bool:
        mesh = boom_discretization(p, "high-order", elements, order)
        errors[elements, order] = error(boom_model(p, mesh, imposed, nozzles=nozzles))
        return errors[elements, order] <= _SAFETY * accuracy

    elements = next((count for count in _ELEMENTS if reached(count, _ORDERS[-1])), None)
    if elements is None:
        best = min(errors, key=errors.__getitem__)
        raise ValueError(
            f"`accuracy` must be at least {1.3 * errors[best]:.1g} with max_frequency_hz={exactly(max_frequency_hz)}, got"
            f" {exactly(accuracy)}. The most accurate mesh has {best[0]} elements of order {best[1]}."
        )
    order = _ORDERS[bisect_left(_ORDERS[:-1], True, key=lambda order: reached(elements, order))]
    candidates = tuple((*mesh, value) for mesh, value in errors.items())
    return MeshChoice(accuracy, max_frequency_hz, elements, order, errors[elements, order], candidates)


def _error_of(
    p: BoomParameters, max_frequency_hz: float, imposed: str, nozzles: tuple[float, ...]
) -> Callable[[SecondOrderModel], float]:
    """Return the function from a model to its error; the exact response is computed once."""
    exact, top = exact_boom(p, imposed, nozzles), 2.0 * np.pi * max_frequency_hz
    count = int(exact.count_below(np.array([_BEYOND * top]))[0]) + 1
    poles = damped_poles(boom_model(p, fine_mesh(p, count), imposed).structure, count)
    undamped = poles[(poles.imag <= top) & (side_of_axis(poles) == 0)]
    if len(undamped):
        raise ValueError(
            f"`max_frequency_hz` must be below the undamped resonance at {undamped[0].imag / (2.0 * np.pi):.4g} Hz, where the"
            f" response is infinite, got {exactly(max_frequency_hz)}."
        )
    ports = exact.ports
    rows = [[k for k, name in enumerate(ports.outputs) if name.startswith(stems)] for stems in _OUTPUTS]
    columns = [[k for k, name in enumerate(ports.inputs) if name.startswith(stems)] for stems in _INPUTS]
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
