"""Structure-preserving reduction: the strongest undamped modes of a structure, the others as they are at rest.

A symmetric projection leaves mass, damping and stiffness definite, so that the reduced structure is stable and passive
whatever modes it keeps.  What the other modes add is bounded beforehand, and the error is measured.
"""

from dataclasses import replace
from math import inf

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.modal import spectral_parts
from boomctl.lti.system import Lti
from boomctl.reduction.core import LARGEST_DENSE, SystemCore, core_of, loads_of
from boomctl.reduction.left_out import left_out_bound
from boomctl.reduction.result import ReductionError
from boomctl.reduction.selection import Attempt, Band, verified
from boomctl.reduction.structural_tail import Loads
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import evaluate
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.realisation import realize

_RIGID = 1e-8
_SAME = 1e-6
_MOMENTS = 4


def reduced_structure(
    model: SecondOrderModel, order: int | None, error: float | None, modes: int, band: Band | None
) -> tuple[SecondOrderModel, SystemCore, Attempt]:
    """Return a structure of fewer coordinates, the core it was compared with, and how it compares.

    Parameters
    ----------
    model : SecondOrderModel
    order : int or None
        Number of states wanted: two a coordinate, an even number.
    error : float or None
        Instead: the largest verified error that will do.
    modes : int
        How many undamped modes to choose from.
    band : (float, float) or None

    Raises
    ------
    ValueError
        An odd order, one of fewer states than the rigid-body modes have, or matrices without real modes.
    ReductionError
        No choice among these modes has so small an error, or an error could not be verified.
    """
    core = core_of(model, modes)
    all_frequencies, all_modes = undamped_modes(model.structure, model.n if model.n <= LARGEST_DENSE else modes)
    frequencies, V = all_frequencies[:modes], all_modes[:, :modes]
    rigid = int((frequencies <= _RIGID * frequencies[-1]).sum())
    ranking = _ranking(model, frequencies, V, band)
    if order is not None:
        if order % 2 or order < 2 * max(rigid, 1):
            least = 2 * max(rigid, 1)
            raise ValueError(f"order = {order}: expected an even number, two states a coordinate, at least {least}")
        smaller = _projected(model, frequencies, V, ranking[: order // 2], rigid, band)
        bound = _bound(model, all_frequencies, all_modes, smaller, ranking[: order // 2])
        return smaller, core, _compared(core, smaller, band, bound)
    best = inf
    for count in range(max(rigid, 1), len(ranking) + 1):
        smaller = _projected(model, frequencies, V, ranking[:count], rigid, band)
        found = _compared(core, smaller, band, inf)
        best = min(best, found.measured)
        if found.measured <= (error or 0.0):
            bound = _bound(model, all_frequencies, all_modes, smaller, ranking[:count])
            return smaller, core, _compared(core, smaller, band, bound)
    raise ReductionError(f"error = {error:g}: the smallest verified error of {len(ranking)} modes is {best:.4g}")


def _ranking(model: SecondOrderModel, frequencies: Array, V: Array, band: Band | None) -> Array:
    """Return the modes, strongest first: by the height of their peak, or by the most they reach within the band."""
    at = frequencies if band is None else np.clip(frequencies, *band)
    C = model.structure.projected(V).C
    s = 1j * at
    acting = np.array([np.linalg.norm(b.T @ v) for b, v in zip(evaluate(model.ports.B, s), V.T, strict=True)])
    reading = np.array([np.linalg.norm(line @ v) for line, v in zip(evaluate(model.ports.L, s), V.T, strict=True)])
    stiffness = np.abs(frequencies**2 - at**2 + 1j * at * np.diag(C))
    with np.errstate(divide="ignore", invalid="ignore"):
        strength = np.where(stiffness > 0.0, acting * reading / stiffness, inf)
    strength[frequencies <= _RIGID * frequencies[-1]] = inf
    return np.argsort(-strength, kind="stable")


def _projected(
    model: SecondOrderModel, frequencies: Array, V: Array, chosen: Array, rigid: int, band: Band | None
) -> SecondOrderModel:
    """Return the structure in the modes chosen, outputs with the static share of the others.

    With a band the others' share is that in its middle; of modes within the band there is none.
    """
    kept = np.sort(chosen)
    rest = np.setdiff1d(np.arange(rigid, V.shape[1]), kept)
    stiffness = frequencies[rest] ** 2
    if band is not None:
        inside = (frequencies[rest] >= band[0]) & (frequencies[rest] <= band[1])
        centre = np.sqrt(max(band[0], 0.01 * band[1]) * band[1])
        stiffness = np.where(inside, inf, stiffness - centre**2)
    static = (model.ports.L[0] @ V[:, rest] / stiffness) @ (V[:, rest].T @ model.ports.B[0])
    ports = model.ports.congruent(V[:, kept])
    E = ports.E[0] + static, ports.E[1], ports.E[2]
    names = tuple(f"mode{i + 1}" for i in kept)
    return SecondOrderModel.of(model.structure.projected(V[:, kept], names), replace(ports, E=E))


def _bound(
    model: SecondOrderModel, frequencies: Array, modes: Array, smaller: SecondOrderModel, chosen: Array
) -> float:
    """Return a bound of the error: what the other modes add at most, and the static share that stands for them.

    ``inf`` for a structure too large for all of its modes, or one that reads more than displacements.
    """
    loads = loads_of(model)
    if loads is None or modes.shape[1] < model.n:
        return inf
    kept = np.zeros(model.n, dtype=bool)
    kept[chosen] = True
    C = model.structure.projected(modes).C
    on_modes = Loads(modes.T @ loads.B0, modes.T @ loads.B1, loads.L @ modes)
    static = smaller.ports.E[0] - model.ports.E[0]
    return left_out_bound(frequencies**2, C, on_modes, kept) + float(np.linalg.norm(static, 2))


def _compared(core: SystemCore, smaller: SecondOrderModel, band: Band | None, bound: float) -> Attempt:
    stable, kept = spectral_parts(realize(smaller.structure, smaller.ports).balanced())
    if not _same(core.kept, kept):
        raise ReductionError(
            f"{len(core.kept.A)} unstable, undamped or rigid-body states do not come out as they went in "
            f"({len(kept.A)} in the reduced structure): damping couples them to modes that are left out"
        )
    return verified(core, stable, bound + core.tail, band)


def _same(one: Lti, other: Lti) -> bool:
    """Return whether two small systems have equal Markov parameters."""
    if len(one.A) != len(other.A):
        return False
    for k in range(_MOMENTS):
        a, b = (system.C @ np.linalg.matrix_power(system.A, k) @ system.B for system in (one, other))
        size = [np.linalg.norm(s.C) * np.linalg.norm(s.A) ** k * np.linalg.norm(s.B) for s in (one, other)]
        if np.abs(a - b).max(initial=0.0) > _SAME * max(np.abs(a).max(initial=0.0), 1e-9 * max(size)):
            return False
    return True
