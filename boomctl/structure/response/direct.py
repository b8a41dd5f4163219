"""Frequency response of a structure, straight from its matrices.

The ways, in the order tried; where one does not hold, the next one answers, and :attr:`Response.stages` names those that
did.

==================  ============================================  ====================================================
way                 where                                         why
==================  ============================================  ====================================================
halves              a mirror, signals in pairs of images          two structures of half the size; each goes on below
undamped modes      1500 frequencies times coordinates, verified  all frequencies at once; dampers as an update of low
                                                                  rank (Woodbury)
dense solutions     the others                                    always holds; in strain coordinates where there are
                                                                  rows
==================  ============================================  ====================================================
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import warn_user
from boomctl.exceptions import AccuracyWarning
from boomctl.lti.rounding import EPS, SOLVED, VISIBLE
from boomctl.structure.matrices import Structure, halves
from boomctl.structure.ports import Ports, evaluate
from boomctl.structure.response.modes import respond_by_modes

Part = tuple[Structure, Ports]

_MODES_FROM = 1500  # Frequencies times coordinates; for fewer, dense solutions are faster.
_ENTRIES = 10_000_000  # Of the matrices of all frequencies that are solved together: 0.3 GB.
_UNEVEN = 1e-2  # Noise of stiffness, of the highest frequency squared, from which on rounding is estimated.
_CHECKS = 7  # Frequencies at which rounding of given matrices is estimated.


@dataclass(frozen=True)
class Response:
    """A frequency response, shape (outputs, inputs, frequencies), and the ways that led to it, first to last."""

    values: Array
    stages: tuple[str, ...]


def respond(structure: Structure, ports: Ports, omega: Array, available: Ports | None = None) -> Response:
    """Return the response of all inputs and outputs of a structure.

    ``available`` are further signals of the structure: mirror images of those asked for are added from them, since two
    halves cost less than the whole.

    Warns
    -----
    AccuracyWarning
        The rounding estimate exceeds 1e-4: the mesh is finer than double precision carries.
    """
    p, m, mirror = len(ports.outputs), len(ports.inputs), structure.mirror
    if available is not None and mirror is not None:
        ins = mirror.completed(ports.inputs, available.inputs)
        ports = available.select(ins, mirror.completed(ports.outputs, available.outputs))
    parts = halves(structure, ports)
    if parts is None:
        return respond_parts([(structure, ports)], omega)[0]
    answers = respond_parts([(part.structure, part.ports) for part in parts], omega)
    total = np.zeros((p, m, len(omega)), dtype=complex)
    for part, answer in zip(parts, answers, strict=True):
        u, v, points = answer.values.shape
        outputs = (part.W_out[:p] @ answer.values.reshape(u, v * points)).reshape(p, v, points)
        total += part.W_in[:m] @ outputs
    return Response(total, sum((answer.stages for answer in answers), ("halves",)))


def respond_parts(parts: Sequence[Part], omega: Array) -> list[Response]:
    """Return the responses of structures as :func:`respond` does, without looking for symmetry."""
    if (omega == 0.0).any():
        for structure, _ in parts:
            _check_static(structure)
    many = max((structure.n for structure, _ in parts), default=0) * len(omega) >= _MODES_FROM
    result = []
    for part in parts:
        values = respond_by_modes(*part, omega) if many else None
        if values is None:
            result.append(Response(direct_response(*part, omega), ("dense solutions",)))
        else:
            result.append(Response(values, ("undamped modes",)))
    return result


def _check_static(structure: Structure) -> None:
    """Raise if the structure can move freely, so that its static response is infinite."""
    if structure.strain_form is not None:
        free = structure.strain_form.rigid > 0
    elif not structure.n:
        return  # a chain that is locked
    else:
        scale = np.sqrt(np.abs(np.diag(structure.M)))
        scale[scale == 0.0] = 1.0
        size = np.linalg.svd(structure.K / np.outer(scale, scale), compute_uv=False)
        free = size[-1] <= SOLVED * size[0]
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
        pushed = [EPS * (size.T @ np.abs(term)) for term in ports.B]
        acting = sum(np.abs(s)[:, None, None] ** k * term for k, term in enumerate(pushed))
        reading = np.abs(np.linalg.solve(at.transpose(0, 2, 1), evaluate(seen.L, s).transpose(0, 2, 1)))
    except np.linalg.LinAlgError:
        return 0.0  # an undamped resonance, which is refused where it is asked for
    read = sum(np.abs(s)[:, None, None] ** k * (np.abs(line) @ size) for k, line in enumerate(ports.L))
    moved = reading.transpose(0, 2, 1) @ acting + EPS * read @ np.abs(X)
    Y = np.abs(evaluate(seen.L, s) @ X + evaluate(ports.E, s)).max(axis=1)
    off = moved.max(axis=1)
    return float((off[Y > 0] / Y[Y > 0]).max(initial=0.0))


def direct_response(structure: Structure, ports: Ports, omega: Array) -> Array:
    """Return the response by a solution at each frequency.

    Raises
    ------
    ValueError
        The structure has an undamped resonance exactly at one of the frequencies.
    """
    s, form, B, L = 1j * omega, structure.strain_form, ports.B, ports.L
    noisy = structure.noise > _UNEVEN * float(omega.max(initial=0.0)) ** 2
    if form is None and noisy:
        _warn(_matrices_rounding(structure, ports, omega))
    if form is not None:
        if noisy:
            _warn(ports_rounding(structure.in_strains, ports, form.V, omega))
        structure, (B, L) = structure.in_strains, form.seen(ports)
    pieces = np.array_split(s, max(1, min(len(s), len(s) * structure.n**2 // _ENTRIES)))
    try:
        X = np.concatenate([np.linalg.solve(structure.at(part), evaluate(B, part, ports.acting)) for part in pieces])
    except np.linalg.LinAlgError:
        raise ValueError(
            "omega hits an undamped resonance (or a rigid-body mode at 0): the response is infinite"
        ) from None
    Y = evaluate(L, s, ports.read) @ X
    return ports.conditioned(s, (Y + evaluate(ports.E, s) if ports.E.any() else Y).transpose(1, 2, 0))


def _matrices_rounding(structure: Structure, ports: Ports, omega: Array) -> float:
    """Return how much of the largest output rounding of a stiffness matrix may be, at a few frequencies."""
    s = 1j * omega[np.linspace(0, len(omega) - 1, min(_CHECKS, len(omega))).astype(int)]
    shaken = EPS * np.abs(structure.K.diagonal())[:, None]
    at, B, L = structure.at(s), evaluate(ports.B, s), evaluate(ports.L, s)
    try:
        X = np.linalg.solve(at, B)
        size = np.abs(L @ X + evaluate(ports.E, s)).max(axis=1, initial=0.0)
        moved = np.abs(L @ np.linalg.solve(at, shaken * X + EPS * np.abs(B))).max(axis=1, initial=0.0)
    except np.linalg.LinAlgError:
        return 0.0  # an undamped resonance, which is refused where it is asked for
    return float((moved[size > 0] / size[size > 0]).max(initial=0.0))


def _warn(rounding: float) -> None:
    if rounding > VISIBLE:
        message = f"rounding error of the frequency response is estimated at {rounding:.1g} of its size"
        warn_user(f"{message}: the mesh is finer than double precision carries", AccuracyWarning)
