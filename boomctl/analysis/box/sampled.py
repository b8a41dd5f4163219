"""Sampled loops over a box of parameters as polynomials of the parameters, for proofs.

From sample to sample the loop is ``x+ = A x + B w``, ``z = C x + D w``: exponentials of the parameters, whose Chebyshev
series converge fast, because over the box the phase of a mode changes by at most a few radians per sample.  The truncation
error of the series is estimated at random points and multiplied by ten.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from boomctl.analysis.box.level import LoopPart
from boomctl.analysis.box.polynomials import Cell, Polynomial, stacked
from boomctl.analysis.loops import joined
from boomctl.arrays import Array, balance
from boomctl.chebyshev import FEW_PARAMETERS, Functions, fitted, points_along, tried_points
from boomctl.lti.rounding import ALIKE, SOLVED
from boomctl.lti.system import Lti, signal_scales
from boomctl.structure.families import Family, Slope
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.realization import realize

# The same for many parameters, where products of parameters of different coordinates are omitted and count as error.
_COUPLED = 1e-6
# Largest number of points in a parameter's range; a wider range is halved, because coefficients of higher powers cancel.
_MOST_POINTS = 20
_MOST_PARTS = 64  # Parts of a box are halved only while it has fewer than this number.
# Ratio of the scales that balance a state matrix above which the scales follow the signals; 1e7 for a spray boom.
_UNEVEN = 1e10
_SPARE_POINTS = 2  # Points in addition to those of the last coefficient above rounding error.
_FAST = "the sampled loop changes too fast over the box"
_SPARE = 10.0  # Factor on the error at the random points that bounds the error everywhere.


def sampled_parts(
    family: Family, K: Lti, inputs: Sequence[str], outputs: Sequence[str], delay: float
) -> list[LoopPart]:
    """Return the loops ``u = K y`` of a discrete controller, in parts that cover the box.

    Without signals the loops have neither inputs nor outputs.

    Raises
    ------
    ValueError
        If the loops change too fast over the box.
    """
    loop_at, size, result = sampled_loops(family, K, inputs, outputs, delay), family.nparameters, []
    waiting, groups = [Cell.whole(size)], _groups(family)
    while waiting:
        cell = waiting.pop()
        at = _matrices(loop_at, cell)
        counts = [points_along(at, axis, _negligible, _MOST_POINTS, _SPARE_POINTS) for axis in np.eye(size)]
        if max(counts) <= _MOST_POINTS:
            result.append(_part(cell, at, counts, K.dt, groups))
        elif np.prod(cell.reach) * _MOST_PARTS > 1.0:
            waiting += cell.halves(int(np.argmax(counts)))
        else:
            raise ValueError(f"{_FAST}: {_MOST_PARTS} parts of it would not be enough")
    return result


def _part(cell: Cell, at: Functions, counts: Sequence[int], dt: float, groups: Sequence[Sequence[int]]) -> LoopPart:
    """Return the loop over a part of the box, interpolated at ``counts`` points of each parameter's range."""
    exact = ALIKE / SOLVED
    terms, off, miss = fitted(at, counts, at(tried_points(len(counts))), _negligible, exact, _FAST, groups)
    if miss > (_COUPLED / SOLVED if groups else exact):
        raise ValueError(f"{_FAST}: polynomials of it miss it by {miss * SOLVED:.2g}")
    A, B, C, D = (terms[letter] for letter in "ABCD")
    off_A, off_B, off_C, off_D = ({(): _SPARE * off[letter]} for letter in "ABCD")
    if len(C) > 1 or len(D) > 1:  # outputs become states, delayed by one sample, which changes no gain
        p, n = C[()].shape
        A, B, off_A, off_B = stacked(A, C, p), stacked(B, D), stacked(off_A, off_C, p), stacked(off_B, off_D)
        C, D = {(): np.eye(p, n + p, n)}, {(): np.zeros_like(D[()])}
    return LoopPart(cell, image(A), B, C[()], D[()], (off_A[()], off_B[()]), dt)


def image(A: Polynomial) -> dict[tuple[int, ...], Array]:
    """Return the pencil ``[A + 1, A - 1]``, which is stable if the eigenvalues of ``A`` are below one in magnitude."""
    eye = np.eye(len(A[()]))
    return {power: np.array([X, X] if power else [X + eye, X - eye]) for power, X in A.items()}


