"""Galerkin cores: a large structure seen through a few well-chosen motions.

The motions are the structure's responses to its own inputs and outputs at a few real frequency shifts (rational
Krylov), one factorisation a shift.  Inputs and outputs share the basis, so that the error of the core's response is
of second order in the error of the basis.  The core is accepted when its residual, put through the structure, moves no
output at any probe frequency and it has as many modes in the band as the structure (Sylvester's inertia); otherwise the
basis is enriched by what was missing.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

from boomctl.arrays import Array, Matrix
from boomctl.structure.matrices import Structure
from boomctl.structure.ports import Ports, evaluate
from boomctl.structure.response.mixed import MixedForm
from boomctl.structure.response.pencil import Pencil, Solve

# rounding of the stiffness matrix, as an uncertainty of omega^2 and of that at the top of the band, above which a core
# found with it is not accepted any more (measured on booms: 20,000 elements up to 10 Hz)
NOISY = 1e-2
_SPACING = 16.0  # ratio of neighbouring shifts; cores of booms cost the same from 8 to 64 (measured)
_WIDEST = 1e4  # ratio of the highest to the lowest shift; a structure answers as at rest below (a choice)
_LEVELS = 2  # solutions in a row at each shift; one needs more enrichments, three make cores larger (measured on booms)
_ROUNDS = 6  # enrichments before a core is given up (a choice; none or one does for booms)
_TOLERANCE = 1e-10  # estimated error at the probes that ends enrichment: below _CORE_ERROR, above rounding (a choice)
_ROUNDED = 1e-8  # error below which enrichment that stalls meets the rounding of a fine mesh (a choice)
_STALLED = 0.3  # of the error before, from which on enrichment stalls (a choice)
# times the top of the band: a motion faster than that follows at once, so that it may be as slow as that (its share of the
# response, small as it is, changes by the inverse square of it)
_FASTEST = 1e4
_DROP = 1e-12  # of the largest column; what is left of a column below it is rounding
_SAMPLES = 24  # frequencies at which rounding is estimated (a choice)
_EPS = np.finfo(float).eps  # unit in the last place: what operands are shaken by


@dataclass(frozen=True)
class Core:
    """A small structure whose response is that of a large one up to the estimate ``error``, relative."""

    structure: Structure
    ports: Ports
    basis: Array
    error: float


def orthonormal(M: Matrix, block: Array, against: Array | None = None, drop: float = 1e-10) -> Array:
    """Return an M-orthonormal basis of the columns of ``block``, M-orthogonal to ``against``."""
    size = np.sqrt(np.einsum("ij,ij->j", block, M @ block))
    kept = block[:, size > 0] / size[size > 0]
    for _ in range(2):
        if against is not None:
            kept = kept - against @ (against.T @ (M @ kept))
        if not kept.shape[1]:
            return kept
        values, mix = linalg.eigh(kept.T @ (M @ kept), check_finite=False)
        good = values > drop**2 * max(values[-1], 1e-6)
        kept = kept @ (mix[:, good] / np.sqrt(values[good]))
    return kept


def _sources(ports: Ports) -> Array:
    """Return the columns through which inputs act and outputs read, each scaled to one."""
    columns = np.hstack([*ports.B, *(line.T for line in ports.L)])
    size = np.abs(columns).max(axis=0, initial=0.0)
    return columns[:, size > 0] / size[size > 0]


def _krylov(M: Matrix, solves: list[Solve], sources: Array) -> Array:
    blocks = []
    latest = [sources] * len(solves)
    for level in range(_LEVELS):
        for i, solve in enumerate(solves):
            solved = solve(sources if level == 0 else M @ latest[i])
            latest[i] = solved / np.maximum(np.abs(solved).max(axis=0, initial=0.0), np.finfo(float).tiny)
            blocks.append(latest[i])
    return _span(M, np.hstack(blocks))


def _span(M: Matrix, block: Array) -> Array:
    """Return an M-orthonormal basis of the columns of ``block``, what depends on others dropped."""
    size = np.sqrt(np.einsum("ij,ij->j", block, block))
    packed, _, tau, _, _ = lapack.dgeqp3(np.asfortranarray(block[:, size > 0] / size[size > 0]), overwrite_a=1)
    diagonal = np.abs(np.diag(packed))
    rank = int((diagonal > _DROP * diagonal.max(initial=0.0)).sum())
    if not rank:
        return block[:, :0]
    Q = lapack.dorgqr(packed[:, :rank], tau[:rank])[0]
    factor, failed = lapack.dpotrf(Q.T @ (M @ Q), lower=0)
    return Q if failed else lapack.dtrtrs(factor, Q.T, lower=0, trans=1)[0].T


def modal_core(structure: Structure, ports: Ports, omega: Array) -> Core | None:
    """Return all modes of a structure with strain coordinates as a core: accurate up to the highest of ``omega`` [rad/s].

    Modes so fast that no state space holds them beside the slow ones get more mass: see :data:`_FASTEST`.
    """
    form, fastest = structure.strain_form, _FASTEST * max(float(omega.max()), 1e-2)
    if form is None:
        return None
    strained, seen, (frequencies, own) = structure.in_strains, form.ports(ports), form.own_modes
    damping = np.einsum("ij,ij->j", own, form.C @ own)
    basis = own / np.sqrt(_masses(frequencies**2, damping, fastest))
    n = len(frequencies)
    small = Structure(
        tuple(f"v{i}" for i in range(n)),
        (np.eye(n), basis.T @ (form.C @ basis), np.diag(frequencies**2 / _masses(frequencies**2, damping, fastest))),
    )
    core = Core(small, seen.congruent(basis), basis, np.inf)
    error, _ = _defect(strained, seen, core, _probes(frequencies, omega), strained.pencil)
    return replace(core, error=error)


def _masses(stiffness: Array, damping: Array, fastest: float) -> Array:
    """Return how much mass, instead of one, motions need so that neither they nor their decay is faster than a limit."""
    return np.maximum(1.0, np.maximum(stiffness / fastest**2, damping / fastest))


def build_core(structure: Structure, ports: Ports, omega: Array, resolved: float = 0.0) -> Core | None:
    """Return a core that is accurate over the frequencies ``omega`` [rad/s]; None where there is no small one.

    The structure's matrices must be symmetric, its mass matrix positive definite.  There is no small core for a structure
    with modes in the band that inputs and outputs do not show, or with very many.

    Where rounding of the stiffness matrix reaches what the frequency ``resolved`` [rad/s] is found with, or leaves the
    matrix indefinite, the core is built without it, in mixed form: slower, and all its frequencies are judged rightly.
    """
    top = max(float(omega.max()), 1e-2)
    pencil = solver(structure, top)
    fine = structure.elastic is not None and structure.noise > resolved**2 > 0.0
    if fine and structure.mixed is not None:
        pencil = structure.mixed
    try:
        return _built(structure, ports, omega, pencil, resolved > 0.0)
    except np.linalg.LinAlgError:
        if isinstance(pencil, MixedForm) or structure.mixed is None:
            raise
    return _built(structure, ports, omega, structure.mixed, resolved > 0.0)


def _built(structure: Structure, ports: Ports, omega: Array, pencil: Pencil | MixedForm, decays: bool) -> Core | None:
    """Return a core; if it ``decays`` no faster than it moves, its poles too are slow enough for a state space."""
    top, M = max(float(omega.max()), 1e-2), pencil.M
    bottom = max(float(omega[omega > 0].min(initial=top)), top / _WIDEST)
    count = 2 + int(np.ceil(np.log(top / bottom) / np.log(_SPACING)))
    shifts = np.geomspace(bottom, top * 1.2, count)
    V = _krylov(M, [pencil.factorized(s) for s in shifts], _sources(ports))
    core, ritz, missing = _judged(structure, ports, V, omega, pencil, decays)
    for _ in range(_ROUNDS):
        if core.error <= _TOLERANCE:
            break
        V, last = np.hstack([V, orthonormal(M, missing, V)]), core.error
        core, ritz, missing = _judged(structure, ports, V, omega, pencil, decays)
        if core.error <= _ROUNDED and core.error > _STALLED * last:
            break
    found = int((ritz < top).sum())
    return core if found == _modes_below(pencil, top, found) else None


def solver(structure: Structure, top: float) -> Pencil | MixedForm:
    """Return what solves a structure up to the frequency ``top`` [rad/s]: its mixed form where stiffness is too noisy."""
    if structure.elastic is not None and structure.noise > NOISY * top**2 and structure.mixed is not None:
        return structure.mixed
    return structure.pencil


def _modes_below(pencil: Pencil | MixedForm, top: float, found: int) -> int:
    """Return how many modes lie below ``top``, or one more than ``found`` if they are more than that."""
    if isinstance(pencil, Pencil):
        return count_below(pencil.K - top**2 * pencil.M)
    frequencies = pencil.lowest(top**2, min(found + 1, pencil.M.shape[0] - 1))[0]
    return int((frequencies < top).sum())


def _judged(
    structure: Structure, ports: Ports, V: Array, omega: Array, pencil: Pencil | MixedForm, decays: bool
) -> tuple[Core, Array, Array]:
    """Return the core of a basis, its undamped frequencies, and the motions that the basis does not have."""
    V, small = _slowed(structure, V, structure.projected(V), _FASTEST * max(float(omega.max()), 1e-2), decays)
    seen = ports.congruent(V)
    ritz = np.sqrt(np.maximum(linalg.eigh(small.K, small.M, eigvals_only=True, check_finite=False), 0.0))
    core = Core(small, seen, V, np.inf)
    error, missing = _defect(structure, ports, core, _probes(ritz, omega), pencil)
    return replace(core, error=error), ritz, missing


def _slowed(structure: Structure, V: Array, small: Structure, fastest: float, decays: bool) -> tuple[Array, Structure]:
    """Return a basis in which motions faster than ``fastest`` are as slow as that, and the structure in it.

    A fine mesh has motions so fast that a stiffness matrix that holds them has no digit left of the slow ones: mostly what
    rounding has left of dependent columns.  They are parted from the slow ones by their strains, and get more mass; so do, if
    asked for, those that ``decay`` faster.
    """
    rows = structure.elastic
    if rows is None or (_masses(np.diag(small.K), decays * np.diag(small.C), fastest) <= np.diag(small.M)).all():
        return V, small
    strain = np.sqrt(rows.k)[:, None] * (rows.R @ V)
    turned = np.linalg.svd(np.linalg.qr(strain, mode="r"))[2].T
    V = V @ turned
    strain = rows.R @ V
    stiffness, damping = (np.einsum("ij,i,ij->j", strain, weight, strain) for weight in (rows.k, rows.c))
    share = 1.0 / np.sqrt(_masses(stiffness, decays * damping, fastest))
    V = V * share
    small = structure.projected(V)
    heavy = small.M + np.diag(1.0 - share**2)
    return V, Structure(small.coordinates, (heavy, small.C, small.K))


def count_below(shifted: Matrix) -> int:
    """Return the number of negative eigenvalues of ``K - omega^2 M``: of modes below ``omega`` (Sylvester's inertia)."""
    if not sparse.issparse(shifted):
        factor, pivots, _ = lapack.dsytrf(shifted, lower=1)
        single = pivots > 0  # the other pivots are pairs, of one positive and one negative eigenvalue
        return int((np.diag(factor)[single] < 0).sum() + (~single).sum() // 2)
    options = {"SymmetricMode": True}
    lu = splu(sparse.csc_array(shifted), options=options, diag_pivot_thresh=0.0, permc_spec="MMD_AT_PLUS_A")
    if (lu.perm_r != lu.perm_c).any():
        return -1
    return int((lu.U.diagonal() < 0).sum())


def _probes(ritz: Array, omega: Array) -> Array:
    """Return frequencies to judge a core at: the middle, the top, and the lowest resonance in between."""
    ends = np.partition(omega, len(omega) // 2)[len(omega) // 2], omega.max()
    inside = ritz[(ritz > omega.min()) & (ritz < omega.max())]
    return np.unique([*ends, *inside[:1]])


def _defect(
    structure: Structure, ports: Ports, core: Core, probes: Array, pencil: Pencil | MixedForm
) -> tuple[float, Array]:
    """Return how far the core's outputs are off at the probes, relative, and the motions that it does not have.

    The residual is put through the structure itself: a solution at real shifts would not do, for it is orthogonal to
    the residual by construction of the basis.
    """
    s = 1j * probes
    X = np.linalg.solve(core.structure.at(s), evaluate(core.ports.B, s))
    L, E, B = evaluate(ports.L, s), evaluate(ports.E, s), evaluate(ports.B, s)
    count, r, m = X.shape
    full: Array = core.basis @ np.moveaxis(X, 1, 0).reshape(r, -1)  # a column for each probe and input
    residual: Array = np.moveaxis(B, 1, 0).reshape(structure.n, -1) - structure.force(full, np.repeat(s, m))
    steps = [pencil.solved(value, residual[:, f * m : (f + 1) * m]) for f, value in enumerate(s)]
    outputs = L @ np.moveaxis(full.reshape(-1, count, m), 1, 0) + E
    scale, moved = (np.abs(value).max(axis=1, initial=0.0) for value in (outputs, L @ np.array(steps)))
    worst = float((moved[scale > 0] / scale[scale > 0]).max(initial=0.0))
    return worst, np.hstack([part for step in steps for part in (step.real, step.imag)])


def rounding_estimate(structure: Structure, core: Core, omega: Array) -> float:
    """Return the relative change of the largest output when operands change by one unit in the last place.

    With strain rows it is the strains that are shaken, by the rounding of the displacements they are differences of;
    otherwise the entries of the stiffness matrix.
    """
    V = core.basis
    random = np.random.default_rng(0)
    if structure.elastic is not None:
        rows = structure.elastic
        strain = rows.R @ V
        noise = _EPS * (abs(rows.R) @ np.abs(V)) * random.uniform(-1, 1, strain.shape)
        change = noise.T @ (rows.k[:, None] * strain)
        change = change + change.T
    else:
        K = sparse.csr_array(structure.K)
        shaken = sparse.csr_array((_EPS * K.data * random.uniform(-1, 1, len(K.data)), K.indices, K.indptr), K.shape)
        change = V.T @ ((shaken + shaken.T) @ V)
        diagonal = _EPS * K.diagonal()  # equal elements are rounded alike, so that their errors add up
        aligned = V.T @ (diagonal[:, None] * V)
        change = change + np.where(change < 0, -1.0, 1.0) * np.abs(aligned)
    s = 1j * np.unique(np.quantile(omega, np.linspace(0, 1, _SAMPLES), method="nearest"))
    D = core.structure.at(s)
    B, L, E = evaluate(core.ports.B, s), evaluate(core.ports.L, s), evaluate(core.ports.E, s)
    X = np.linalg.solve(D, B)
    Y = L @ X + E
    moved = L @ np.linalg.solve(D, change @ X)
    size = np.abs(Y).max(axis=1)
    return float((np.abs(moved).max(axis=1)[size > 0] / size[size > 0]).max(initial=0.0))
