"""A linear plant in real modal coordinates, and its exact motion over a step.

A large structure is seen through its lowest undamped modes; the others answer as they do at rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array, balance
from boomctl.checks import known
from boomctl.lti.block_diagonal import block_diagonal
from boomctl.lti.hold import Step, changing, linear_hold
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.pencil import factorized
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.realisation import realize

if TYPE_CHECKING:
    import control

_CONDITION = 1e6  # of the change to modal coordinates: ten digits are left; modes that need more stay in one block
_MODES = 60  # of a structure: five times what its inputs shake in the band of a suspension, and a step stays cheap
_SHIFT = 1e-6  # of the square of the highest frequency kept: holds rigid bodies, far below the modes left out


@dataclass(frozen=True, eq=False)
class ModalPlant(Lti):
    """``z' = A z + B d``, ``y = C z + D d``, ``x = T z``, with ``A`` block-diagonal.

    ``states`` are the names that states of the plant have where they are handed out, so that a loop that reads one can say
    what is missing, and ``units`` those of its signals that are known.

    A block is a real pole, a complex pair, or poles too close together to be told apart (rigid-body modes, Jordan
    blocks): those stay one dense block.
    """

    T: Array = field(kw_only=True)
    blocks: tuple[slice, ...] = field(kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    def motion(self, duration: float) -> tuple[Array, Array, Array]:
        """Return ``exp(A h)``, ``int_0^h exp(A s) ds`` and ``int_0^h exp(A (h - s)) s ds``, block-diagonal."""
        n = len(self.A)
        maps = (np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)))
        for size in {part.stop - part.start for part in self.blocks}:
            parts = [part for part in self.blocks if part.stop - part.start == size]
            stack = np.array([self.A[part, part] for part in parts])
            Phi, G, H = linear_hold(stack, np.broadcast_to(np.eye(size), stack.shape), duration)
            for target, found in zip(maps, (Phi, G, duration * H), strict=True):
                for part, block in zip(parts, found, strict=True):
                    target[part, part] = block
        return maps

    def step(self, h: float, switch: float = 0.0) -> Step:
        """Return the motion over a step of ``h`` [s] in which the controls change ``switch`` [s] after its beginning."""
        Phi, P1, P2 = self.motion(h)

        def hold(duration: float, these: Array) -> tuple[Array, Array]:
            moved, held, _ = self.motion(duration)
            return moved, held @ self.B[:, these]

        whole, ramp = P1 @ self.B, P2 @ self.B / h
        before, after = changing(hold, whole, h, np.full(self.B.shape[1], switch))
        return Step(h=h, Phi=Phi, before=before, after=after, first=whole - ramp, last=ramp)


def modal_plant(
    system: "control.StateSpace | control.TransferFunction | SecondOrderModel", keep_rigid: tuple[str, ...] = ()
) -> ModalPlant:
    """Return a system in real modal coordinates.

    A ``SecondOrderModel`` of many coordinates is projected onto its lowest undamped modes; the others answer as they
    do at rest, but for the inputs ``keep_rigid``, at which contact forces act.

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
        handed_out = (*(f"mode{k + 1}" for k in range(small.n)), *small.structure.coordinates)
        states = tuple(f"{name}.{part}" for name in handed_out for part in ("x1", "x2"))
        return replace(in_modal_coordinates(realized(small, compliance)), states=states, units=system.units)
    return in_modal_coordinates(of(system, "plant"))


def in_modal_coordinates(system: Lti) -> ModalPlant:
    """Return a linear system in real modal coordinates, balanced first."""
    balanced, scale = balance(system.A)
    blocks, T, sizes = block_diagonal(balanced, _CONDITION)
    parts = tuple(slice(int(end - size), int(end)) for end, size in zip(np.cumsum(sizes), sizes, strict=True))
    modal = np.zeros_like(balanced)
    for part in parts:
        modal[part, part] = blocks[part, part]
    return ModalPlant(
        A=modal,
        B=np.linalg.solve(T, system.B / scale[:, None]),
        C=(system.C * scale) @ T,
        D=system.D,
        T=scale[:, None] * T,
        blocks=parts,
        inputs=system.inputs,
        outputs=system.outputs,
        states=system.states,
        scales=system.scales,
    )


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
    labels = tuple(f"mode{k}" for k in range(modes))
    small = SecondOrderModel.of(model.structure.projected(shapes, labels), model.ports.congruent(shapes))
    return small, _at_rest(model, frequencies, shapes)


def realized(small: SecondOrderModel, rest: Array) -> Lti:
    """Return a projected model in state space, the static response of the modes left out added.

    It follows the displacement of each input: the signal itself, or the state that is its integral.
    """
    linear = realize(small.structure, small.ports)
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