def _groups(family: Family) -> list[list[int]]:
    """Return the parameters of each coordinate of a family with many parameters and uncoupled coordinates; otherwise none.

    From sample to sample such a coordinate depends on its own parameters, unless a controller with feedthrough couples it.
    """
    changes = [change for _, change in family.coefficients]
    matrices = [getattr(item, letter) for item in (family.nominal, *changes) for letter in "MCK"]
    coupled = any((np.diag(np.diag(X)) != X).any() for X in matrices)
    if family.nparameters <= FEW_PARAMETERS or coupled or any(x.B.any() or x.L.any() for x in changes):
        return []
    touched = np.zeros((family.nominal.ncoordinates, family.nparameters))
    for power, change in family.coefficients:
        rows = np.diag(abs(change.M) + abs(change.C) + abs(change.K)) > 0.0
        for i in power:
            touched[rows, i] = 1.0
    count, group = connected_components(touched.T @ touched, directed=False)
    return [np.flatnonzero(group == k).tolist() for k in range(count)]


def sampled_loops(
    family: Family, K: Lti, inputs: Sequence[str], outputs: Sequence[str], delay: float
) -> Callable[[Array], Lti]:
    """Return a function of a point that returns the sampled loop, in states that change smoothly with the parameters.

    Without signals the loop has neither inputs nor outputs.  Ignorable coordinates, such as a hub's angle, are omitted.
    """
    plants, nominal = _in_modes(family), family.nominal
    read = [name for name in nominal.output_labels if name in {*K.input_labels, *outputs}]
    driven = [name for name in nominal.input_labels if name in {*K.output_labels, *inputs}]

    def full(delta: Array) -> Lti:
        plant = plants.at(delta)
        loop = joined(realize(plant.structure, plant.ports.select(driven, read)), K, delay).system
        if outputs:
            return loop.select(inputs, outputs)
        n = len(loop.A)
        return replace(loop, B=np.zeros((n, 1)), C=np.zeros((1, n)), D=np.zeros((1, 1)))

    center = full(np.zeros(family.nparameters))
    eye = np.eye(len(center.A))
    ignorable = [i for i in family._unfelt if (center.A[:, i] == eye[i]).all() and not center.C[:, i].any()]
    states = np.setdiff1d(np.arange(len(eye)), ignorable)

    def at(delta: Array) -> Lti:
        loop = full(delta)
        return Lti(loop.A[np.ix_(states, states)], loop.B[states], loop.C[:, states], loop.D, dt=loop.dt)

    return at


def _in_modes(family: Family) -> Family:
    """Return a family over the modes of its nominal plant, which avoid the cancellation of a fine mesh.

    A family without real modes, or with ignorable coordinates, is returned unchanged.
    """
    center = family.nominal
    try:
        V = undamped_modes(center.structure)[1]
    except ValueError:
        return family
    if family._unfelt:
        return family
    changes = tuple(
        (power, Slope(V.T @ x.M @ V, V.T @ x.C @ V, V.T @ x.K @ V, V.T @ x.B, x.L @ V if x.L.any() else x.L))
        for power, x in family.coefficients
    )
    middle = SecondOrderModel.of(center.structure.projected(V, center.coordinates), center.ports.congruent(V))
    return replace(family, nominal=middle, coefficients=changes)


def _matrices(loop_at: Callable[[Array], Lti], cell: Cell) -> Functions:
    """Return a function of points of a part of a box that returns stacked matrices, balanced at the part's midpoint."""
    middle = loop_at(cell.middle)
    scale = balance(middle.A)[1]
    if scale.max() > _UNEVEN * scale.min():  # the scales of weakly coupled states are arbitrary
        scale = signal_scales(middle.A, middle.B, middle.C)

    def at(points: Sequence[Array]) -> dict[str, Array]:
        loops = [loop_at(cell.point(point)) for point in points]
        A, B, C, D = (np.array([getattr(loop, letter) for loop in loops]) for letter in "ABCD")
        return {"A": A * scale / scale[:, None], "B": B / scale[:, None], "C": C * scale, "D": D}

    return at


def _negligible(stacks: Mapping[str, Array]) -> dict[str, float]:
    return {letter: SOLVED * float(np.abs(stack).max(initial=0.0)) for letter, stack in stacks.items()}
