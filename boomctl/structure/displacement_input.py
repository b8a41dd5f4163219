"""From force inputs to displacement inputs: support motions, actuator lengths, closed chains.

Source: Anthonis & Ramon (2003), Eqs. (2)-(12) and appendix A, with the signs mended.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from boomctl.arrays import Array, combined
from boomctl.checks import instance, known, mapping, names, truth
from boomctl.structure.elimination import Elimination, eliminate
from boomctl.structure.layout import KEPT, Layout
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.outline import mapped
from boomctl.structure.ports import Ports
from boomctl.threads import one_blas_thread
from boomctl.units import motion_unit

MOTIONS = ("displacement", "velocity", "acceleration")


@one_blas_thread
def prescribe_displacement(
    model: SecondOrderModel,
    inputs: str | Sequence[str] = (),
    hold: str | Sequence[str] = (),
    motion: str | Mapping[str, str] = "displacement",
    reactions: bool = False,
) -> SecondOrderModel:
    """Turn force inputs into imposed motions of the points they act on.

    A force between two bodies becomes their relative motion.  Source: Anthonis & Ramon (2003); the forces are their Eq.
    (7).

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
    TypeError, ValueError
        Another kind of model; unknown names; displacements that depend on each other; a model with displacement inputs
        already: all are to be prescribed in one call.

    Examples
    --------
    >>> import boomctl as bc
    >>> driven = bc.spray_boom(excitation="force")
    >>> held = bc.structure.prescribe_displacement(driven, ["actuator_left", "actuator_right"])
    >>> driven.ncoordinates, held.ncoordinates  # two coordinates are given now
    (16, 14)
    >>> held.eigenfrequencies_hz(2).round(3)
    array([0.245, 0.587])
    """
    there = instance("model", model, SecondOrderModel).input_labels
    moved, held = names("input", inputs, there), names("input", hold, there)
    both, reactions = moved + held, truth("reactions", reactions)
    for name in both:
        if both.count(name) > 1:
            raise ValueError(f"the displacement of {name!r} is prescribed twice")
    orders = _orders(moved, motion)
    if not both:
        return model
    if any(model.ports.moved):
        there = [name for name, is_moved in zip(model.input_labels, model.ports.moved, strict=True) if is_moved]
        raise ValueError(f"inputs {there} impose motion already: prescribe all displacements in one call")
    J = np.column_stack([model.ports.force_column(name) for name in both])
    if len(both) >= model.ncoordinates:
        raise ValueError(
            f"{len(both)} displacements are prescribed in a model of {model.ncoordinates} coordinates: nothing moves"
        )
    old = model.structure
    if old.layout is None or old.weights is None:
        choice = eliminate(J, both)
        moving, imposed = _Side(choice.T_q), _Side(choice.T_d)
        M, C, K = (choice.T_q.T @ (matrix @ choice.T_q) for matrix in (old.M, old.C, old.K))
        names_left = tuple(old.coordinates[i] for i in choice.independent)
        mirror = None if old.mirror is None else old.mirror.restricted(choice)
        structure = Structure(names_left, (M, C, K), mirror=mirror, outline=mapped(old.outline, choice.T_q))
    else:
        choice, layout, imposed = _eliminated(old.layout, both, J.tobytes())
        moving, mirror = _Side(choice.T_q, layout), None if old.mirror is None else layout.mirror
        structure = Structure.weighed(layout, old.weights, mirror, mapped(old.outline, choice.T_q))
    ports = _Prescribed(old, model.ports, moving, imposed, moved, held).ports(orders, reactions)
    return SecondOrderModel.of(structure, ports)


@lru_cache(maxsize=KEPT)
def _eliminated(layout: Layout, names: tuple[str, ...], columns: bytes) -> tuple[Elimination, Layout, "_Side"]:
    """Return what imposing motion at the columns of ``names`` makes of rows, whatever the structure weighs."""
    choice = eliminate(np.frombuffer(columns).reshape(layout.n, len(names)), names)
    over_imposed = Layout(names, layout.N @ choice.T_d, layout.R @ choice.T_d)
    return choice, layout.eliminated(choice), _Side(choice.T_d, over_imposed)


def _orders(moved: tuple[str, ...], motion: str | Mapping[str, str]) -> dict[str, int]:
    """Return how often each input is integrated before it is a displacement."""
    if isinstance(motion, str):
        return dict.fromkeys(moved, MOTIONS.index(known("motion", motion, MOTIONS)))
    for name in mapping("motion", motion, "inputs to motions"):
        known("input", name, moved)
    return {name: MOTIONS.index(known("motion", motion.get(name, "displacement"), MOTIONS)) for name in moved}


@dataclass(frozen=True, eq=False)
class _Side:
    """A group of coordinates, ``q = T z``: those that still move, or the imposed displacements; rows over them if known."""

    T: Array
    layout: Layout | None = None


@dataclass(frozen=True)
class _Prescribed:
    """Which force inputs of a structure become motions (``moved``) or are held (``held``), and what is eliminated."""

    structure: Structure
    old: Ports
    moving: _Side
    imposed: _Side
    moved: tuple[str, ...]
    held: tuple[str, ...]

    @property
    def kept(self) -> tuple[str, ...]:
        """Inputs that stay, in their old order."""
        return tuple(name for name in self.old.inputs if name not in self.held)

    def blocks(self, left: _Side, right: _Side) -> Array:
        """Return the blocks of ``K, C, M`` between two groups, one of them imposed; from rows, so that rounding is small."""
        weights = self.structure.weights
        if weights is None or left.layout is None or right.layout is None:
            matrices = self.structure.K, self.structure.C, self.structure.M
            return np.array([left.T.T @ matrix @ right.T for matrix in matrices])
        if right is self.moving:
            return self.blocks(right, left).transpose(0, 2, 1)
        R, N = left.layout.R.T, left.layout.N.T
        return np.array(
            [
                R @ (weights.k[:, None] * right.layout.R),
                R @ (weights.c[:, None] * right.layout.R),
                N @ (weights.m[:, None] * right.layout.N),
            ]
        )

    def ports(self, orders: Mapping[str, int], reactions: bool) -> Ports:
        """Return the ports of the displacement-driven structure, inputs in their old order."""
        old, kept, T_d = self.old, self.kept, self.imposed.T
        force = (old if kept == old.inputs else old.select(kept, None)).restricted(self.moving.T)
        B, L, E = force.B.copy(), force.L, force.E.copy()
        places = [kept.index(name) for name in self.moved]
        B[:, :, places] = -self.blocks(self.moving, self.imposed)[:, :, : len(places)]
        E[:, :, places] = combined(old.L.reshape(-1, len(T_d)), T_d[:, : len(places)]).reshape(
            *E.shape[:2], len(places)
        )
        outputs, bandwidths, both = old.outputs, old.bandwidths, self.moved + self.held
        felt = old.E[0][:, [old.inputs.index(name) for name in both]]
        tensions, strains = old.tensions, None
        if self.imposed.layout is not None:
            strains = np.zeros((len(self.imposed.layout.R), len(kept)))
            strains[:, places] = self.imposed.layout.R[:, : len(places)]
        if reactions or felt.any():
            force_L, force_E = self.reactions()
            L, E = L + felt @ force_L, E + felt @ force_E
            if self.imposed.layout is not None:
                read = self.imposed.layout.R.T
                tensions = felt @ read + (0.0 if tensions is None else tensions)
                tensions = np.concatenate([tensions, read]) if reactions else tensions
            if reactions:
                L, E = np.concatenate([L, force_L], axis=1), np.concatenate([E, force_E], axis=1)
                outputs = outputs + tuple(f"{name}_force" for name in both)
                bandwidths = bandwidths + (None,) * len(both)
        units = dict(old.units)
        for name in both:
            if name in old.units:
                units[f"{name}_force"] = old.units[name]
                units[name] = motion_unit(old.units[name] == "N m", orders.get(name, 0))
        return replace(
            old,
            units=units,
            inputs=kept,
            outputs=outputs,
            B=B,
            L=L,
            E=E,
            moved=tuple(name in self.moved for name in kept),
            integrators=tuple(orders.get(name, 0) for name in kept),
            bandwidths=bandwidths,
            strains=strains,
            tensions=tensions,
        )

    def reactions(self) -> tuple[Array, Array]:
        """Return the rows of Eq. (7), upper part: ``f_p = M_dd d'' + M_dq q'' + ... - F_d f``."""
        kept, T_d = self.kept, self.imposed.T
        E = -(T_d.T @ self.old.select(kept, None).B)
        places = [kept.index(name) for name in self.moved]
        E[:, :, places] = self.blocks(self.imposed, self.imposed)[:, :, : len(places)]
        return self.blocks(self.imposed, self.moving), E
