"""Plants whose states are outputs too, for controllers that read states."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti, of

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


def with_states(plant: "SecondOrderModel | control.StateSpace | control.TransferFunction") -> "control.StateSpace":
    """Return the same plant with its states as further outputs, under their names.

    A regulator of :func:`boomctl.lqr` reads states.  Its controller and this plant meet by name, so that
    :func:`boomctl.margins`, :func:`boomctl.feedback_loop` and :func:`boomctl.simulate_loop` take it as they take a controller
    that reads outputs, also sampled and delayed.

    Parameters
    ----------
    plant : SecondOrderModel, control.StateSpace or control.TransferFunction
        Of p outputs and n states, in continuous or discrete time.  A structure is taken in the states of its
        ``to_statespace()``, which are those that :func:`boomctl.lqr` sees.

    Returns
    -------
    control.StateSpace
        The same inputs and states; first the p outputs, then the n states in their order, dots in their names replaced
        by ``_``.  A state that is an output already, under its name, is not there twice.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, not finite; a state whose name is that of another output, or of another state.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": "force", "outputs": "place", "states": ["x", "v"]}
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, **signals)
    >>> regulator = bc.lqr(mass, None, 1.0, output_weight={"place": 1.0})
    >>> bc.with_states(mass).output_labels
    ['place', 'x', 'v']
    >>> bool(bc.margins(bc.with_states(mass), regulator.controller)["force"].phase_deg > 60.0)  # Kalman's inequality
    True
    """
    given = of(plant, "plant", "SecondOrderModel, StateSpace or TransferFunction", any_time=True)
    name = getattr(plant, "name", None)
    return _with_states(given).statespace(name if isinstance(name, str) else "plant")


def _with_states(plant: Lti) -> Lti:
    plain, eye = plant.without_dots(), np.eye(len(plant.A))
    labels = tuple(label.replace(".", "_") for label in plant.states)
    new: list[int] = []
    for i, label in enumerate(labels):
        if label in labels[:i]:
            raise ValueError(f"plant: expected states of different names, got {label!r} twice")
        if label not in plain.outputs:
            new.append(i)
        elif not _is_state(plain, plain.outputs.index(label), eye[i]):
            raise ValueError(f"plant: expected output {label!r} to be the state of this name; rename one of them")
    return replace(
        plain,
        C=np.vstack([plain.C, eye[new]]),
        D=np.vstack([plain.D, np.zeros((len(new), plain.D.shape[1]))]),
        outputs=(*plain.outputs, *(labels[i] for i in new)),
    )


def _is_state(plant: Lti, output: int, row: Array) -> bool:
    return bool((plant.C[output] == row).all() and not plant.D[output].any())
