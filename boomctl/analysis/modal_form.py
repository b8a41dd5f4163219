"""Second-order models in the coordinates of their undamped modes: which are elastic, and the state-space form."""

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.realisation import realize

_RIGID = 1e-8  # share of the highest frequency found up to which a mode is a rigid-body one: root of rounding


def elastic(frequencies: Array) -> Array:
    """Return which undamped modes, of ascending frequency, are elastic and not rigid-body ones."""
    return frequencies > _RIGID * frequencies[-1]


def in_modes(model: SecondOrderModel, V: Array) -> Lti:
    """Return the state-space form of a model over undamped modes, projected through its strain rows where it has them."""
    names = tuple(f"mode{i + 1}" for i in range(V.shape[1]))
    return realize(model.structure.projected(V, names), model.ports.congruent(V))


def modal_form(model: SecondOrderModel) -> Lti:
    """Return a state-space system of a model in the coordinates of all its undamped modes, or, without them, its own.

    Raises
    ------
    ValueError
        An output that needs a derivative of an input.
    """
    try:
        _, V = undamped_modes(model.structure)
    except ValueError:
        return realize(model.structure, model.ports)
    return in_modes(model, V)
