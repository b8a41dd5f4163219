"""Conversion of a system or a result to the system to evaluate."""

from typing import Any

from boomctl.analysis.sigma import Signals, between_signals
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel

EXPECTED = "SecondOrderModel, StateSpace, TransferFunction, or a result with a closed loop or a reduced system"


def looked_at(source: object) -> Any:
    """Return the closed loop of a design, the reduced system of a reduction, or any other object unchanged."""
    for part in ("_closed_loop", "_reduced"):
        if isinstance(result := getattr(source, part, None), Lti | SecondOrderModel):
            return result
    return source


def matrices(source: object, inputs: Signals = None, outputs: Signals = None) -> Lti:
    """Return the balanced matrices of a system or a result between signals; by default a boom's actuators and tips.

    Raises
    ------
    TypeError, ValueError
        If the system has an unsupported type, no inputs, no outputs or an unspecified sampling time, or a name is unknown.
    """
    result = between_signals(looked_at(source), inputs, outputs, EXPECTED)
    return result if isinstance(result, Lti) else of(result).balanced()
