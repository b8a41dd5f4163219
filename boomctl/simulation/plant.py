"""A linear plant in real modal coordinates, and its exact motion over a step."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.simulation.truncation import realized, truncated
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control

_CONDITION = 1e6
_MODES = 60


@dataclass(frozen=True)
class ModalPlant:
    """``z' = A z + B d``, ``y = C z + D d``, ``x = T z``, with ``A`` block-diagonal.

    A block is a real pole, a complex pair, or poles too close together to be told apart (rigid-body modes, Jordan
    blocks): those stay one dense block.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    T: Array
    blocks: tuple[slice, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def motion(self, duration: float) -> tuple[Array, Array, Array]:
        """Return ``exp(A h)``, ``int_0^h exp(A s) ds`` and ``int_0^h exp(A (h - s)) s ds``, block-diagonal."""
        n = len(self.A)
        maps = (np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)))
        for size in {part.stop - part.start for part in self.blocks}:
            parts = [part for part in self.blocks if part.stop - part.start == size]
            chain = np.zeros((len(parts), 3 * size, 3 * size))
            for k, part in enumerate(parts):
                chain[k, :size, :size] = duration * self.A[part, part]
            chain[:, :size, size : 2 * size] = chain[:, size : 2 * size, 2 * size :] = np.eye(size)
            found = linalg.expm(chain)
            for k, part in enumerate(parts):
                for power, target in enumerate(maps):
                    target[part, part] = duration**power * found[k, :size, power * size : (power + 1) * size]
        return maps

    def step(self, h: float, switch: float = 0.0) -> "StepMaps":
        """Return the maps over a step of ``h`` [s] in which the controls change ``switch`` [s] after its beginning."""
        Phi, P1, P2 = self.motion(h)
        before = np.zeros_like(self.B)
        after = P1 @ self.B
        if switch > 0.0:
            rest, after_1, _ = self.motion(h - switch)
            before, after = rest @ self.motion(switch)[1] @ self.B, after_1 @ self.B
        ramp = P2 @ self.B / h
        return StepMaps(h, Phi, before, after, P1 @ self.B - ramp, ramp, switch > 0.0)


@dataclass(frozen=True)
class StepMaps:
    """Exact motion over one step: ``z+ = Phi z + before u_old + after u_new + first d + last d+``.

    ``u`` is held and changes once within the step, at its beginning unless ``late``; ``d`` runs along a straight line
    from ``d`` to ``d+``.
    """

    h: float
    Phi: Array
    before: Array
    after: Array
    first: Array
    last: Array
    late: bool = False

    @property
    def of_signals(self) -> tuple[Array, Array, Array]:
        """``Phi``, ``first`` and ``last``."""
        return self.Phi, self.first, self.last

    @property
    def held(self) -> Array:
        """What an input held over the whole step adds."""
        return self.before + self.after if self.before.any() else self.after


def modal_plant(system: "control.StateSpace | SecondOrderModel", keep_rigid: tuple[str, ...] = ()) -> ModalPlant:
    """Return a system in real modal coordinates.

    A ``SecondOrderModel`` of many coordinates is projected onto its lowest undamped modes; the others answer as they
    do at rest, but for the inputs ``keep_rigid``, at which contact forces act.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, numbers that are not finite, a name given twice, unknown inputs.
    """
    from boomctl.lti.python_control import control

    if isinstance(system, SecondOrderModel):
        for name in keep_rigid:
            known("input of a contact", name, system.inputs)
        small, compliance = truncated(system, _MODES)
        compliance[:, [system.inputs.index(name) for name in keep_rigid]] = 0.0
        return of_matrices(*realized(small, compliance), system.inputs, system.outputs)
    if not isinstance(system, control.StateSpace):
        raise TypeError(f"plant: expected control.StateSpace or SecondOrderModel, got {type(system).__name__}")
    if not system.isctime():
        raise ValueError(f"plant: expected a continuous-time system, got one with a sampling time of {system.dt} s")
    for name in ("A", "B", "C", "D"):
        if not np.isfinite(getattr(system, name)).all():
            raise ValueError(f"plant: {name} has entries that are not finite")
    for what, labels in (("input", system.input_labels), ("output", system.output_labels)):
        twice = [label for label in labels if labels.count(label) > 1]
        if twice:
            raise ValueError(f"plant: {what} {twice[0]!r} is there twice")
    labels = tuple(system.input_labels), tuple(system.output_labels)
    return of_matrices(system.A, system.B, system.C, np.asarray(system.D), *labels)


def of_matrices(
    A: Array, B: Array, C: Array, D: Array, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> ModalPlant:
    """Return the modal coordinates of ``A, B, C, D``, balanced first."""
    from boomctl.lti.python_control import control

    n = len(A)
    if n == 0:
        return ModalPlant(A, B, C, D, np.zeros((0, 0)), (), inputs, outputs)
    balanced, (scale, _) = linalg.matrix_balance(A, permute=False, separate=True)
    blocks, T, sizes = control.bdschur(balanced, condmax=_CONDITION)
    ends = np.cumsum(np.asarray(sizes, dtype=int))
    parts = tuple(
        slice(int(end - size), int(end)) for end, size in zip(ends, np.asarray(sizes, dtype=int), strict=True)
    )
    modal = np.zeros_like(balanced)
    for part in parts:
        modal[part, part] = np.asarray(blocks)[part, part]
    T = np.asarray(T)
    return ModalPlant(
        modal, np.linalg.solve(T, B / scale[:, None]), (C * scale) @ T, D, scale[:, None] * T, parts, inputs, outputs
    )
