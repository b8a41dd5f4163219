"""Small systems that stand for large ones: a core in state space, and a bound of what it leaves out."""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.analysis.model_norm import CORE_FROM, FEWER
from boomctl.arrays import Array
from boomctl.lti.modal import ModalSystem, spectral_parts
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, append
from boomctl.lti.verified_modal_form import in_verified_modal_form
from boomctl.reduction.tail_bounds import loads_of, modal_states, motions, tail_bound
from boomctl.structure.damping import separated_damping
from boomctl.structure.matrices import halves
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modal_form import in_modes
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.realization import realize

# Ways to a core, in the order tried; a result's stages names those that were taken.
# of a large structure that has a bound
HIGH_MODES_BOUNDED = "the lowest undamped modes, the others bounded in closed form"
ALL_MODES = "all undamped modes"  # of other structures with strain rows: they keep digits that assembled matrices lose
STRONGEST_MODES = "the strongest modes, the others bounded by their peaks"  # of a large state space: less to balance
WHOLE = "all states"  # nothing is left out

_MANY_STATES = 80  # states up to which all of a system stay: balancing them takes milliseconds (a choice)


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
        Bound of the response of what was left out, and of what rounding changed in the coordinates, at all frequencies.
    complete : bool
        Whether nothing was left out.
    way : str
        How it was found.
    given : Lti or None
        The state space itself, for proofs in exact arithmetic; None where the core leaves out or separates states.
    """

    stable: Lti
    modal: ModalSystem | None
    kept: Lti
    tail: float
    complete: bool
    way: str
    given: Lti | None = None


def core_of(system: Lti | SecondOrderModel, modes: int) -> SystemCore:
    """Return a core of about ``modes`` modes, more where fewer would not do."""
    if not isinstance(system, SecondOrderModel):
        core = _statespace_core(system, 2 * modes, WHOLE)
        return core if len(core.kept.A) or not core.complete else replace(core, given=system)
    result = structure_core(system, modes) if system.ncoordinates >= CORE_FROM else None
    if result is not None:
        return result
    try:
        # the highest modes come first: solvers of eigenvalues keep the digits of what stands last in a graded matrix
        modes_of = None if system.structure.elastic is None else undamped_modes(system.structure)
    except ValueError:
        modes_of = None
    if modes_of is None:
        return _statespace_core(realize(system.structure, system.ports), 2 * modes, WHOLE)
    return _statespace_core(
        in_modes(system.structure, system.ports, modes_of[0][::-1], modes_of[1][:, ::-1]), 2 * modes, ALL_MODES
    )


def _statespace_core(system: Lti, states: int, way: str) -> SystemCore:
    """Return a core of a state-space system; modes too weak to matter are left out of a large one."""
    balanced = system.balanced()
    _ = balanced.eigensystem  # whose eigenvalues tell the parts apart, and whose vectors are their modes
    parts = spectral_parts(balanced)
    modal, gap = in_verified_modal_form(parts.fast, parts.doubt)
    fast, kept = parts.fast, parts.kept
    if modal is None:
        return SystemCore(stable=fast, modal=None, kept=kept, tail=gap, complete=True, way=way)
    sizes = modal.sizes
    if len(sizes) <= max(_MANY_STATES, states):
        return SystemCore(stable=modal.blocks, modal=modal, kept=kept, tail=gap, complete=True, way=way)
    strong = sizes >= np.sort(sizes)[-states] * (1.0 - ALIKE)
    pair = np.flatnonzero(modal.poles.imag > 0.0)
    strong[pair] = strong[pair + 1] = strong[pair] | strong[pair + 1]
    chosen = modal.only(strong)
    return SystemCore(
        stable=chosen.blocks,
        modal=chosen,
        kept=kept,
        tail=float(sizes[~strong].sum()) + gap,
        complete=bool(strong.all()),
        way=STRONGEST_MODES,
    )


def structure_core(model: SecondOrderModel, modes: int) -> SystemCore | None:
    """Return a core of undamped modes, or None for a structure whose other modes have no bound in closed form."""
    split = halves(model.structure, model.ports)
    if split is None:
        parts = [(model, np.eye(len(model.input_labels)), np.eye(len(model.output_labels)))]
    else:
        parts = [(SecondOrderModel.of(part.structure, part.ports), part.W_in, part.W_out) for part in split]
        modes = (modes + 1) // 2
    fast, modals, kept, tail = [], [], [], 0.0
    for part, W_in, W_out in parts:
        result = _lowest_modes(part, modes)
        if result is None:
            return None
        system, left_out = result
        split_off = spectral_parts(Lti(system.A, system.B @ W_in.T, W_out @ system.C, W_out @ system.D @ W_in.T))
        modal, gap = in_verified_modal_form(split_off.fast, split_off.doubt)
        fast.append(split_off.fast)
        modals.append(modal)
        kept.append(split_off.kept)
        tail = max(tail, left_out + gap)  # the singular values of orthonormal parts are those of the whole
    if not fast:
        return None
    D = np.sum([part.D for part in fast], axis=0)
    result = [modal for modal in modals if modal is not None]
    modal = None
    if len(result) == len(fast):
        poles = np.concatenate([part.poles for part in result])
        modal = ModalSystem(poles, np.vstack([p.B for p in result]), np.hstack([p.C for p in result]), D)
    stable = _parallel(fast, D) if modal is None else modal.blocks
    return SystemCore(
        stable=stable, modal=modal, kept=_parallel(kept, 0.0 * D), tail=tail, complete=False, way=HIGH_MODES_BOUNDED
    )


def _parallel(parts: list[Lti], D: Array) -> Lti:
    """Return systems between the same signals, their outputs added, with a feedthrough in place of theirs."""
    A = append(*parts).A
    return Lti(A, np.vstack([part.B for part in parts]), np.hstack([part.C for part in parts]), D)


def _lowest_modes(model: SecondOrderModel, modes: int) -> tuple[Lti, float] | None:
    """Return a structure in its lowest undamped modes and the bound of the others, or None where there is none."""
    damping = separated_damping(model.structure)
    loads = loads_of(model)
    if damping is None or damping.beta <= 0.0 or loads is None or modes >= FEWER * model.ncoordinates:
        return None
    try:
        frequencies, shapes = undamped_modes(model.structure, modes + 1)
    except ValueError:
        return None
    V, lowest = shapes[:, :modes], float(frequencies[modes])
    small = model.structure.projected(V)
    core = modal_states(small.M, small.K, small.C, loads, V)
    closed = motions(core, damping.U.T @ V)
    if closed is None:
        return None
    tail = tail_bound(model, loads, damping, V, lowest, (small.C, closed))
    return (Lti(core.A, core.B, core.C, model.ports.E[0]), tail) if np.isfinite(tail) else None
