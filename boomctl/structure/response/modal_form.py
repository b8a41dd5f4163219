"""State spaces over undamped modes: which modes are elastic, the form itself, and the form in which a model is handed out.

Over nodal coordinates a state matrix holds ``M^-1 K``, whose rounding is that of its stiffest element: 100 elements of a
beam leave the slow modes eight digits, however the states are scaled.  Over modes it holds each frequency once.
"""

from dataclasses import replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance, combined
from boomctl.lti.rounding import VISIBLE, warn_of_rounding
from boomctl.lti.system import Lti
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import Ports
from boomctl.structure.response.direct import direct_response
from boomctl.structure.response.poles import SMALL, undamped_modes
from boomctl.structure.response.realization import realize
from boomctl.structure.strain_coordinates import parted

MODES, COORDINATES = "modes", "coordinates"  # over what the states of a model are

# share of the largest root of a damping up to which that of a rigid-body mode is rounding: strains of such a mode are
# some units of rounding, and a rotation of such modes mixes in the root of rounding
_UNFELT = 1e-8
# ratio of the scales that would balance a state matrix up to which matrices given are realized over their own coordinates
_EVEN = 2.0**10
# largest rate of damping over the slowest frequency from which on a state space over modes is looked at (a choice)
_OVERDAMPED = 1e3
_ASKED = np.array([0.01, 0.7])  # times the slowest frequency: where a state space is looked at, between no resonances
_PROMISED = 1e-6  # of a response, rounding of a state space over modes above which a user is warned (a choice)


def elastic(frequencies: Array) -> Array:
    """Return which undamped modes are elastic and not rigid-body ones."""
    return frequencies > 0.0


def in_modes(structure: Structure, ports: Ports, frequencies: Array, V: Array) -> Lti:
    """Return the state-space form of a structure over undamped modes."""
    return realize(*over_modes(structure, ports, frequencies, V))


def over_modes(structure: Structure, ports: Ports, frequencies: Array, V: Array) -> tuple[Structure, Ports]:
    """Return a structure and its ports over undamped modes, projected through its strain rows if it has them.

    What a rigid-body mode strains, what inertia it shares with elastic ones, and where nothing else damps it its damping,
    is zero and not rounding.  Gyroscopic terms stay.
    """
    moved = structure.projected(V, tuple(f"mode{i + 1}" for i in range(V.shape[1])))
    rigid = np.flatnonzero(~elastic(frequencies))
    if not len(rigid):
        return moved, ports.congruent(V)
    V, C, K = _resisted(structure, V, moved, rigid)
    M, bending = moved.M.copy(), np.setdiff1d(np.arange(len(frequencies)), rigid)
    M[np.ix_(rigid, bending)], M[np.ix_(bending, rigid)] = 0.0, 0.0
    K[rigid], K[:, rigid] = 0.0, 0.0
    return Structure(moved.coordinates, (M, C, K)), ports.felt(V, rigid)


def _resisted(structure: Structure, V: Array, moved: Structure, rigid: Array) -> tuple[Array, Array, Array]:
    """Return modes, damping and stiffness with rigid motions that dampers resist apart from those that nothing resists."""
    V, C, K, rows = V.copy(), moved.C.copy(), moved.K.copy(), structure.elastic
    if rows is not None:
        strain, still = rows.R @ V, rows.k == 0.0
        dampers = np.sqrt(rows.c[still])[:, None] * rows.R[still]
        apart, free = parted(combined(dampers, V[:, rigid]))
        V[:, rigid] = V[:, rigid] @ apart
        strain[:, rigid], strain[still] = 0.0, combined(rows.R[still], V)
        strain[:, rigid[len(rigid) - free :]] = 0.0
        return V, strain.T @ (rows.c[:, None] * strain), K
    turning = np.zeros_like(C) if is_symmetric(C) else 0.5 * (C - C.T)  # gyroscopic terms: they resist nothing
    apart, C = np.eye(len(C)), C - turning
    apart[np.ix_(rigid, rigid)] = linalg.eigh(C[np.ix_(rigid, rigid)])[1]
    V, C, turning = V @ apart, apart.T @ C @ apart, apart.T @ turning @ apart
    size = np.sqrt(np.abs(np.diag(C)))
    undamped = rigid[size[rigid] <= _UNFELT * size.max()]
    C[undamped], C[:, undamped] = 0.0, 0.0
    return V, C + turning, K


