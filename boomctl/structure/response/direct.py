"""Frequency response of a structure, straight from its matrices.

The ways, in the order tried; where one does not hold, the next one answers, and :attr:`Response.path` names those that
did.

==================  ============================================  ====================================================
way                 where                                         why
==================  ============================================  ====================================================
halves              a mirror, signals in pairs of images          two structures of half the size; each goes on below
core                80 coordinates and more, symmetric, verified  a few motions stand for all: small and dense from here
undamped modes      small, 1500 frequencies times coordinates,    all frequencies at once; dampers as an update of low
                    verified                                      rank (Woodbury)
dense solutions     small                                         always holds
sparse              80 coordinates and more, without a core       always holds; a factorisation at each frequency
factorisations
==================  ============================================  ====================================================

Meshes so fine that their stiffness matrix has lost the band asked for are solved in mixed form, without that matrix.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from boomctl.arrays import Array
from boomctl.structure.matrices import Half, Structure, dense, halves
from boomctl.structure.ports import Ports, evaluate
from boomctl.structure.response.core import Core, build_core, rounding_estimate, solver
from boomctl.structure.response.mixed import MixedForm
from boomctl.structure.response.modes import Part, respond_by_modes
from boomctl.structure.response.poles import undamped_modes
from boomctl.structure.response.rounding import AccuracyWarning

_MODES_FROM = 1500  # frequencies times coordinates; of fewer, dense solutions are faster (measured on booms)
_CORE_FROM = 80  # coordinates; of fewer, all modes cost less than a core (measured on booms)
_CORE_ERROR = 1e-8  # estimated, relative; an answer with less stands: far below what a model is good for (a choice)
_FREE = 1e-13  # smallest over largest singular value of a scaled stiffness; below it is rounding: a rigid-body mode
_STRAINS_HOLD = 1000  # coordinates; strains lose a few times log10(n) digits, so that far there is nothing to warn of
_DENSE_CHECK = 1000  # coordinates up to which a singular stiffness is looked for: a dense SVD of a second (a choice)
_ROUNDING_LIMIT = 1e-4  # estimated rounding, relative, from which on a user is warned: it would show in a plot
_ROUNDING_SEEN = 1e-3  # share of that limit from which on more than a few frequencies are looked at (a choice)
_UNEVEN = 1e-2  # noise of stiffness, of the highest frequency squared, from which on rounding is looked at (a choice)
_GLANCES = 7  # frequencies at which rounding is looked at first (a choice)


@dataclass(frozen=True)
class Response:
    """A frequency response, shape (outputs, inputs, frequencies), and the ways that led to it, first to last."""

    values: Array
    path: tuple[str, ...]


def respond(structure: Structure, ports: Ports, omega: Array, available: Ports | None = None) -> Response:
    """Return the response of all inputs and outputs of a structure.

    ``available`` are further signals of the structure: mirror images of those asked for are added from them, since two
    halves cost less than the whole.

    Warns
    -----
    AccuracyWarning
        The rounding estimate exceeds 1e-4: the mesh is finer than double precision carries.
    """
    wanted, mirror = ports, structure.mirror
    if available is not None and mirror is not None:
        ins = mirror.completed(ports.inputs, available.inputs)
        ports = available.select(ins, mirror.completed(ports.outputs, available.outputs))
    parts = halves(structure, ports)
    if parts is None:
        (found,) = respond_parts([(structure, ports)], omega)
    else:
        answers = respond_parts([(part.structure, part.ports) for part in parts], omega)
        path = sum((answer.path for answer in answers), ("halves",))
        total = np.zeros((len(ports.outputs), len(ports.inputs), len(omega)), dtype=complex)
        for part, answer in zip(parts, answers, strict=True):
            _add(total, part, answer.values)
        found = Response(total, path)
    return Response(found.values[: len(wanted.outputs), : len(wanted.inputs)], found.path)


def _add(total: Array, part: Half, values: Array) -> None:
    """Add a half's response to that of the whole."""
    for o, u in zip(*np.nonzero(part.W_out), strict=True):
        for i, v in zip(*np.nonzero(part.W_in), strict=True):
            total[o, i] += (part.W_out[o, u] * part.W_in[i, v]) * values[u, v]


