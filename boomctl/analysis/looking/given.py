"""What is looked at: a system, or the system that a result is about."""

from typing import Any

from boomctl.analysis.sigma import Signals, between_signals
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel

EXPECTED = "SecondOrderModel, StateSpace, TransferFunction, or a result with a closed loop or a reduced system"


def looked_at(given: object) -> Any:
    """Return the system that is meant: of a design its closed loop, of a reduction the reduced system; all else as it is."""
    for part in ("_closed_loop", "_reduced"):
        if isinstance(result := getattr(given, part, None), Lti | SecondOrderModel):
            return result
    return given


def matrices(given: object, inputs: Signals = None, outputs: Signals = None) -> Lti:
    """Return the matrices of what is looked at, between the signals named: of a boom by default actuators and tips.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown names; no inputs or no outputs; discrete time that does not say its sampling time.
    """
    result = between_signals(looked_at(given), inputs, outputs, EXPECTED)
    return result if isinstance(result, Lti) else of(result).balanced()
