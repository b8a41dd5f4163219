"""The loop of a structure and a controller as ``E x' = A x``, affine in whatever its matrices are affine in.

A state-space form would need the inverse of the mass matrix, and would lose that.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import side_of_axis
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import FILTER_DAMPING


@dataclass(frozen=True)
class LoopPencil:
    """``E x' = A x``."""

    E: Array
    A: Array

    @cached_property
    def poles(self) -> Array:
        """Its eigenvalues [rad/s]; infinite ones where ``E`` is singular."""
        try:
            return linalg.eigvals(np.linalg.solve(self.E, self.A))
        except np.linalg.LinAlgError:
            return np.array([complex(np.inf)])

    @property
    def stable(self) -> bool:
        """Whether all of its eigenvalues decay; undamped ones do not."""
        return bool((side_of_axis(self.poles) < 0).all())

    @property
    def abscissa(self) -> float:
        """Largest real part of its eigenvalues; negative if the loop is stable."""
        return float(self.poles.real.max())


def closed_pencil(model: SecondOrderModel, controller: Lti) -> LoopPencil:
    """Return the loop ``u = K y`` with the model's inputs and outputs in the order of the controller's.

    States are coordinates, velocities, two of each output's filter, and those of the controller.

    Raises
    ------
    ValueError
        An input that imposes motion, or that an output feels at once.
    """
    ports = model.ports
    for i, name in enumerate(model.input_labels):
        if ports.moved[i] or any(b[:, i].any() for b in ports.B[1:]) or any(e[:, i].any() for e in ports.E):
            raise ValueError(f"control {name!r}: expected a force, got an input that imposes motion or is felt at once")
    n, k = model.ncoordinates, len(controller.A)
    filtered = [(o, b) for o, b in enumerate(ports.bandwidths) if b is not None]
    f = 2 * len(filtered)
    size = 2 * n + f + k
    M, C, K = model.M, model.C, model.K
    E, A = np.eye(size), np.zeros((size, size))
    E[n : 2 * n, n : 2 * n] = M
    A[:n, n : 2 * n], A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = np.eye(n), -K, -C
    reading, rate = np.zeros((len(model.output_labels), size)), np.zeros((len(model.output_labels), size))
    reading[:, :n], reading[:, n : 2 * n], rate[:, n : 2 * n] = ports.L
    for j, (o, b) in enumerate(filtered):
        first, second = 2 * n + 2 * j, 2 * n + 2 * j + 1
        A[first, second] = 1.0
        A[second] = b**2 * reading[o]
        A[second, first], A[second, second] = -(b**2), -2.0 * FILTER_DAMPING * b
        E[second] -= b**2 * rate[o]
        reading[o], rate[o] = 0.0, 0.0
        reading[o, first] = 1.0
    acting, own = slice(n, 2 * n), slice(2 * n + f, size)
    A[acting, own] = ports.B[0] @ controller.C
    A[own, own] = controller.A
    for rows, gain in ((acting, ports.B[0] @ controller.D), (own, controller.B)):
        A[rows] += gain @ reading
        E[rows] -= gain @ rate
    return LoopPencil(E, A)
