"""What a design of a suspension hands over to be judged."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from boomctl.boom import BoomParameters

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class SuspensionDesign:
    """A horizontal suspension: passive parts and, if it is an active one, its controller.

    Attributes
    ----------
    name, title : str
        In one word, and in a line.
    parameters : BoomParameters
        The machine, passive parts of the suspension included.
    controller : control.StateSpace or None
        ``u = K y`` in SI units; inputs named as outputs of the machine (``stroke_left``, ``tip_left_acceleration``,
        ...), outputs ``suspension_left``, ``suspension_right``.
    plant : control.StateSpace or None
        A machine of its own where the controller reads what :func:`suspension_model` does not offer, such as states.
    facts : mapping from str to str
        What synthesis and reduction say of themselves: gamma and bounds, errors, orders.
    weights : mapping from str to control.StateSpace
        Weights of the design, to be drawn over frequency.
    notes : tuple of str
        What a reader should know.
    """

    name: str
    title: str
    parameters: BoomParameters = field(default_factory=BoomParameters)
    controller: "control.StateSpace | None" = None
    plant: "control.StateSpace | None" = None
    facts: Mapping[str, str] = field(default_factory=dict)
    weights: "Mapping[str, control.StateSpace]" = field(default_factory=dict)
    notes: tuple[str, ...] = ()
