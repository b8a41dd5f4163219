"""A linear plant and its exact motion over a step.

A large structure is projected onto its lowest undamped modes and static responses of the others.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.hold import changing, linear_hold, motion_coordinates, zero_order_hold
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modal_form import in_modes, user_state_space
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.poles import damper_forces, with_statics

if TYPE_CHECKING:
    import control

_MODES = 60  # Most undamped modes of a structure: five times the number in the band of a suspension.


@dataclass(frozen=True)
class Step:
    """Exact motion over one step: ``x+ = Phi x + before u_old + after u_new + first d + last d+``.

    ``u`` is held and changes once within the step; ``d`` is interpolated linearly from ``d`` to ``d+``.
    """

    h: float
    Phi: Array
    before: Array
    after: Array
    first: Array
    last: Array

    @property
    def held(self) -> Array:
        """Effect on the states of an input held over the full step."""
        return self.before + self.after


@dataclass(frozen=True, eq=False)
class ModalPlant(Lti):
    """Linear plant and its exact motion over a step, in coordinates ``z = from_state x`` of its states.

    ``state_labels`` are the names of the states before a structure is projected onto its modes, for messages about a
    loop that reads one of them.  ``units`` are the known units of the signals.
    """

    from_state: Array = field(kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    @classmethod
    def of(cls, system: Lti) -> "ModalPlant":
        """Return the plant of a state space."""
        form, to_form = motion_coordinates(system)
        named = (system.input_labels, system.output_labels, system.state_labels)
        return cls(form.A, form.B, form.C, form.D, *named, scales=system.scales, from_state=to_form)

    def hold(self, duration: float, inputs: Array | list[int]) -> tuple[Array, Array]:
        """Return the maps of the states and of some inputs, held for ``duration`` [s], to the states at its end."""
        return zero_order_hold(self.A, self.B[:, inputs], duration)

    def step(self, h: float, switch: float = 0.0) -> Step:
        """Return the motion over a step of ``h`` [s] in which the controls change ``switch`` [s] after its beginning."""
        Phi, whole, ramp = linear_hold(self.A, self.B, h)
        before, after = changing(self.A, self.B, whole, h, np.full(self.B.shape[1], switch))
        return Step(h=h, Phi=Phi, before=before, after=after, first=whole - ramp, last=ramp)


def modal_plant(
    system: "control.StateSpace | control.TransferFunction | SecondOrderModel",
) -> ModalPlant:
    """Return the plant of a system.

    A ``SecondOrderModel`` of many coordinates is projected onto its lowest undamped modes and the static responses of
    the others to its inputs and dampers.

    Raises
    ------
    TypeError, ValueError
        If the system has the wrong type, is in discrete time, is not finite, or a name is used twice.
    """
    if isinstance(system, SecondOrderModel):
        structure, ports = system.structure, system.ports
        names = *(f"mode{k + 1}" for k in range(system.ncoordinates)), *structure.coordinates
        states = tuple(f"{name}.{part}" for name in names for part in ("x1", "x2"))
        small = system.ncoordinates <= _MODES
        linear = (
            user_state_space(structure, ports, None) if small else in_modes(structure, ports, *basis(system, _MODES))
        )
        return replace(ModalPlant.of(linear), state_labels=states, units=system.units)
    return ModalPlant.of(of(system, "plant"))


def basis(model: SecondOrderModel, modes: int, order: int = 1) -> tuple[Array, Array]:
    """Return frequencies and shapes onto which a structure is projected: modes :func:`with_statics`, the highest first.

    Eigenvalue solvers are accurate for the last entries of a graded matrix.  Matrices without real modes are not projected.
    """
    try:
        frequencies, V = undamped_modes(model.structure, modes)
        frequencies, V = with_statics(model.structure, frequencies, V, _loads(model, V), order)
    except ValueError:
        return np.ones(model.ncoordinates), np.eye(model.ncoordinates)
    return frequencies[::-1], V[:, ::-1]


def _loads(model: SecondOrderModel, shapes: Array) -> Array:
    return np.hstack([*model.ports.B, damper_forces(model.structure, shapes)])