def respond_parts(parts: Sequence[Part], omega: Array) -> list[Response]:
    """Return the responses of structures as :func:`respond` does, without looking for symmetry; small ones together."""
    answers: list[Response | None] = [None] * len(parts)
    small: list[tuple[int, Part, tuple[str, ...]]] = []
    for i, (structure, ports) in enumerate(parts):
        if structure.n < _CORE_FROM or (structure.graded and structure.strain_form is not None):
            small.append((i, (structure, ports), ()))
            continue
        core, why_not = _verified_core(structure, ports, omega)
        if core is None:
            path = (f"sparse factorisations (no core: {why_not})",)
            answers[i] = Response(_by_factorization(structure, ports, omega), path)
        else:
            small.append((i, (core.structure, core.ports), (f"core of {core.structure.n}",)))
    for (i, _, path), found in zip(small, _small([part for _, part, _ in small], omega), strict=True):
        answers[i] = Response(found.values, (*path, *found.path))
    return [answer for answer in answers if answer is not None]


def _verified_core(structure: Structure, ports: Ports, omega: Array) -> tuple[Core | None, str]:
    """Return a core that stands for the structure, or None and why there is none."""
    if not structure.symmetric:
        return None, "not symmetric"
    try:
        core = build_core(structure, ports, omega)
    except (np.linalg.LinAlgError, RuntimeError):
        return None, "not definite"
    if core is None:
        return None, "not one for all modes"
    if core.error > _CORE_ERROR:
        return None, f"error {core.error:.1g}"
    rounding = 0.0
    if structure.elastic is not None and structure.noise > _UNEVEN * float(omega.max()) ** 2:
        rounding = ports_rounding(core.structure, ports, core.basis, omega[_glances(len(omega))])
        _warn(rounding)
    if structure.elastic is None or structure.n > _STRAINS_HOLD:
        rounding = rounding_estimate(structure, core, omega[_glances(len(omega))])
        if rounding > _ROUNDING_SEEN * _ROUNDING_LIMIT:
            rounding = rounding_estimate(structure, core, omega)
    _warn(rounding)
    return core, ""


def _glances(count: int) -> Array:
    """Return the places of a few of ``count`` frequencies, the first and the last among them."""
    return np.linspace(0, count - 1, min(_GLANCES, count)).astype(int)


def _small(parts: Sequence[Part], omega: Array) -> list[Response]:
    """Return the responses of small dense structures."""
    if (omega == 0.0).any():
        for structure, _ in parts:
            _check_static(structure)
    large = [structure.n * len(omega) >= _MODES_FROM for structure, _ in parts]
    found = respond_by_modes(parts, omega) if any(large) else [None] * len(parts)
    return [
        Response(direct_response(*part, omega), ("dense solutions",))
        if values is None
        else Response(values, ("undamped modes",))
        for part, values in zip(parts, found, strict=True)
    ]


def _check_static(structure: Structure) -> None:
    """Raise if the structure can move freely, so that its static response is infinite."""
    if not structure.n:
        return  # a chain that is locked
    if structure.strain_form is None and structure.graded and structure.mixed is not None:
        free = undamped_modes(structure, 1)[0][0] == 0.0
    elif structure.strain_form is None:
        scale = np.sqrt(np.abs(np.diag(dense(structure.M))))
        scale[scale == 0.0] = 1.0
        size = np.linalg.svd(dense(structure.K) / np.outer(scale, scale), compute_uv=False)
        free = size[-1] <= _FREE * size[0]
    else:
        assert structure.strain_form is not None
        free = structure.strain_form.rigid > 0
    if free:
        raise ValueError("omega = 0: the structure moves freely (a rigid-body mode), its static response is infinite")


