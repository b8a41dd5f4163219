"""A nonlinear machine in the modes of its linear part, as a loop sees it: what plants offer, and methods take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True, eq=False)
class MachineModes:
    """Equations ``z'' + Omega^2 z = r(z, z', u)`` in m coordinates, and what is measured.

    Attributes
    ----------
    input_labels, output_labels, state_labels : tuple of str
        Names of u, of what is measured, and of the states: of a hub-beam those of ``to_nlsys()``.
    omega : ndarray, m
        Frequencies, rad/s; that of a rigid motion is 0.
    decay : float
        Largest rate at which damping, which is in r, takes a rate away, 1/s.
    push : ndarray, m x inputs
        What each input does to each mode at rest.
    to_state, from_state : ndarray, 2 m x 2 m
        State from modal coordinates and rates, and back.
    rest : casadi.Function
        ``(z and z', u) -> r``.
    read : casadi.Function
        ``(z and z', u) -> outputs, margin``; beyond the model's range, where the mass matrix is not positive definite, the
        margin is not above zero.
    judged : casadi.Function
        ``(z and z') -> displacements`` [m], by which an error is judged: of a hub-beam radius of the free end times hub
        angle, and the free end's displacement.
    units : mapping from signal to str
        Of inputs, outputs and sensors, as far as they are known.
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
    judged: casadi.Function
    units: Mapping[str, str]
