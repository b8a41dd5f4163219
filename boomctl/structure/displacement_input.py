"""From force inputs to displacement inputs: support motions, actuator lengths, closed chains.

Source: Anthonis & Ramon (2003), Eqs. (2)-(12) and appendix A, with the signs mended.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import sparse

from boomctl.arrays import Array, Matrix
from boomctl.checks import known
from boomctl.structure.elimination import Elimination, eliminate
from boomctl.structure.model import ElasticRows, SecondOrderModel
from boomctl.structure.ports import Ports, Triple

MOTIONS = ("displacement", "velocity", "acceleration")


def prescribe_displacement(
    model: SecondOrderModel,
    inputs: str | Sequence[str] = (),
    hold: str | Sequence[str] = (),
    motion: str | Mapping[str, str] = "displacement",
    reactions: bool = False,
) -> SecondOrderModel:
    """Turn force inputs into motions of the points (or relative motions of the pairs of points) that they act on.

    Parameters
    ----------
    model : SecondOrderModel
        The structure, driven by forces.
    inputs : str or sequence of str
        Force inputs whose displacement becomes the input; they keep their names.
    hold : str or sequence of str
        Force inputs whose displacement is held at zero, as in a kinematic chain that is closed again; these inputs go.
    motion : "displacement", "velocity" or "acceleration", or mapping from input to one of these
        What the user imposes at ``inputs``.
    reactions : bool
        Add outputs ``name_force``: the forces needed to impose the motions of ``inputs`` and ``hold``, Eq. (7).

    Returns
    -------
    SecondOrderModel
        Of ``len(inputs) + len(hold)`` coordinates fewer, with the same outputs, other force inputs kept.

    Raises
    ------
    ValueError
        Unknown names, displacements that depend on each other, or a model with displacement inputs already: all are to
        be prescribed in one call.
    """
    moved = (inputs,) if isinstance(inputs, str) else tuple(inputs)
    held = (hold,) if isinstance(hold, str) else tuple(hold)
    both = moved + held
    for name in both:
        if both.count(name) > 1:
            raise ValueError(f"the displacement of {name!r} is prescribed twice")
    orders = _orders(moved, motion)
    if not both:
        return model
    if any(model.ports.moved):
        there = [name for name, is_moved in zip(model.inputs, model.ports.moved, strict=True) if is_moved]
        raise ValueError(f"inputs {there} impose motion already: prescribe all displacements in one call")
    J = np.column_stack([model.ports.force_column(name) for name in both])
    if len(both) >= model.n:
        raise ValueError(f"{len(both)} displacements are prescribed in a model of {model.n} coordinates: nothing moves")
    choice = eliminate(J, both)
    ports = _ports(model, choice, moved, held, orders, reactions)
    T_q = choice.T_q
    elastic = model.elastic.congruent(T_q) if model.elastic is not None else None
    M = _congruent(model.M, T_q)
    K = elastic.K if elastic is not None else _congruent(model.K, T_q)
    C = elastic.C if elastic is not None else _congruent(model.C, T_q)
    mirror = model.mirror.restricted(choice) if model.mirror is not None else None
    coordinates = tuple(model.coordinates[i] for i in choice.independent)
    return SecondOrderModel.build(M, C, K, ports, coordinates, elastic, mirror, model.primary)


def _orders(moved: tuple[str, ...], motion: str | Mapping[str, str]) -> dict[str, int]:
    """Return how often each input is integrated before it is a displacement."""
    if isinstance(motion, str):
        return dict.fromkeys(moved, MOTIONS.index(known("motion", motion, MOTIONS)))
    for name in motion:
        known("input", name, moved)
    return {name: MOTIONS.index(known("motion", motion.get(name, "displacement"), MOTIONS)) for name in moved}


def _congruent(matrix: Matrix, T: sparse.csr_array) -> Matrix:
    if sparse.issparse(matrix):
        return sparse.csr_array(T.T @ matrix @ T)
    return np.asarray(T.T @ (T.T @ matrix.T).T)


def _driven(matrix: Matrix, left: sparse.csr_array, right: sparse.csr_array) -> Array:
    """Return ``left^T matrix right``, dense; ``right`` or ``left`` has few columns."""
    return np.asarray((left.T @ sparse.csr_array(matrix @ right)).toarray())


def _blocks(model: SecondOrderModel, left: sparse.csr_array, right: sparse.csr_array) -> Triple:
    """Return the blocks of ``K, C, M`` between two groups of coordinates, rounding kept small by the strain rows."""
    if model.elastic is None:
        return tuple(_driven(matrix, left, right) for matrix in (model.K, model.C, model.M))  # type: ignore[return-value]
    rows: ElasticRows = model.elastic
    R_left, R_right = sparse.csr_array(rows.R @ left), sparse.csr_array(rows.R @ right)

    def block(weight: Array) -> Array:
        return np.asarray((R_left.T @ sparse.diags_array(weight) @ R_right).toarray())

    return block(rows.k), block(rows.c), _driven(model.M, left, right)


def _ports(
    model: SecondOrderModel,
    choice: Elimination,
    moved: tuple[str, ...],
    held: tuple[str, ...],
    orders: Mapping[str, int],
    reactions: bool,
) -> Ports:
    """Return the ports of the displacement-driven model, inputs in their old order."""
    old = model.ports
    T_d, T_q = choice.T_d, choice.T_q
    place = {name: j for j, name in enumerate(moved)}
    kept = tuple(name for name in old.inputs if name not in held)
    force = old.select(kept, None).congruent(T_q)
    B, E = [b.copy() for b in force.B], [e.copy() for e in force.E]
    driven = _blocks(model, T_q, T_d)
    for k in range(3):
        for i, name in enumerate(kept):
            if name in place:
                B[k][:, i] = -driven[k][:, place[name]]
                E[k][:, i] = old.L[k] @ T_d[:, [place[name]]].toarray()[:, 0]
    L = list(force.L)
    outputs, bandwidths = old.outputs, old.bandwidths
    felt = old.E[0][:, [old.inputs.index(name) for name in moved + held]]
    if reactions or felt.any():
        force_L, force_E = _reactions(model, choice, kept, place)
        L = [L[k] + felt @ force_L[k] for k in range(3)]
        E = [E[k] + felt @ force_E[k] for k in range(3)]
        if reactions:
            L, E = ([np.vstack(pair) for pair in zip(*both, strict=True)] for both in ((L, force_L), (E, force_E)))
            outputs = outputs + tuple(f"{name}_force" for name in moved + held)
            bandwidths = bandwidths + (None,) * len(moved + held)
    return Ports(
        kept,
        outputs,
        (B[0], B[1], B[2]),
        (L[0], L[1], L[2]),
        (E[0], E[1], E[2]),
        tuple(name in place or old.moved[old.inputs.index(name)] for name in kept),
        tuple(orders[name] if name in place else old.integrators[old.inputs.index(name)] for name in kept),
        bandwidths,
    )


def _reactions(
    model: SecondOrderModel, choice: Elimination, kept: tuple[str, ...], place: dict[str, int]
) -> tuple[list[Array], list[Array]]:
    """Return the rows of Eq. (7), upper part: ``f_p = M_dd d'' + M_dq q'' + ... - F_d f``."""
    with_d, with_q = _blocks(model, choice.T_d, choice.T_d), _blocks(model, choice.T_d, choice.T_q)
    old = model.ports.select(kept, None)
    L, E = [], []
    for k in range(3):
        feed = -(choice.T_d.T @ old.B[k])
        for i, name in enumerate(kept):
            if name in place:
                feed[:, i] = with_d[k][:, place[name]]
        L.append(with_q[k])
        E.append(feed)
    return L, E
