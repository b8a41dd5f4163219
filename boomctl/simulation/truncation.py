"""The lowest undamped modes of a structure, and what the others do at rest."""

import numpy as np
from scipy import sparse

from boomctl.arrays import Array
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.pencil import factorized
from boomctl.structure.response.poles import undamped_modes

_SHIFT = 1e-6


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


def realized(small: SecondOrderModel, rest: Array) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of a projected model, the static response of the modes left out added.

    It follows the displacement of each input: the signal itself, or the state that is its integral.
    """
    linear = small.to_statespace()
    C, D = np.array(linear.C, dtype=float), np.array(linear.D, dtype=float)
    place = 2 * small.n
    for i, count in enumerate(small.ports.integrators):
        if count:
            C[:, place] += rest[:, i]
        else:
            D[:, i] += rest[:, i]
        place += count
    return linear.A, linear.B, C, D


def _at_rest(model: SecondOrderModel, frequencies: Array, shapes: Array) -> Array:
    """Return ``L (K^-1 - V V^T/omega^2) B0`` for displacement outputs.

    A shift far below the modes left out lets rigid-body modes through.
    """
    ports = model.ports
    shift = _SHIFT * float(frequencies[-1]) ** 2
    plain_out = np.array([bandwidth is None for bandwidth in ports.bandwidths], dtype=bool)[:, None]
    loads = ports.B[0]
    solve = factorized(sparse.csr_array(sparse.csr_array(model.K) + shift * sparse.csr_array(model.M)))
    rest = loads - model.M @ (shapes @ (shapes.T @ loads))
    found = solve(rest)
    found = found - shapes @ (shapes.T @ (model.M @ found))
    return (ports.L[0] * plain_out) @ found