def modal_form(structure: Structure, ports: Ports) -> Lti:
    """Return a state-space system of a structure over all its undamped modes, or, without them, its own coordinates.

    Raises
    ------
    ValueError
        An output that needs a derivative of an input.
    """
    try:
        frequencies, V = undamped_modes(structure)
    except ValueError:
        return realize(structure, ports)
    return in_modes(structure, ports, frequencies, V)


def handed_out(structure: Structure, ports: Ports, states: str | None) -> Lti:
    """Return a structure in state space as its user gets it: see :meth:`SecondOrderModel.to_statespace`."""
    if states == COORDINATES:
        return _warned(realize(structure, ports), structure, ports, VISIBLE)
    if states is None and structure.settled:
        return realize(structure, ports)
    if states is None and structure.elastic is None:
        own = realize(structure, ports)
        scale = balance(own.A)[1]
        if scale.max() <= _EVEN * scale.min():
            return own
    try:
        frequencies, V = undamped_modes(structure)
    except ValueError:
        return realize(structure, ports).balanced()
    system, n = _scaled(in_modes(structure, ports, frequencies, V), ports, frequencies), len(frequencies)
    slowest = frequencies[elastic(frequencies)].min(initial=np.inf)
    overdamped = np.abs(system.A[n : 2 * n, n : 2 * n]).max(initial=0.0) > _OVERDAMPED * slowest
    return _warned(system, structure, ports, _PROMISED) if overdamped else system


def _warned(system: Lti, structure: Structure, ports: Ports, promised: float) -> Lti:
    """Return a system of a small structure with rows; a user is warned where its matrices do not hold the slow motions.

    Beside stiff elements over coordinates, or beside dampers that let a motion creep, a slow motion is a small difference.
    """
    form = structure.strain_form if structure.n <= SMALL else None
    if form is None or not form.strains:
        return system
    omega = _ASKED * form.own_modes[0][form.rigid]
    true = direct_response(structure, ports, omega)
    off, size = (np.abs(values).max(axis=2) for values in (system.response(omega, quiet=True) - true, true))
    size = np.maximum(size, VISIBLE * size.max(axis=1, keepdims=True, initial=0.0))
    share = float((off[size > 0.0] / size[size > 0.0]).max(initial=0.0))
    warn_of_rounding("the state space", share, promised)
    return system


def _scaled(system: Lti, ports: Ports, frequencies: Array) -> Lti:
    """Return a system over modes with places times frequencies, which are as large as speeds, by powers of two.

    Rigid-body modes count as fast as the slowest elastic one.
    """
    scale, n = np.ones(len(system.A)), len(frequencies)
    moving = elastic(frequencies)
    slowest = frequencies[moving].min(initial=np.inf)
    scale[:n] = np.where(moving, frequencies, slowest if np.isfinite(slowest) else 1.0)
    bandwidths = np.array([b for b in ports.bandwidths if b is not None])
    if len(bandwidths):  # the second state of a filter is driven as fast as it decays, the first by it in turn
        first = len(scale) - 2 * len(bandwidths)
        driven = np.linalg.norm(np.hstack([system.A[:, :first] / scale[:first], system.B])[first + 1 :: 2], axis=1)
        scale[first + 1 :: 2] = bandwidths / np.where(driven > 0.0, driven, bandwidths)
        scale[first::2] = scale[first + 1 :: 2] / bandwidths
    scale = np.exp2(np.round(np.log2(scale)))
    return replace(system, A=scale[:, None] * system.A / scale, B=scale[:, None] * system.B, C=system.C / scale)
