"""Undamped modes, and state spaces over them.

Over nodal coordinates a state matrix holds ``M^-1 K``, whose rounding is that of its stiffest element: 100 elements of a
beam leave the slow modes eight digits, however the states are scaled.  Over modes it holds each frequency once.
"""

from dataclasses import replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance, combined
from boomctl.lti.rounding import EPS, ROOT, VISIBLE, warn_of_rounding
from boomctl.lti.system import Lti
from boomctl.structure.layout import weigh
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import Ports
from boomctl.structure.response.direct import direct_response
from boomctl.structure.response.realization import realize

MODES, COORDINATES = "modes", "coordinates"  # Values of `states`.

SMALL = 60  # Coordinates up to which modes are computed in strain coordinates at once: they cost little more.
# Noise of stiffness over mass, in units of its lowest value, above which shapes from matrices have errors above 1e-10.
GRADED = 30.0
_NOISE = 1e3 * EPS  # Of the largest stiffness over mass: rounding.
_SPREAD = 1e7  # Of stiffnesses, from which on the softest mode counts as nearly floating.
# Ratio to the largest root of a damping up to which that of a rigid-body mode is rounding: strains of such a mode are
# some units of rounding, and a rotation of such modes mixes in the root of rounding.
_UNDAMPED = 1e-8
_OVERDAMPED = 1e3  # Rate of damping over the slowest frequency from which on a state space over modes is checked.
_EVEN = 2.0**10  # Ratio of the balancing scales of a state matrix up to which given matrices keep their coordinates.
_CHECKED = np.array([0.01, 0.7])  # Times the slowest frequency: where it is checked, between no resonances.
_MAX_ROUNDING = 1e-6  # Of a response: rounding of a state space over modes above which a warning is given.


def undamped_modes(structure: Structure, count: int | None = None) -> tuple[Array, Array]:
    """Return the lowest undamped angular frequencies [rad/s], ascending, and mass-normalized mode shapes (columns).

    Small structures with rows, and those whose stiffest element is too stiff for a stiffness matrix in double precision,
    are solved in strain coordinates.  Otherwise the pencil is solved upside down, ``M v = mu (K + alpha M) v``, so that
    the low modes are the largest eigenvalues and keep their digits on fine meshes; a Rayleigh quotient over the strain
    rows mends what rounding is left.  The shift ``alpha``, just above rounding, keeps floating structures definite; where
    one floats, or nearly does, the pencil is solved once more with the shift at its lowest elastic mode, or the softest
    modes would take the others' digits.

    Raises
    ------
    ValueError
        ``M`` is not positive definite, ``K`` not positive semidefinite, or they are not symmetric.
    """
    wanted = structure.n if count is None else min(count, structure.n)
    form = structure.strain_form if structure.n <= SMALL or structure.graded else None
    frequencies, shapes = _inverted_modes(structure, wanted) if form is None else form.modes()
    return frequencies[:wanted], shapes[:, :wanted]


def _inverted_modes(structure: Structure, count: int) -> tuple[Array, Array]:
    """Return the lowest modes from the inverted pencil; where rounding spoils them, all from strains if these are known."""
    M, _, K = structure.matrices
    for name, matrix in (("M", M), ("K", K)):
        if abs(matrix - matrix.T).max() > 1e-9 * abs(matrix).max():
            raise ValueError(f"undamped modes need a symmetric {name}")
    if not (M.diagonal() > 0.0).all():
        raise ValueError("undamped modes need a positive definite M")
    noise = _NOISE * float((np.abs(K.diagonal()) / M.diagonal()).max())
    stiffness, shapes = _near(structure, noise, count)
    elastic = stiffness[stiffness > 0.1 * noise]
    if len(elastic) and (len(elastic) < len(stiffness) or stiffness[-1] > _SPREAD * elastic[0]):
        stiffness, shapes = _near(structure, float(elastic[0]), count)
    if noise > GRADED * max(float(stiffness[0]), 0.0) and structure.strain_form is not None:
        return structure.strain_form.modes()
    return _with_rigid_motions(structure, np.sqrt(np.maximum(stiffness, 0.0)), shapes)


def _with_rigid_motions(structure: Structure, frequencies: Array, shapes: Array) -> tuple[Array, Array]:
    """Return modes, those whose ``v^T K v`` is the rounding of its terms with a frequency of exactly zero.

    The other coordinates of a shape are zero where a coordinate without stiffness moves alone: they contribute nothing to
    the kinetic energy, and the remainder strains nothing.
    """
    slow = np.flatnonzero(frequencies <= ROOT * frequencies.max(initial=0.0))
    if not len(slow):
        return frequencies, shapes
    shape, exact, result = shapes[:, slow], frequencies.copy(), shapes.copy()
    moving = np.where(np.abs(shape) * np.sqrt(structure.M.diagonal())[:, None] > _NOISE, shape, 0.0)
    strained = np.einsum("ij,ij->j", moving, structure.K @ moving)
    terms, left = (np.einsum("ij,ij->j", item, abs(structure.K) @ item) for item in (np.abs(shape), np.abs(moving)))
    alone = strained <= _NOISE * left
    exact[slow[alone | (frequencies[slow] ** 2 <= _NOISE * terms)]] = 0.0
    result[:, slow[alone]] = moving[:, alone]
    return exact, result


