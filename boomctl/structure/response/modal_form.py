"""State spaces over undamped modes: which modes are elastic, the form itself, and the form in which a model is handed out.

Over nodal coordinates a state matrix holds ``M^-1 K``, whose rounding is that of its stiffest element: 100 elements of a
beam leave the slow modes eight digits, however the states are scaled.  Over modes it holds each frequency once.
"""

from dataclasses import replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import Ports
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.realisation import realize

MODES, COORDINATES = "modes", "coordinates"  # over what the states of a model are

# share of the largest root of a damping up to which that of a rigid-body mode is rounding: strains of such a mode are
# some units of rounding, and a rotation of such modes mixes in the root of rounding
_UNFELT = 1e-8
# ratio of the scales that would balance a state matrix up to which matrices given are realised over their own coordinates
_EVEN = 2.0**10


def elastic(frequencies: Array) -> Array:
    """Return which undamped modes are elastic and not rigid-body ones."""
    return frequencies > 0.0


def in_modes(structure: Structure, ports: Ports, frequencies: Array, V: Array) -> Lti:
    """Return the state-space form of a structure over undamped modes, projected through its strain rows if it has them.

    What a rigid-body mode strains, what inertia it shares with elastic ones, and where nothing else damps it its damping,
    is zero and not rounding.
    """
    names = tuple(f"mode{i + 1}" for i in range(V.shape[1]))
    moved, rigid = structure.projected(V, names), ~elastic(frequencies)
    if rigid.any():
        M, C, K = moved.M.copy(), moved.C.copy(), moved.K.copy()
        M[np.ix_(rigid, ~rigid)], M[np.ix_(~rigid, rigid)] = 0.0, 0.0
        if is_symmetric(C):  # motions that dampers resist apart from those that nothing resists
            apart = np.eye(len(C))
            apart[np.ix_(rigid, rigid)] = linalg.eigh(C[np.ix_(rigid, rigid)])[1]
            V, C = V @ apart, apart.T @ C @ apart
        K[rigid], K[:, rigid] = 0.0, 0.0
        size = np.sqrt(np.abs(np.diag(C)))
        undamped = rigid & (size <= _UNFELT * size.max())
        C[undamped], C[:, undamped] = 0.0, 0.0
        moved = Structure(names, (M, C, K))
    return realize(moved, ports.congruent(V))


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
    if states == COORDINATES or (states is None and structure.settled):
        return realize(structure, ports)
    if states is None and structure.elastic is None:
        own = realize(structure, ports)
        _, (scale, _) = linalg.matrix_balance(own.A, permute=False, separate=True)
        if scale.max() <= _EVEN * scale.min():
            return own
    try:
        frequencies, V = undamped_modes(structure)
    except ValueError:
        return realize(structure, ports).balanced()
    return _scaled(in_modes(structure, ports, frequencies, V), ports, frequencies)


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
