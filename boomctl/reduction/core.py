"""Small systems that stand for large ones: a core in state space, and a bound of what it leaves out."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import ModalSystem, diagonalized, spectral_parts
from boomctl.lti.system import Lti, state_matrices
from boomctl.reduction.structural_tail import Loads, separated_damping, tail_bound
from boomctl.structure.matrices import halves
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.realisation import realize

if TYPE_CHECKING:
    import control

_CORE_FROM = 40
LARGEST_DENSE = 700
_MANY_STATES = 80
_ALL_MODES = 0.8


@dataclass(frozen=True)
class SystemCore:
    """A system as a stable part and a kept part.

    Attributes
    ----------
    stable : Lti
        In real modal coordinates where it has them; ``D`` of the system included.
    modal : ModalSystem or None
        The same in complex modal coordinates.
    kept : Lti
        Unstable, undamped and rigid-body states.
    tail : float
        Bound of the response of what was left out, at all frequencies.
    complete : bool
        Whether nothing was left out.
    """

    stable: Lti
    modal: ModalSystem | None
    kept: Lti
    tail: float
    complete: bool


def core_of(system: "control.StateSpace | SecondOrderModel", modes: int) -> SystemCore:
    """Return a core of about ``modes`` modes, more where fewer would not do."""
    if isinstance(system, SecondOrderModel):
        found = structure_core(system, modes) if system.n >= _CORE_FROM else None
        if found is not None:
            return found
        if system.n > LARGEST_DENSE:
            raise ValueError(
                f"a model of {system.n} coordinates without closed-form bound of its high modes (it needs symmetric "
                f"matrices, damping proportional to stiffness but for a few dampers, displacements imposed and read)"
            )
        system = _in_modes(system)
        return statespace_core(realize(system.structure, system.ports).balanced(), 2 * modes)
    return statespace_core(state_matrices(system), 2 * modes)


def _in_modes(model: SecondOrderModel) -> SecondOrderModel:
    """Return a structure over all of its undamped modes, projected through its strain rows, where it has such modes.

    Assembled matrices of a fine mesh carry few digits of its low modes; the rows carry them all.  The highest modes come
    first: solvers of eigenvalues keep the digits of what stands last in a graded matrix.
    """
    if model.structure.elastic is None:
        return model
    try:
        V = undamped_modes(model.structure)[1][:, ::-1]
    except ValueError:
        return model
    names = tuple(f"mode{i + 1}" for i in range(model.n))
    return SecondOrderModel.of(model.structure.projected(V, names), model.ports.congruent(V))


def statespace_core(system: Lti, states: int) -> SystemCore:
    """Return a core of a state-space system; modes too weak to matter are left out of a large one."""
    fast, kept = spectral_parts(system)
    modal = diagonalized(fast)
    if modal is None:
        return SystemCore(fast, None, kept, 0.0, True)
    sizes = modal.sizes
    if len(sizes) <= max(_MANY_STATES, states):
        return SystemCore(modal.blocks, modal, kept, 0.0, True)
    strong = sizes >= np.sort(sizes)[-states] * (1.0 - 1e-9)
    pair = np.flatnonzero(modal.poles.imag > 0.0)
    strong[pair] = strong[pair + 1] = strong[pair] | strong[pair + 1]
    chosen = modal.only(strong)
    return SystemCore(chosen.blocks, chosen, kept, float(sizes[~strong].sum()), bool(strong.all()))


def structure_core(model: SecondOrderModel, modes: int) -> SystemCore | None:
    """Return a core of undamped modes, or None for a structure whose other modes have no bound in closed form."""
    parts = halves(model.structure, model.ports)
    if parts is None:
        piece = _piece(model, modes)
        return None if piece is None else _assembled([(piece, np.eye(len(model.inputs)), np.eye(len(model.outputs)))])
    pieces = []
    for part in parts:
        piece = _piece(SecondOrderModel.of(part.structure, part.ports), (modes + 1) // 2)
        if piece is None:
            return None
        pieces.append((piece, part.W_in, part.W_out))
    return _assembled(pieces) if pieces else None


def _assembled(pieces: list[tuple[tuple[Lti, float], Array, Array]]) -> SystemCore:
    """Return the core whose orthonormal parts are given."""
    modals, kept, D, tail = [], [], None, 0.0
    for (system, left_out), W_in, W_out in pieces:
        whole = Lti(system.A, system.B @ W_in.T, W_out @ system.C, W_out @ system.D @ W_in.T)
        fast, slow = spectral_parts(whole)
        modals.append((fast, diagonalized(fast)))
        kept.append(slow)
        D, tail = fast.D if D is None else D + fast.D, max(tail, left_out)
    assert D is not None
    if any(modal is None for _, modal in modals):
        return SystemCore(_stacked([fast for fast, _ in modals], D), None, _stacked(kept, 0.0 * D), tail, False)
    parts = [modal for _, modal in modals if modal is not None]
    modal = ModalSystem(
        np.concatenate([part.poles for part in parts]),
        np.vstack([part.B for part in parts]),
        np.hstack([part.C for part in parts]),
        D,
    )
    return SystemCore(modal.blocks, modal, _stacked(kept, 0.0 * D), tail, False)


def _stacked(parts: list[Lti], D: Array) -> Lti:
    A = linalg.block_diag(*(part.A for part in parts if len(part.A))) if any(len(p.A) for p in parts) else None
    return Lti(
        np.zeros((0, 0)) if A is None else A,
        np.vstack([part.B for part in parts]),
        np.hstack([part.C for part in parts]),
        D,
    )


def _piece(model: SecondOrderModel, modes: int) -> tuple[Lti, float] | None:
    """Return a modal core of a structure and the bound of what it leaves out, or None where there is none."""
    damping = separated_damping(model)
    loads = loads_of(model)
    if damping is None or loads is None or modes >= _ALL_MODES * model.n:
        return None
    try:
        frequencies, shapes = undamped_modes(model.structure, modes + 1)
    except ValueError:
        return None
    V, lowest = shapes[:, :modes], float(frequencies[modes])
    small = model.structure.projected(V)
    core = core_states(small.M, small.K, small.C, loads, V)
    closed = diagonalized(
        Lti(
            core.A,
            np.hstack([core.B, np.vstack([np.zeros((modes, len(loads.L))), V.T @ loads.L.T])]),
            np.hstack([damping.U.T @ V, np.zeros((len(damping.gamma), modes))]),
            np.zeros((len(damping.gamma), core.B.shape[1] + len(loads.L))),
        )
    )
    if closed is None:
        return None
    tail = tail_bound(model, loads, damping, V, lowest, (small.C, closed))
    return (Lti(core.A, core.B, core.C, model.ports.E[0]), tail) if np.isfinite(tail) else None


def loads_of(model: SecondOrderModel) -> Loads | None:
    """Return loads and rows of a model that imposes forces or displacements and reads displacements; None otherwise."""
    ports = model.ports
    plain = not any(ports.integrators) and all(b is None for b in ports.bandwidths)
    higher = any(matrix.any() for matrix in (*ports.L[1:], *ports.E[1:], ports.B[2]))
    return Loads(ports.B[0], ports.B[1], ports.L[0]) if plain and not higher else None


def core_states(M: Array, K: Array, C: Array, loads: Loads, V: Array) -> Lti:
    """Return the kept modes with states ``x`` and ``x' - B1 d``."""
    k = V.shape[1]
    B0, B1, L = V.T @ loads.B0, V.T @ loads.B1, loads.L @ V
    inverse = np.linalg.inv(M)
    B1 = inverse @ B1
    A = np.block([[np.zeros((k, k)), np.eye(k)], [-inverse @ K, -inverse @ C]])
    return Lti(
        A,
        np.vstack([B1, inverse @ B0 - inverse @ C @ B1]),
        np.hstack([L, np.zeros_like(L)]),
        np.zeros((len(L), B0.shape[1])),
    )