def _near(structure: Structure, shift: float, count: int) -> tuple[Array, Array]:
    """Return modal stiffnesses, ascending, and mass-normalized shapes, found with a shift."""
    M, K = structure.M, structure.K
    chosen = None if count == len(M) else (len(M) - count, len(M) - 1)
    try:
        _, vectors = linalg.eigh(M, K + shift * M, subset_by_index=chosen)
    except linalg.LinAlgError:
        raise ValueError("undamped modes need a positive semidefinite K") from None
    vectors = vectors[:, ::-1]
    mass = np.einsum("ij,ij->j", vectors, M @ vectors)
    if not (mass > 0.0).all():
        raise ValueError("undamped modes need a positive definite M")
    shapes = vectors / np.sqrt(mass)
    strain = structure.layout.R @ shapes
    stiffness = np.einsum("ij,ij->j", strain, weigh(structure.weights.k, strain))
    order = np.argsort(stiffness)
    return stiffness[order], shapes[:, order]


def in_modes(structure: Structure, ports: Ports, frequencies: Array, V: Array) -> Lti:
    """Return the state-space form of a structure over undamped modes, projected through its strain rows if it has them.

    What a rigid-body mode strains, what inertia it shares with elastic ones, and where nothing else damps it its damping,
    is zero and not rounding.  Gyroscopic terms stay.
    """
    moved = structure.projected(V, tuple(f"mode{i + 1}" for i in range(V.shape[1])))
    rigid = np.flatnonzero(frequencies == 0.0)
    if not len(rigid):
        return realize(moved, ports.congruent(V))
    M, C, K = (matrix.copy() for matrix in moved.matrices)
    if structure.has_strains:  # its rigid motions that dampers resist are apart from those that nothing resists
        strain, still = structure.layout.R @ V, structure.weights.k == 0.0
        strain[:, rigid], strain[still] = 0.0, combined(structure.layout.R[still], V)
        C = strain.T @ weigh(structure.weights.c, strain)
    else:
        V, C = _resisted(V, C, rigid)
    bending = np.setdiff1d(np.arange(len(frequencies)), rigid)
    M[np.ix_(rigid, bending)], M[np.ix_(bending, rigid)] = 0.0, 0.0
    K[rigid], K[:, rigid] = 0.0, 0.0
    return realize(Structure.of(M, C, K, moved.coordinates), ports.felt(V, rigid))


def _resisted(V: Array, C: Array, rigid: Array) -> tuple[Array, Array]:
    """Return modes and damping with rigid motions that dampers resist apart from those that nothing resists."""
    turning = np.zeros_like(C) if is_symmetric(C) else 0.5 * (C - C.T)  # gyroscopic terms: they resist nothing
    apart, C = np.eye(len(C)), C - turning
    apart[np.ix_(rigid, rigid)] = linalg.eigh(C[np.ix_(rigid, rigid)])[1]
    V, C, turning = V @ apart, apart.T @ C @ apart, apart.T @ turning @ apart
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
    try:
        frequencies, V = undamped_modes(structure)
    except ValueError:
        return realize(structure, ports).balanced()
    return _scaled(in_modes(structure, ports, frequencies, V), ports, frequencies)


def handed_out(structure: Structure, ports: Ports, states: str | None) -> Lti:
    """Return a structure in state space as its user gets it: see :meth:`SecondOrderModel.to_statespace`."""
    if states == COORDINATES:
        return _warned(realize(structure, ports), structure, ports, 0.0, VISIBLE)
    if states is None and structure.settled:
        return realize(structure, ports)
    if states is None and not structure.has_strains:
        own = realize(structure, ports)
        scale = balance(own.A)[1]
        if scale.max() <= _EVEN * scale.min():
            return own
    return _warned(modal_form(structure, ports), structure, ports, _OVERDAMPED, _MAX_ROUNDING)


def _warned(system: Lti, structure: Structure, ports: Ports, least: float, promised: float) -> Lti:
    """Return a system of a small structure with rows; a user is warned where its matrices do not hold the slow motions.

    Beside stiff elements over coordinates, or beside dampers that let a motion creep, a slow motion is a small difference.
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
    share = float((off[size > 0.0] / size[size > 0.0]).max(initial=0.0))
    warn_of_rounding("the state space", share, promised)
    return system


def _scaled(system: Lti, ports: Ports, frequencies: Array) -> Lti:
    """Return a system over modes with places times frequencies, which are as large as speeds, by powers of two.

    Rigid-body modes count as fast as the slowest elastic one.
    """
    scale, n = np.ones(len(system.A)), len(frequencies)
    moving = frequencies > 0.0
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
