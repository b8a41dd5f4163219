"""A linear plant and its exact motion over a step.

A structure is projected onto its lowest undamped modes; the modes left out contribute their static response.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.lti.hold import Step, changing, linear_hold, motion_coordinates, zero_order_hold
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modal_form import handed_out, over_modes
from boomctl.structure.response.pencil import factorized
from boomctl.structure.response.poles import undamped_modes

if TYPE_CHECKING:
    import control

_MODES = 60  # of a structure: five times what its inputs shake in the band of a suspension, and a step stays cheap
_SHIFT = 1e-6  # of the square of the highest frequency kept: holds rigid bodies, far below the modes left out


@dataclass(frozen=True, eq=False)
class ModalPlant(Lti):
    """Linear plant and its exact motion over a step, in coordinates ``z = from_state x`` of its states.

    ``states`` are the names of the states before a structure is projected onto its modes, for messages about a loop that
    reads one of them.  ``units`` are those of the signals that have known units.
    """

    from_state: Array = field(kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    @classmethod
    def of(cls, system: Lti) -> "ModalPlant":
        """Return the plant of a state space."""
        form, to_form = motion_coordinates(system)
        named = (system.inputs, system.outputs, system.states)
        return cls(form.A, form.B, form.C, form.D, *named, scales=system.scales, from_state=to_form)

    def hold(self, duration: float, inputs: Array | list[int]) -> tuple[Array, Array]:
        """Return the maps of the states and of some inputs, held for ``duration`` [s], to the states at its end."""
        return zero_order_hold(self.A, self.B[:, inputs], duration)

    def step(self, h: float, switch: float = 0.0) -> Step:
        """Return the motion over a step of ``h`` [s] in which the controls change ``switch`` [s] after its beginning."""
        Phi, whole, ramp = linear_hold(self.A, self.B, h)
        before, after = changing(self.hold, whole, h, np.full(self.B.shape[1], switch))
        return Step(h=h, Phi=Phi, before=before, after=after, first=whole - ramp, last=ramp)


def modal_plant(
    system: "control.StateSpace | control.TransferFunction | SecondOrderModel", keep_rigid: tuple[str, ...] = ()
) -> ModalPlant:
    """Return the plant of a system.

    A ``SecondOrderModel`` is projected onto its lowest undamped modes; the modes left out contribute their static
    response, but not to the inputs ``keep_rigid``, at which contact forces act.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, numbers that are not finite, a name given twice, unknown inputs.
    """
    if isinstance(system, SecondOrderModel):
        for name in keep_rigid:
            known("input of a contact", name, system.inputs)
        small, compliance = truncated(system, _MODES)
        compliance[:, [system.inputs.index(name) for name in keep_rigid]] = 0.0
        coordinates = (*(f"mode{k + 1}" for k in range(small.n)), *small.structure.coordinates)
        states = tuple(f"{name}.{part}" for name in coordinates for part in ("x1", "x2"))
        return replace(ModalPlant.of(realized(small, compliance)), states=states, units=system.units)
    return ModalPlant.of(of(system, "plant"))


def truncated(model: SecondOrderModel, modes: int) -> tuple[SecondOrderModel, Array]:
    """Return the model projected onto its lowest modes, and the static response of the others, outputs x inputs.

    Of an input that is integrated (an imposed velocity or acceleration) it is the response to the displacement.

    Matrices without real modes, or of no more coordinates than ``modes``, are left as they are.
    """
    nothing = np.zeros((len(model.outputs), len(model.inputs)))
    if modes >= model.n:
        return model, nothing
    try:
        frequencies, shapes = undamped_modes(model.structure, modes)
    except ValueError:
        return model, nothing
    structure, ports = over_modes(model.structure, model.ports, frequencies, shapes)
    small = SecondOrderModel.of(replace(structure, settled=True), ports)
    return small, _at_rest(model, frequencies, shapes)


def realized(small: SecondOrderModel, rest: Array) -> Lti:
    """Return a projected model in state space, the static response of the modes left out added.

    It follows the displacement of each input: the signal itself, or the state that is its integral.
    """
    linear = handed_out(small.structure, small.ports, None)
    C, D = linear.C.copy(), linear.D.copy()
    place = 2 * small.n
    for i, count in enumerate(small.ports.integrators):
        if count:
            C[:, place] += rest[:, i]
        else:
            D[:, i] += rest[:, i]
        place += count
    return replace(linear, C=C, D=D)


def _at_rest(model: SecondOrderModel, frequencies: Array, shapes: Array) -> Array:
    """Return ``L (K^-1 - V V^T/omega^2) B0`` for displacement outputs.

    A shift far below the modes left out lets rigid-body modes through.
    """
    ports = model.ports
    shift = _SHIFT * float(frequencies[-1]) ** 2
    plain_out = np.array([bandwidth is None for bandwidth in ports.bandwidths], dtype=bool)[:, None]
    loads = ports.B[0]
    solve = factorized(model.structure, shift)
    rest = loads - model.M @ (shapes @ (shapes.T @ loads))
    found = solve(rest)
    found = found - shapes @ (shapes.T @ (model.M @ found))
    return (ports.L[0] * plain_out) @ found
