"""A nonlinear machine in the modes of its linear part: the interface between plants and simulation methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True, eq=False)
class MachineModes:
    """Equations ``z'' + Omega^2 z = r(z, z', u)`` in m coordinates, and the outputs.

    Attributes
    ----------
    input_labels, output_labels, state_labels : tuple of str
        Names of the inputs u, the outputs and the states; of a hub-beam those of ``to_nlsys()``.
    omega : ndarray, m
        Frequencies, rad/s; 0 for a rigid-body motion.
    decay : float
        Largest decay rate of a velocity by the damping, which is in r, 1/s.
    push : ndarray, m x inputs
        Modal participation of each input at rest.
    to_state, from_state : ndarray, 2 m x 2 m
        Transformation from modal coordinates and rates to the state, and its inverse.
    rest : casadi.Function
        ``(z and z', u) -> r``.
    read : casadi.Function
        ``(z and z', u) -> outputs, margin``; beyond the model's range, where the mass matrix is not positive definite, the
        margin is not above zero.
    displacements : casadi.Function
        ``(z and z') -> displacements`` [m] in which an error is measured: of a hub-beam the radius of the free end times
        the hub angle, and the displacement of the free end.
    units : mapping from signal to str
        Known units of inputs, outputs and sensors.
    """

    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    state_labels: tuple[str, ...]
    omega: Array
    decay: float
    push: Array
    to_state: Array
    from_state: Array
    rest: casadi.Function
    read: casadi.Function
    displacements: casadi.Function
    units: Mapping[str, str]
