"""Closing a generalised plant with a controller, names kept."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.loops import posed_inverse
from boomctl.arrays import Array
from boomctl.checks import finite_array
from boomctl.lti.system import Lti
from boomctl.synthesis.plants.partition import Plant, partition

if TYPE_CHECKING:
    import control


def closed(plant: Plant, K: Lti) -> Lti:
    """Return the lower linear fractional transformation of a plant with ``u = K y``.

    Raises
    ------
    ValueError
        The loop is not well-posed: ``I - D22 D_K`` is singular.
    """
    solved = posed_inverse(np.eye(len(K.D)) - K.D @ plant.D22)
    direct, state = solved @ K.D, solved @ K.C
    inner = plant.D22 @ direct
    into = K.B + K.B @ inner
    A = np.block(
        [
            [plant.A + plant.B2 @ direct @ plant.C2, plant.B2 @ state],
            [into @ plant.C2, K.A + K.B @ plant.D22 @ state],
        ]
    )
    B = np.vstack([plant.B1 + plant.B2 @ direct @ plant.D21, into @ plant.D21])
    C = np.hstack([plant.C1 + plant.D12 @ direct @ plant.C2, plant.D12 @ state])
    return Lti(A, B, C, plant.D11 + plant.D12 @ direct @ plant.D21)


def with_feedthrough(K: Lti, D22: Array) -> Lti:
    """Return the controller that does with ``D22`` what ``K`` does without it.

    Raises
    ------
    ValueError
        That loop is not well-posed.
    """
    if not D22.any():
        return K
    solved = posed_inverse(np.eye(len(K.D)) + K.D @ D22)
    C, D = solved @ K.C, solved @ K.D
    return Lti(K.A - K.B @ D22 @ C, K.B - K.B @ D22 @ D, C, D)


def close_loop(P: "control.StateSpace", controller: "control.StateSpace") -> "control.StateSpace":
    """Return a generalised plant closed by a controller from its measurements to its controls.

    The controller's inputs are the last outputs of ``P`` and its outputs the last inputs: found by name where the
    controller bears their names, in that order where all of its names are strange to ``P``.

    Returns
    -------
    control.StateSpace
        From the disturbances to the performance signals, named as in ``P``.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system, discrete time, too many signals; names of which some are signals of ``P`` but not those
        last ones; the loop is not well-posed.
    """
    plant, K = matched(P, controller)
    return named_loop(plant, closed(plant, K))


def matched(P: "control.StateSpace", controller: "control.StateSpace") -> tuple[Plant, Lti]:
    """Return a plant cut to fit a controller, and the controller with its signals in the plant's order.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system, discrete time, not finite, too many signals.
    """
    from boomctl.lti.python_control import control

    if not isinstance(controller, control.StateSpace):
        raise TypeError(f"controller: expected a StateSpace, got {type(controller).__name__}")
    if not controller.isctime():
        raise ValueError(f"controller: expected continuous time, got a sampling time of {controller.dt:g} s")
    plant = partition(P, controller.ninputs, controller.noutputs)
    A, B, C, D = (finite_array(f"{name} of the controller", getattr(controller, name), 2) for name in "ABCD")
    columns = _places("output", plant.measurements, controller.input_labels, P.output_labels)
    rows = _places("input", plant.controls, controller.output_labels, P.input_labels)
    return plant, Lti(A, B[:, columns], C[rows], D[np.ix_(rows, columns)])


def _places(what: str, wanted: Sequence[str], names: Sequence[str], there: Sequence[str]) -> list[int]:
    """Return where the wanted names stand; in their order where all names are strange to the plant."""
    listed = list(names)
    if set(listed) == set(wanted):
        return [listed.index(name) for name in wanted]
    for name in listed:
        if name in there:
            raise ValueError(
                f"controller: its signal {name!r} is an {what} of P, but the last {len(wanted)} {what}(s) of P are "
                f"{', '.join(wanted)}, and its own are {', '.join(listed)}; name all of them, or none"
            )
    return list(range(len(listed)))


def named_loop(plant: Plant, loop: Lti) -> "control.StateSpace":
    """Return a closed loop from the disturbances to the performance signals."""
    from boomctl.lti.python_control import control

    ins, outs = list(plant.disturbances), list(plant.performance)
    return control.ss(loop.A, loop.B, loop.C, loop.D, inputs=ins, outputs=outs, name="closed_loop")
