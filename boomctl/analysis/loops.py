"""Feedback loops ``u = K y`` closed by name, with signals added at controls and measurements."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import frequencies, known, names
from boomctl.lti.system import Lti, lower_lft, state_matrices
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Loop:
    """A plant and a controller, ``u = K y``, as one system with every signal around the loop at hand.

    ``system`` has the plant's remaining inputs, then what is added to each control, then what is added to each
    measurement; its outputs are the plant's, then the controls as the plant feels them, then the measurements as the
    controller reads them.

    Attributes
    ----------
    disturbances, controls, measurements, outputs : tuple of str
        Names; ``outputs`` are all of the plant's.
    system : Lti
        Plant states first, then the controller's.
    states : tuple of str
        Their names.
    """

    disturbances: tuple[str, ...]
    controls: tuple[str, ...]
    measurements: tuple[str, ...]
    outputs: tuple[str, ...]
    system: Lti
    states: tuple[str, ...]

    @property
    def poles(self) -> Array:
        """Poles of the closed loop [rad/s]."""
        return linalg.eigvals(self.system.A) if len(self.system.A) else np.zeros(0, complex)

    def balanced(self, rows: Sequence[int], columns: Sequence[int]) -> Lti:
        """Return the system between some of its signals, states balanced."""
        s = self.system
        B, C, D = s.B[:, list(columns)], s.C[list(rows)], s.D[np.ix_(list(rows), list(columns))]
        if not len(s.A):
            return Lti(s.A, B, C, D)
        A, (scale, _) = linalg.matrix_balance(s.A, permute=False, separate=True)
        return Lti(A, B / scale[:, None], C * scale, D)

    @property
    def sensitivity(self) -> Lti:
        """From what is added to controls and measurements to controls and measurements: ``(I - [0 K; G 0])^-1``."""
        first, size = len(self.disturbances), len(self.controls) + len(self.measurements)
        last = len(self.outputs)
        return self.balanced(range(last, last + size), range(first, first + size))


def plant_of(plant: "SecondOrderModel | control.StateSpace") -> "control.StateSpace":
    """Return a plant as a continuous-time state-space system, refused if it is neither that nor a structure."""
    from boomctl.lti.python_control import control

    if isinstance(plant, SecondOrderModel):
        return plant.to_statespace()
    if not isinstance(plant, control.StateSpace):
        raise TypeError(f"plant: expected SecondOrderModel or StateSpace, got {type(plant).__name__}")
    state_matrices(plant)
    return plant


def controller_of(controller: "control.StateSpace") -> "control.StateSpace":
    """Return a controller, refused if it is not a continuous-time state-space system."""
    from boomctl.lti.python_control import control

    if not isinstance(controller, control.StateSpace):
        raise TypeError(f"controller: expected StateSpace, got {type(controller).__name__}")
    state_matrices(controller)
    return controller


def joined(plant: "SecondOrderModel | control.StateSpace", controller: "control.StateSpace") -> Loop:
    """Return the loop of a plant and a controller, found by name.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system, discrete time; a controller's input that is no output of the plant, or its output no
        input of it; a loop that is not well-posed.
    """
    P, K = plant_of(plant), controller_of(controller)
    for label in K.input_labels:
        known("plant output (it is an input of the controller)", label, P.output_labels)
    for label in K.output_labels:
        known("plant input (it is an output of the controller)", label, P.input_labels)
    measured = [P.output_labels.index(label) for label in K.input_labels]
    acting = [P.input_labels.index(label) for label in K.output_labels]
    others = [i for i in range(P.ninputs) if i not in acting]
    return Loop(
        tuple(P.input_labels[i] for i in others),
        tuple(K.output_labels),
        tuple(K.input_labels),
        tuple(P.output_labels),
        _closed(_matrices(P), _matrices(K), (others, acting), measured),
        tuple(P.state_labels) + tuple(f"controller_{label}" for label in K.state_labels),
    )


def _matrices(system: "control.StateSpace") -> Lti:
    return Lti(*(np.asarray(getattr(system, name), dtype=float) for name in ("A", "B", "C", "D")))


def _closed(P: Lti, K: Lti, inputs: tuple[Sequence[int], Sequence[int]], measured: Sequence[int]) -> Lti:
    """Return the loop ``u = v + K (y + n)``, from what drives it, ``v`` and ``n`` to the outputs, ``u`` and ``y + n``."""
    others, acting = list(inputs[0]), list(inputs[1])
    m, p, outputs = len(acting), len(measured), len(P.C)
    B1, B2, C2 = P.B[:, others], P.B[:, acting], P.C[measured]
    driven, read = P.D[:, acting], [P.D[np.ix_(measured, others)], P.D[np.ix_(measured, acting)], np.eye(p)]
    D = np.block(
        [
            [P.D[:, others], driven, np.zeros((outputs, p)), driven],
            [np.zeros((m, len(others))), np.eye(m), np.zeros((m, p)), np.eye(m)],
            [*read, read[1]],
            [*read, read[1]],
        ]
    )
    B, C = np.hstack([B1, B2, np.zeros((len(P.A), p)), B2]), np.vstack([P.C, np.zeros((m, len(P.A))), C2, C2])
    return lower_lft(Lti(P.A, B, C, D), K)


def feedback_loop(
    plant: "SecondOrderModel | control.StateSpace",
    controller: "control.StateSpace",
    added: str | Sequence[str] = (),
) -> "control.StateSpace":
    """Return the closed loop ``u = K y``; signals of plant and controller meet by name.

    Parameters
    ----------
    plant : SecondOrderModel or control.StateSpace
    controller : control.StateSpace
        Its inputs are outputs of the plant, its outputs inputs of the plant.
    added : str or sequence of str, optional
        Controls and measurements at which a further signal is added, ``u = K (y + n) + v``; its name is that of the
        signal with ``_added`` behind it.

    Returns
    -------
    control.StateSpace
        Inputs: those of the plant that the controller does not drive, then those added.  Outputs: those of the plant,
        then the controls as the plant feels them (under their own names).

    Raises
    ------
    TypeError, ValueError
        Other kinds of system, discrete time; names that do not meet; nothing left to drive the loop; a loop that is
        not well-posed.
    """
    from boomctl.lti.python_control import control

    loop = joined(plant, controller)
    around = loop.controls + loop.measurements
    extra = names("control or measurement", added, around)
    if not loop.disturbances and not extra:
        raise ValueError(
            f"the controller drives every input of the plant, and nothing drives the loop: name in added some of {around}"
        )
    columns = [*range(len(loop.disturbances)), *(len(loop.disturbances) + around.index(name) for name in extra)]
    rows = range(len(loop.outputs) + len(loop.controls))
    s = loop.system
    return control.ss(
        s.A,
        s.B[:, columns],
        s.C[list(rows)],
        s.D[np.ix_(list(rows), columns)],
        inputs=[*loop.disturbances, *(f"{name}_added" for name in extra)],
        outputs=[*loop.outputs, *loop.controls],
        states=list(loop.states),
        name="closed loop",
        remove_useless_states=False,
    )


def closed_loop_response(
    plant: "Callable[[Array], control.FrequencyResponseData] | control.FrequencyResponseData",
    controller: "control.StateSpace",
    omega: ArrayLike | None = None,
) -> "control.FrequencyResponseData":
    """Return the frequency response of the loop ``u = K y`` of a plant known by its frequency response.

    Parameters
    ----------
    plant : control.FrequencyResponseData, or function from frequencies [rad/s] to it
        Such as the response of an exact boom; its signals are named.
    controller : control.StateSpace
        Its inputs are outputs of the plant, its outputs inputs of the plant.
    omega : array_like, optional
        Angular frequencies [rad/s]; only with a function.

    Returns
    -------
    control.FrequencyResponseData
        From the inputs that the controller does not drive to the plant's outputs and the controls.  It says nothing of
        stability: see :func:`boomctl.exact_loop_stability`.

    Raises
    ------
    TypeError, ValueError
        Names that do not meet; no frequencies, or frequencies beside data that have their own; a loop with a pole at
        a frequency asked for.
    """
    from boomctl.lti.python_control import control

    data = named_response(plant, omega)
    K = controller_of(controller)
    grid, G = np.asarray(data.omega, dtype=float), np.moveaxis(np.asarray(data.frdata), 2, 0)
    measured = [
        data.output_labels.index(known("plant output (it is an input of the controller)", label, data.output_labels))
        for label in K.input_labels
    ]
    acting = [
        data.input_labels.index(known("plant input (it is an output of the controller)", label, data.input_labels))
        for label in K.output_labels
    ]
    others = [i for i in range(data.ninputs) if i not in acting]
    if not others:
        raise ValueError("the controller drives every input of the plant, and nothing drives the loop")
    Kw = np.moveaxis(state_matrices(K).response(grid), 2, 0)
    loop = np.eye(len(acting)) - Kw @ G[:, measured][:, :, acting]
    try:
        u = np.linalg.solve(loop, Kw @ G[:, measured][:, :, others])
    except np.linalg.LinAlgError:
        raise ValueError("the loop has a pole at one of the frequencies asked for") from None
    z = G[:, :, others] + G[:, :, acting] @ u
    return control.frd(
        np.moveaxis(np.concatenate([z, u], axis=1), 0, 2),
        grid,
        inputs=[data.input_labels[i] for i in others],
        outputs=[*data.output_labels, *K.output_labels],
        name="closed loop",
    )


def named_response(
    plant: "Callable[[Array], control.FrequencyResponseData] | control.FrequencyResponseData",
    omega: ArrayLike | None,
) -> "control.FrequencyResponseData":
    """Return the frequency response of a plant, whether it is data or a function of frequency; refused if not finite."""
    from boomctl.lti.python_control import control

    if isinstance(plant, control.FrequencyResponseData):
        if omega is not None:
            raise ValueError("omega: frequency response data have their own frequencies; leave it out")
        data: Any = plant
    elif callable(plant):
        if omega is None:
            raise ValueError("omega: expected frequencies at which to ask the plant's response")
        data = plant(frequencies("omega", omega))
        if not isinstance(data, control.FrequencyResponseData):
            raise TypeError(f"plant: expected a function that returns FrequencyResponseData, got {type(data).__name__}")
    else:
        kind = type(plant).__name__
        raise TypeError(f"plant: expected FrequencyResponseData or a function of frequency, got {kind}")
    if not np.isfinite(np.asarray(data.frdata)).all():
        raise ValueError("plant: expected a finite frequency response")
    return data
