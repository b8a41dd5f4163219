"""State spaces over undamped modes.

Over nodal coordinates a state matrix contains ``M^-1 K``, whose rounding error is determined by its stiffest element: with
100 elements of a beam the slow modes have eight accurate digits for any scaling of the states.  Over modes it contains each
frequency once.
"""

from dataclasses import replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.lti.rounding import LEVEL, VISIBLE, warn_of_rounding
from boomctl.lti.system import Lti
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import Ports
from boomctl.structure.response.direct import direct_response
from boomctl.structure.response.modes import SMALL, undamped_modes
from boomctl.structure.response.realization import realize

MODES, COORDINATES = "modes", "coordinates"  # Values of `states`.

# Ratio to the largest root of a damping up to which that of a rigid-body mode is rounding: strains of such a mode are
# some units of rounding, and a rotation of such modes mixes in the root of rounding.
_UNDAMPED = 1e-8
_OVERDAMPED = 1e3  # Rate of damping over the slowest frequency from which on a state space over modes is checked.
_EVEN = 2.0**10  # Ratio of the balancing scales of a state matrix up to which user matrices keep their coordinates.
_CHECKED = np.array([0.01, 0.7])  # Times the slowest frequency: where it is checked, between no resonances.


def in_modes(structure: Structure, ports: Ports, frequencies: Array, V: Array) -> Lti:
    """Return the state-space form of a structure over undamped modes, projected through its strain rows if it has them.

    The strains of a rigid-body mode, its mass coupling with elastic modes and, if undamped, its damping are exactly zero.
    Gyroscopic terms are preserved.
    """
    moved = structure.projected(V, tuple(f"mode{i + 1}" for i in range(len(frequencies))))
    rigid = np.flatnonzero(frequencies == 0.0)
    if not len(rigid):
        return realize(moved, ports.congruent(V))
    V, C = _resisted(V, moved.C, rigid)
    M, K, bending = moved.M.copy(), moved.K.copy(), np.flatnonzero(frequencies)
    M[np.ix_(rigid, bending)], M[np.ix_(bending, rigid)] = 0.0, 0.0
    K[rigid], K[:, rigid] = 0.0, 0.0
    return realize(Structure.of(M, C, K, moved.coordinates), ports.over_motions(V, rigid))


def _resisted(V: Array, C: Array, rigid: Array) -> tuple[Array, Array]:
    """Return modes and damping with rigid motions separated into damped and undamped ones."""
    turning = np.zeros_like(C) if is_symmetric(C) else 0.5 * (C - C.T)  # Gyroscopic terms, which dissipate no energy.
    basis, C = np.eye(len(C)), C - turning
    basis[np.ix_(rigid, rigid)] = linalg.eigh(C[np.ix_(rigid, rigid)])[1]
    V, C, turning = V @ basis, basis.T @ C @ basis, basis.T @ turning @ basis
    size = np.sqrt(np.abs(np.diag(C)))
    undamped = rigid[size[rigid] <= _UNDAMPED * size.max()]
    C[undamped], C[:, undamped] = 0.0, 0.0
    return V, C + turning


def modal_form(structure: Structure, ports: Ports) -> Lti:
    """Return a state space over all undamped modes, or, without such modes, over the coordinates; its states are scaled.

    Raises
    ------
    ValueError
        An output that needs a derivative of an input.
    """
    form = structure.strain_form
    if form is not None:
        frequencies, own = form.own_modes
        B, L = form.in_modes(ports)
        names = tuple(f"mode{i + 1}" for i in range(len(own)))
        modal = Structure.of(np.eye(len(own)), own.T @ form.C @ own, np.diag(frequencies**2), names)
        return _scaled(realize(modal, replace(ports, B=B, L=L)), ports, frequencies)
    try:
        frequencies, V = undamped_modes(structure)
    except ValueError:
        return realize(structure, ports).balanced()
    return _scaled(in_modes(structure, ports, frequencies, V), ports, frequencies)


def user_state_space(structure: Structure, ports: Ports, states: str | None) -> Lti:
    """Return a structure in state space for the user; see :meth:`SecondOrderModel.to_statespace`."""
    if states == COORDINATES:
        return _warned(realize(structure, ports), structure, ports, 0.0, VISIBLE)
    if states is None and structure.settled:
        return realize(structure, ports)
    if states is None and not structure.has_strains:
        own = realize(structure, ports)
        scale = balance(own.A)[1]
        if scale.max() <= _EVEN * scale.min():
            return own
    return _warned(modal_form(structure, ports), structure, ports, _OVERDAMPED, LEVEL)


def _warned(system: Lti, structure: Structure, ports: Ports, least: float, limit: float) -> Lti:
    """Return a system of a small structure with rows; warn if its matrices are inaccurate for slow motions.

    With stiff elements over coordinates, or with overdamped slow motions, a slow motion is a small difference.
    Only systems with damping of ``least`` times the slowest frequency are checked.
    """
    form, n = structure.strain_form if structure.n <= SMALL else None, structure.n
    if form is None or not form.strains:
        return system
    slowest = form.own_modes[0][form.rigid]
    if np.abs(system.A[n : 2 * n, n : 2 * n]).max() < least * slowest:
        return system
    omega = _CHECKED * slowest
    true = direct_response(structure, ports, omega)
    off, size = (np.abs(values).max(axis=2) for values in (system.response(omega, quiet=True) - true, true))
    size = np.maximum(size, VISIBLE * size.max(axis=1, keepdims=True, initial=0.0))
    error = float((off[size > 0.0] / size[size > 0.0]).max(initial=0.0))
    warn_of_rounding("the state space", error, limit)
    return system


def _scaled(system: Lti, ports: Ports, frequencies: Array) -> Lti:
    """Return a system over modes with positions scaled by frequencies, to the magnitude of velocities, by powers of two.

    Rigid-body modes count as fast as the slowest elastic one.
    """
    scale, n, moving = np.ones(len(system.A)), len(frequencies), frequencies > 0.0
    scale[:n] = np.where(moving, frequencies, frequencies[moving].min() if moving.any() else 1.0)
    bandwidths = np.array([b for b in ports.bandwidths if b is not None])
    if len(bandwidths):  # the second state of a filter is driven as fast as it decays, the first by it in turn
        first = len(scale) - 2 * len(bandwidths)
        driven = np.linalg.norm(np.hstack([system.A[:, :first] / scale[:first], system.B])[first + 1 :: 2], axis=1)
        scale[first + 1 :: 2] = bandwidths / np.where(driven > 0.0, driven, bandwidths)
        scale[first::2] = scale[first + 1 :: 2] / bandwidths
    scale = np.exp2(np.round(np.log2(scale)))
    return replace(system, A=scale[:, None] * system.A / scale, B=scale[:, None] * system.B, C=system.C / scale)
