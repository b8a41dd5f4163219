"""From force inputs to displacement inputs: support motions, actuator lengths, closed chains.

Source: Anthonis & Ramon (2003), Eqs. (2)-(12) and appendix A, with the signs mended.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from boomctl.arrays import Array, Matrix
from boomctl.checks import known
from boomctl.structure.elimination import Elimination, eliminate
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
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
    choice, old = eliminate(J, both), model.structure
    T_q, elastic, mirror = choice.T_q, None, None
    if old.elastic is not None:
        elastic = old.elastic.congruent(T_q)
    if old.mirror is not None:
        mirror = old.mirror.restricted(choice)
    structure = Structure.of(
        _congruent(old.M, T_q),
        _congruent(old.C, T_q) if elastic is None else elastic.C,
        _congruent(old.K, T_q) if elastic is None else elastic.K,
        tuple(old.coordinates[i] for i in choice.independent),
        elastic=elastic,
        mirror=mirror,
    )
    return SecondOrderModel.of(structure, _Prescribed(old, model.ports, choice, moved, held).ports(orders, reactions))


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


@dataclass(frozen=True)
class _Prescribed:
    """Which force inputs of a structure become motions (``moved``) or are held (``held``), and what is eliminated."""

    structure: Structure
    old: Ports
    choice: Elimination
    moved: tuple[str, ...]
    held: tuple[str, ...]

    @property
    def kept(self) -> tuple[str, ...]:
        """Inputs that stay, in their old order."""
        return tuple(name for name in self.old.inputs if name not in self.held)

    def blocks(self, left: sparse.csr_array, right: sparse.csr_array) -> Triple:
        """Return the blocks of ``K, C, M`` between two groups of coordinates, rounding kept small by the strain rows."""
        K, C, M, rows = self.structure.K, self.structure.C, self.structure.M, self.structure.elastic
        if rows is None:
            return _driven(K, left, right), _driven(C, left, right), _driven(M, left, right)
        R_left, R_right = sparse.csr_array(rows.R @ left), sparse.csr_array(rows.R @ right)

        def block(weight: Array) -> Array:
            return np.asarray((R_left.T @ sparse.diags_array(weight) @ R_right).toarray())

        return block(rows.k), block(rows.c), _driven(M, left, right)

    def ports(self, orders: Mapping[str, int], reactions: bool) -> Ports:
        """Return the ports of the displacement-driven structure, inputs in their old order."""
        old, kept, T_d = self.old, self.kept, self.choice.T_d
        force = old.select(kept, None).congruent(self.choice.T_q)
        B, L, E = [b.copy() for b in force.B], list(force.L), [e.copy() for e in force.E]
        driven = self.blocks(self.choice.T_q, T_d)
        for k in range(3):
            for j, name in enumerate(self.moved):
                i = kept.index(name)
                B[k][:, i] = -driven[k][:, j]
                E[k][:, i] = old.L[k] @ T_d[:, [j]].toarray()[:, 0]
        outputs, bandwidths, both = old.outputs, old.bandwidths, self.moved + self.held
        felt = old.E[0][:, [old.inputs.index(name) for name in both]]
        if reactions or felt.any():
            force_L, force_E = self.reactions()
            L = [L[k] + felt @ force_L[k] for k in range(3)]
            E = [E[k] + felt @ force_E[k] for k in range(3)]
            if reactions:
                L, E = (
                    [np.vstack(pair) for pair in zip(*pairs, strict=True)] for pairs in ((L, force_L), (E, force_E))
                )
                outputs = outputs + tuple(f"{name}_force" for name in both)
                bandwidths = bandwidths + (None,) * len(both)
        return replace(
            old,
            inputs=kept,
            outputs=outputs,
            B=(B[0], B[1], B[2]),
            L=(L[0], L[1], L[2]),
            E=(E[0], E[1], E[2]),
            moved=tuple(name in self.moved for name in kept),
            integrators=tuple(orders.get(name, 0) for name in kept),
            bandwidths=bandwidths,
        )

    def reactions(self) -> tuple[list[Array], list[Array]]:
        """Return the rows of Eq. (7), upper part: ``f_p = M_dd d'' + M_dq q'' + ... - F_d f``."""
        T_d, kept = self.choice.T_d, self.kept
        with_d, with_q = self.blocks(T_d, T_d), self.blocks(T_d, self.choice.T_q)
        E = []
        for k, acting in enumerate(self.old.select(kept, None).B):
            feed = -(T_d.T @ acting)
            for j, name in enumerate(self.moved):
                feed[:, kept.index(name)] = with_d[k][:, j]
            E.append(feed)
        return list(with_q), E