def ports_rounding(small: Structure, ports: Ports, V: Array, omega: Array) -> float:
    """Return how much of the largest output rounding may be, where motions ``V`` are pushed and read through ports.

    An imposed displacement acts through the stiffness beside it, as forces that nearly cancel: beside a short element they
    are so large that what is left of them is rounding.
    """
    s = 1j * np.unique(omega)
    at, seen, size = small.at(s), ports.congruent(V), np.abs(V)
    try:
        X = np.linalg.solve(at, evaluate(seen.B, s))
        pushed = [np.finfo(float).eps * (size.T @ np.abs(term)) for term in ports.B]
        acting = sum(np.abs(s)[:, None, None] ** k * term for k, term in enumerate(pushed))
        reading = np.abs(np.linalg.solve(at.transpose(0, 2, 1), evaluate(seen.L, s).transpose(0, 2, 1)))
    except np.linalg.LinAlgError:
        return 0.0  # an undamped resonance, which is refused where it is asked for
    read = sum(np.abs(s)[:, None, None] ** k * (np.abs(line) @ size) for k, line in enumerate(ports.L))
    moved = reading.transpose(0, 2, 1) @ acting + np.finfo(float).eps * read @ np.abs(X)
    Y = np.abs(evaluate(seen.L, s) @ X + evaluate(ports.E, s)).max(axis=1)
    off = moved.max(axis=1)
    return float((off[Y > 0] / Y[Y > 0]).max(initial=0.0))


def direct_response(structure: Structure, ports: Ports, omega: Array) -> Array:
    """Return the response by a dense solution at each frequency.

    Raises
    ------
    ValueError
        The structure has an undamped resonance exactly at one of the frequencies.
    """
    s, rounding = 1j * omega, 0.0
    if structure.strain_form is not None:
        if structure.noise > _UNEVEN * float(np.max(omega, initial=0.0)) ** 2:
            rounding = ports_rounding(structure.in_strains, ports, structure.strain_form.V, omega)
        structure, ports = structure.in_strains, structure.strain_form.ports(ports)
    _warn(rounding)
    try:
        X = np.linalg.solve(structure.at(s), evaluate(ports.B, s))
    except np.linalg.LinAlgError:
        raise ValueError(
            "omega hits an undamped resonance (or a rigid-body mode at 0): the response is infinite"
        ) from None
    Y = evaluate(ports.L, s) @ X
    return _conditioned(ports, s, Y + evaluate(ports.E, s) if ports.E.any() else Y)


def _by_factorization(structure: Structure, ports: Ports, omega: Array) -> Array:
    s = 1j * omega
    M, C, K = (sparse.csc_array(matrix) for matrix in (structure.M, structure.C, structure.K))
    L, E, B = evaluate(ports.L, s), evaluate(ports.E, s), evaluate(ports.B, s)
    Y = np.empty(E.shape, dtype=complex)
    if (omega == 0.0).any() and structure.n <= _DENSE_CHECK:
        _check_static(structure)
    glances = set(_glances(len(s)))
    shaken = np.finfo(float).eps * np.abs(K.diagonal())[:, None]
    rounding = 0.0
    form = solver(structure, float(omega.max()))
    if isinstance(form, MixedForm):
        shaken = 0.0 * shaken
    for f, value in enumerate(s):
        try:
            if isinstance(form, MixedForm):
                solve = form.factorized(value)
            else:
                solve = splu(sparse.csc_array(K + value * C + value**2 * M)).solve
        except (RuntimeError, np.linalg.LinAlgError):
            raise ValueError(f"the response at omega = {omega[f]:g} is infinite: an undamped resonance") from None
        X = solve(B[f])
        Y[f] = L[f] @ X + E[f]
        if f in glances:
            size = np.abs(Y[f]).max(axis=0, initial=0.0)
            moved = np.abs(L[f] @ solve(shaken * X)).max(axis=0, initial=0.0)
            rounding = max(rounding, float((moved[size > 0] / size[size > 0]).max(initial=0.0)))
    _warn(rounding)
    return _conditioned(ports, s, Y)


def _warn(rounding: float) -> None:
    if rounding > _ROUNDING_LIMIT:
        message = f"rounding error of the frequency response is estimated at {rounding:.1g} of its size"
        warnings.warn(f"{message}: the mesh is finer than double precision carries", AccuracyWarning, stacklevel=4)


def _conditioned(ports: Ports, s: Array, Y: Array) -> Array:
    if ports.plain:
        return np.moveaxis(Y, 0, 2)
    after, before = ports.conditioning(s)
    return np.moveaxis(after[:, :, None] * Y * before[:, None, :], 0, 2)
