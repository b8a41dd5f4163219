"""Frequency response of a structure, straight from its matrices.

Methods, in the order in which they are tested; if one does not apply, the next one is used.

==================  ============================================  ====================================================
method              condition                                     reason
==================  ============================================  ====================================================
subsystems          a mirror, signals in pairs of images          two structures of half the size, by the methods below
undamped modes      1500 frequencies times coordinates, verified  all frequencies at once; dampers as an update of low
                                                                  rank (Woodbury)
dense solutions     otherwise                                     always applicable; in strain coordinates if there are
                                                                  rows
==================  ============================================  ====================================================
"""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import EPS, SOLVED, VISIBLE, warn_of_rounding
from boomctl.structure.matrices import Structure, dynamic_stiffness, halves
from boomctl.structure.ports import Ports, evaluate
from boomctl.structure.response.by_modes import respond_by_modes

_MODES_FROM = 1500  # Frequencies times coordinates; for fewer, dense solutions are faster.
_ENTRIES = 10_000_000  # Of the matrices of all frequencies that are solved together: 0.3 GB.
_UNEVEN = 1e-2  # Noise of stiffness, of the highest frequency squared, from which on rounding is estimated.


def respond(structure: Structure, ports: Ports, omega: Array, available: Ports | None = None) -> Array:
    """Return the response of all inputs and outputs of a structure, shape (outputs, inputs, frequencies).

    ``available`` are further signals of the structure.  Mirror images of the requested signals are added from them, since two
    subsystems cost less than the full structure.

    Warns
    -----
    AccuracyWarning
        If the rounding estimate exceeds 1e-4, for matrices without rows.
    """
    p, m, mirror = len(ports.outputs), len(ports.inputs), structure.mirror
    if available is not None and mirror is not None:
        ins = mirror.completed(ports.inputs, available.inputs)
        ports = available.select(ins, mirror.completed(ports.outputs, available.outputs))
    parts = halves(structure, ports)
    if parts is None:
        return respond_whole(structure, ports, omega)
    total = np.zeros((p, m, len(omega)), dtype=complex)
    for part, signals, W_in, W_out in parts:
        total += W_in[:m] @ np.tensordot(W_out[:p], respond_whole(part, signals, omega), 1)
    return total


def respond_whole(structure: Structure, ports: Ports, omega: Array) -> Array:
    """Return the response of a structure as :func:`respond` does, without looking for symmetry."""
    if (omega == 0.0).any():
        _check_static(structure)
    values = respond_by_modes(structure, ports, omega) if structure.n * len(omega) >= _MODES_FROM else None
    return direct_response(structure, ports, omega) if values is None else values


def _check_static(structure: Structure) -> None:
    """Raise if the structure can move freely, so that its static response is infinite."""
    form, scale = structure.strain_form, np.sqrt(np.abs(structure.M.diagonal()))
    scale[scale == 0.0] = 1.0
    if form is None:  # A chain that is locked has no coordinates.
        free = structure.n > 0 and SOLVED * np.linalg.cond(structure.K / np.outer(scale, scale)) >= 1.0
    else:
        free = form.rigid > 0
    if free:
        raise ValueError("omega = 0: the structure moves freely (a rigid-body mode), its static response is infinite")


def direct_response(structure: Structure, ports: Ports, omega: Array) -> Array:
    """Return the response by a solution at each frequency.

    Raises
    ------
    ValueError
        The structure has an undamped resonance exactly at one of the frequencies.
    """
    s, form, B, L = 1j * omega, structure.strain_form, ports.B, ports.L
    matrices = structure.matrices if form is None else form.matrices
    if form is not None:
        B, L = form.ports_matrices(ports)
    step = max(1, _ENTRIES // max(1, structure.n) ** 2)
    batches = [s[k : k + step] for k in range(0, max(1, len(s)), step)]
    try:
        X = np.concatenate([np.linalg.solve(dynamic_stiffness(matrices, part), evaluate(B, part)) for part in batches])
    except np.linalg.LinAlgError:
        raise ValueError(
            "omega hits an undamped resonance (or a rigid-body mode at 0): the response is infinite"
        ) from None
    Y = evaluate(L, s) @ X + evaluate(ports.E, s)
    if form is None and structure.noise > _UNEVEN * float(omega.max(initial=0.0)) ** 2:
        _warn_of_rounding(structure, ports, s, X, Y)
    return ports.conditioned(s, Y.transpose(1, 2, 0))


def _warn_of_rounding(structure: Structure, ports: Ports, s: Array, X: Array, Y: Array) -> None:
    """Warn if rounding may be visible in the largest output ``Y`` of coordinates ``X`` that matrices alone are known of.

    A soft spring next to a stiff one is rounded in a stiffness matrix; so are forces that nearly cancel.
    """
    D, lines = dynamic_stiffness(structure.matrices, s), evaluate(ports.L, s)
    reading = np.abs(np.linalg.solve(D.transpose(0, 2, 1), lines.transpose(0, 2, 1)))
    pushed, read = (evaluate(np.abs(terms), np.abs(s)).real for terms in (ports.B, ports.L))
    acting = pushed + np.abs(structure.K.diagonal())[:, None] * np.abs(X)
    moved = EPS * (reading.transpose(0, 2, 1) @ acting + read @ np.abs(X)).max(axis=1, initial=0.0)
    size = np.abs(Y).max(axis=1, initial=0.0)
    warn_of_rounding("the frequency response", float((moved[size > 0] / size[size > 0]).max(initial=0.0)), VISIBLE)
