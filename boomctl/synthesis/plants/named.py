"""What a synthesis takes: a named linear system in continuous time, as matrices and names."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import finite_array, names
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.plants.partition import Plant

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class NamedMatrices:
    """``x' = A x + B u``, ``y = C x + D u``, every signal and state named."""

    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]

    def columns(self, wanted: Sequence[str]) -> tuple[Array, Array]:
        """Return the columns of ``B`` and ``D`` of the inputs named."""
        places = [self.inputs.index(name) for name in wanted]
        return self.B[:, places], self.D[:, places]

    def rows(self, wanted: Sequence[str]) -> tuple[Array, Array]:
        """Return the rows of ``C`` and ``D`` of the outputs named."""
        places = [self.outputs.index(name) for name in wanted]
        return self.C[places], self.D[places]

    def block(self, outputs: Sequence[str], inputs: Sequence[str]) -> Lti:
        """Return the system from the inputs named to the outputs named."""
        B, D = self.columns(inputs)
        rows = [self.outputs.index(name) for name in outputs]
        return Lti(self.A, B, self.C[rows], D[rows])

    def partitioned(
        self, disturbances: Sequence[str], controls: Sequence[str], performance: Sequence[str], measured: Sequence[str]
    ) -> Plant:
        """Return the generalised plant of the signals named; a signal may stand on both sides."""
        w, u = self.block(performance, disturbances), self.block(measured, controls)
        D12, D21 = self.block(performance, controls).D, self.block(measured, disturbances).D
        names = (tuple(disturbances), tuple(controls), tuple(performance), tuple(measured))
        return Plant(self.A, w.B, u.B, w.C, u.C, w.D, D12, D21, u.D, *names, self.states)

    def chosen_inputs(self, what: str, wanted: str | Sequence[str] | None) -> tuple[str, ...]:
        """Return names of inputs, each known, none twice, at least one; all if ``wanted`` is None."""
        return _some(what, names(what, wanted, self.inputs))

    def chosen_outputs(self, what: str, wanted: str | Sequence[str] | None) -> tuple[str, ...]:
        """Return names of outputs, each known, none twice, at least one; all if ``wanted`` is None."""
        return _some(what, names(what, wanted, self.outputs))

    def other_inputs(self, controls: Sequence[str]) -> tuple[str, ...]:
        """Return the inputs that are no controls."""
        return tuple(name for name in self.inputs if name not in controls)

    def with_integrators(self, integrated: Sequence[str]) -> "NamedMatrices":
        """Return the plant with the integral of each output named as a further state, ``integral.NAME``."""
        if not integrated:
            return self
        rows, feedthrough = self.rows(integrated)
        k, n = len(integrated), len(self.A)
        return replace(
            self,
            A=np.block([[self.A, np.zeros((n, k))], [rows, np.zeros((k, k))]]),
            B=np.vstack([self.B, feedthrough]),
            C=np.hstack([self.C, np.zeros((len(self.C), k))]),
            states=(*self.states, *(f"integral.{name}" for name in integrated)),
        )


def named_matrices(system: object) -> NamedMatrices:
    """Return the matrices and names of a ``StateSpace`` or ``SecondOrderModel``.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, in discrete time, not finite, or without states.
    """
    from boomctl.lti.python_control import control

    given: Any = system.to_statespace() if isinstance(system, SecondOrderModel) else system
    if not isinstance(given, control.StateSpace):
        raise TypeError(f"system: expected SecondOrderModel or StateSpace, got {type(system).__name__}")
    if not given.isctime():
        raise ValueError(f"system: expected continuous time, got a sampling time of {given.dt:g} s")
    if given.nstates == 0:
        raise ValueError("system: expected at least one state, got a static gain")
    A, B, C, D = (finite_array(f"{name} of the system", getattr(given, name)) for name in "ABCD")
    labels: Any = given
    return NamedMatrices(
        A, B, C, D, tuple(labels.input_labels), tuple(labels.output_labels), tuple(labels.state_labels)
    )


def named_statespace(
    matrices: tuple[Array, Array, Array, Array],
    inputs: Sequence[str],
    outputs: Sequence[str],
    name: str,
    states: Sequence[str] | None = None,
) -> "control.StateSpace":
    """Return a state-space system with all its names; dots in signal names, which no signal may have, become ``_``."""
    from boomctl.lti.python_control import control

    A, B, C, D = matrices
    ins, outs = [x.replace(".", "_") for x in inputs], [x.replace(".", "_") for x in outputs]
    return control.ss(A, B, C, D, inputs=ins, outputs=outs, name=name, states=list(states) if states else None)


def static_gain(gain: Array, inputs: Sequence[str], outputs: Sequence[str], name: str) -> "control.StateSpace":
    """Return a gain without states as a named system."""
    m, n = gain.shape
    return named_statespace((np.zeros((0, 0)), np.zeros((0, n)), np.zeros((m, 0)), gain), inputs, outputs, name)


def _some(what: str, chosen: tuple[str, ...]) -> tuple[str, ...]:
    if not chosen:
        raise ValueError(f"{what}: expected at least one name, got none")
    return chosen
