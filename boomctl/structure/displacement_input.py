"""From force inputs to displacement inputs: support motions, actuator lengths, closed chains.

Source: Anthonis & Ramon (2003), Eqs. (2)-(12) and appendix A, with corrected signs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from boomctl.arrays import Array, combined
from boomctl.checks import instance, known, mapping, names, truth
from boomctl.structure.elimination import Elimination, eliminate
from boomctl.structure.layout import CACHE_SIZE, Layout, Weights, weigh
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
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
        Force inputs whose displacement is held at zero, as in a closed kinematic chain; these inputs are removed.
    motion : "displacement", "velocity" or "acceleration", or mapping from input to one of these
        Quantity that is imposed at ``inputs``.
    reactions : bool
        Add outputs ``name_force``: the forces needed to impose the motions of ``inputs`` and ``hold``, Eq. (7).

    Returns
    -------
    SecondOrderModel
        Model with ``len(inputs) + len(hold)`` coordinates fewer, and the same outputs and other force inputs.

    Raises
    ------
    TypeError, ValueError
        If `model` has another type or already has displacement inputs (prescribe all in one call), if a name is unknown, or
        if displacements depend on each other.

    Examples
    --------
    >>> import boomctl as bc
    >>> driven = bc.spray_boom(excitation="force")
    >>> held = bc.structure.prescribe_displacement(driven, ["actuator_left", "actuator_right"])
    >>> driven.ncoordinates, held.ncoordinates  # two coordinates are prescribed
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
        already = [name for name, is_moved in zip(there, model.ports.moved, strict=True) if is_moved]
        raise ValueError(f"inputs {already} impose motion already: prescribe all displacements in one call")
    if len(both) >= model.ncoordinates:
        raise ValueError(
            f"{len(both)} displacements are prescribed in a model of {model.ncoordinates} coordinates: nothing moves"
        )
    old, ports = model.structure, model.ports
    lines = np.concatenate([ports.B.transpose(0, 2, 1).reshape(-1, old.n), ports.L.reshape(-1, old.n)])
    prescribed = tuple(there.index(name) for name in both)
    choice, layout, imposed, *over = _eliminated(old.layout, both, prescribed, lines.tobytes())
    outline = old.outline and replace(old.outline, maps=(*old.outline.maps, choice.T_q))
    structure = Structure(layout, old.weights, outline)
    forces = [partial(_imposing_forces, old.weights, imposed, rows) for rows in (layout, imposed)]
    strains = imposed.R if old.has_strains else None
    ports = _prescribed(ports, choice.T_d, over, strains, forces, moved, held, orders, reactions)
    return SecondOrderModel.of(structure, ports)


@lru_cache(maxsize=CACHE_SIZE)
def _eliminated(
    layout: Layout, names: tuple[str, ...], prescribed: tuple[int, ...], lines: bytes
) -> tuple[Elimination, Layout, Layout, Array, Array]:
    """Return the elimination of the lines prescribed, called ``names``, and rows over independent and imposed coordinates.

    The last two are the lines over these coordinates.
    """
    rows = np.frombuffer(lines).reshape(-1, layout.n)
    choice = eliminate(np.ascontiguousarray(rows[list(prescribed)].T), names)
    imposed = Layout(names, layout.N @ choice.T_d, layout.R @ choice.T_d)
    moving = combined(rows, choice.T_q)
    moving.setflags(write=False)  # shared by models
    return choice, layout.eliminated(choice), imposed, moving, combined(rows, choice.T_d)


def _orders(moved: tuple[str, ...], motion: str | Mapping[str, str]) -> dict[str, int]:
    """Return how often each input is integrated before it is a displacement."""
    if isinstance(motion, str):
        return dict.fromkeys(moved, MOTIONS.index(known("motion", motion, MOTIONS)))
    for name in mapping("motion", motion, "inputs to motions"):
        known("input", name, moved)
    return {name: MOTIONS.index(known("motion", motion.get(name, "displacement"), MOTIONS)) for name in moved}


def _imposing_forces(weights: Weights, imposed: Layout, moving: Layout) -> Array:
    """Return blocks ``K, C, M`` of coordinates: moving by imposed."""
    pairs = (moving.R, imposed.R, weights.k), (moving.R, imposed.R, weights.c), (moving.N, imposed.N, weights.m)
    return np.array([rows.T @ weigh(weight, over) for rows, over, weight in pairs])


def _prescribed(
    old: Ports,
    T_d: Array,
    over: Sequence[Array],
    imposed: Array | None,
    forces: Sequence[Callable[[], Array]],
    moved: tuple[str, ...],
    held: tuple[str, ...],
    orders: Mapping[str, int],
    reactions: bool,
) -> Ports:
    """Return the ports of the displacement-driven structure: ``moved`` become motions, ``held`` are removed.

    ``over`` are the lines of inputs and outputs over the independent and the imposed coordinates, ``imposed`` elastic rows
    over the latter, ``forces`` the functions of the forces on either.
    """
    remaining, both = tuple(name for name in old.inputs if name not in held), moved + held
    columns, stay = [remaining.index(name) for name in moved], [old.inputs.index(name) for name in remaining]
    (_, n, m), p, across = old.B.shape, len(old.outputs), forces[0]()
    B = over[0][: 3 * m].reshape(3, m, n - len(both))[:, stay].transpose(0, 2, 1)
    L, E = over[0][3 * m :].reshape(3, p, n - len(both)), old.E[:, :, stay]
    B[:, :, columns] = -across[:, :, : len(columns)]
    E[:, :, columns] = over[1][3 * m :, : len(columns)].reshape(3, p, len(columns))
    outputs, bandwidths = old.outputs, old.bandwidths
    direct = old.E[0][:, [old.inputs.index(name) for name in both]]
    tensions, strains = old.tensions, None
    if imposed is not None:
        strains = np.zeros((len(imposed), len(remaining)))
        strains[:, columns] = imposed[:, : len(columns)]
    if reactions or direct.any():  # Rows of Eq. (7), upper part: f_p = M_dd d'' + M_dq q'' + ... - F_d f.
        force_L, force_E = across.transpose(0, 2, 1), -(T_d.T @ old.B[:, :, stay])
        force_E[:, :, columns] = forces[1]()[:, :, : len(columns)]
        L, E = L + direct @ force_L, E + direct @ force_E
        if imposed is not None:
            tensions = direct @ imposed.T + (0.0 if tensions is None else tensions)
            tensions = np.concatenate([tensions, imposed.T]) if reactions else tensions
        if reactions:
            L, E = np.concatenate([L, force_L], axis=1), np.concatenate([E, force_E], axis=1)
            outputs, bandwidths = outputs + tuple(f"{name}_force" for name in both), bandwidths + (None,) * len(both)
    units = dict(old.units)
    for name in both:
        if name in old.units:
            units[f"{name}_force"] = old.units[name]
            units[name] = motion_unit(old.units[name] == "N m", orders.get(name, 0))
    return replace(
        old,
        units=units,
        inputs=remaining,
        outputs=outputs,
        B=B,
        L=L,
        E=E,
        moved=tuple(name in moved for name in remaining),
        integrators=tuple(orders.get(name, 0) for name in remaining),
        bandwidths=bandwidths,
        strains=strains,
        tensions=tensions,
    )
