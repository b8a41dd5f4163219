"""What is looked at: a system, or the system that a result is about."""

from collections.abc import Sequence
from typing import Any

from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel

EXPECTED = "a SecondOrderModel, StateSpace, TransferFunction, or a result with a closed loop or a reduced system"


def looked_at(given: object) -> Any:
    """Return the system that is meant: of a design its closed loop, of a reduction the reduced system; all else as it is."""
    for part in ("_closed_loop", "_reduced"):
        if isinstance(result := getattr(given, part, None), Lti | SecondOrderModel):
            return result
    return given


def matrices(
    given: object,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    what: str = "system",
) -> Lti:
    """Return the matrices of what is looked at, between the signals named: of a boom by default actuators and tips.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown names; no inputs or no outputs; discrete time that does not say its sampling time.
    """
    system = looked_at(given)
    if isinstance(system, SecondOrderModel):
        result = of(system.between(inputs, outputs))
    else:
        result = of(system, what, f"SecondOrderModel, {EXPECTED.removeprefix('a SecondOrderModel, ')}", sampled=True)
        result = result.select(inputs, outputs)
    for kind, there in (("inputs", result.input_labels), ("outputs", result.output_labels)):
        if not there:
            raise ValueError(f"{what}: expected a system with {kind}, got none")
    return result.balanced()
