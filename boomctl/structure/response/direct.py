"""Frequency response of a second-order model, straight from its matrices.

A symmetric model is answered by its halves.  A small model is solved at each frequency; a large symmetric one through
a verified Galerkin core; a large unsymmetric one by a sparse factorisation at each frequency.
"""

import warnings
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from boomctl.arrays import Array
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import Ports, evaluate
from boomctl.structure.response.core import Core, build_core, rounding_estimate
from boomctl.structure.response.modes import respond_by_modes
from boomctl.structure.response.poles import dense
from boomctl.structure.symmetry import half

if TYPE_CHECKING:
    import control

_DIRECT = 4
_CORE_FROM = 18
_CORE_ERROR = 1e-8
_FREE = 1e-13
_STRAINS_HOLD = 1000  # strains lose a few times log10(n) digits: this far nothing that could be warned of
_DENSE_CHECK = 1000
_ROUNDING_LIMIT = 1e-4
_ROUNDING_SEEN = 1e-3
_GLANCES = 7


class AccuracyWarning(UserWarning):
    """The estimated rounding error of a result exceeds what it is usually good for."""


def to_frd(response: Array, omega: Array, ports: Ports) -> "control.FrequencyResponseData":
    """Return a response (outputs, inputs, frequencies) as named python-control data."""
    import control

    return control.frd(response, omega, inputs=list(ports.inputs), outputs=list(ports.outputs), name="structure")


def respond(model: SecondOrderModel, omega: Array) -> Array:
    """Return the response of all of a model's inputs and outputs, shape (outputs, inputs, frequencies).

    Warns
    -----
    AccuracyWarning
        The rounding estimate exceeds 1e-4: the mesh is finer than double precision carries.
    """
    symmetric, antisymmetric = half(model, 1), half(model, -1)
    if symmetric is None or antisymmetric is None:
        return respond_part(model, omega)
    total = np.zeros((len(model.outputs), len(model.inputs), len(omega)), dtype=complex)
    for part in (symmetric, antisymmetric):
        if part.W_in.shape[1] and part.W_out.shape[1]:
            small = respond_part(part.model, omega)
            for o, u in zip(*np.nonzero(part.W_out), strict=True):
                for i, v in zip(*np.nonzero(part.W_in), strict=True):
                    total[o, i] += (part.W_out[o, u] * part.W_in[i, v]) * small[u, v]
    return total


def respond_selected(model: SecondOrderModel, ports: Ports, omega: Array) -> Array:
    """Return the response of some of a model's ports; mirror images are added where that halves the work."""
    if model.mirror is None:
        return respond(model.with_ports(ports), omega)
    ins = model.mirror.completed(ports.inputs, model.inputs)
    outs = model.mirror.completed(ports.outputs, model.outputs)
    whole = respond(model.with_ports(model.ports.select(ins, outs)), omega)
    return whole[: len(ports.outputs), : len(ports.inputs)]


def respond_part(model: SecondOrderModel, omega: Array) -> Array:
    """Return the response as :func:`respond` does, without looking for symmetry."""
    if model.n < _CORE_FROM:
        return _small(model, omega)
    core = _core(model, omega)
    if core is None or core.error > _CORE_ERROR:
        return _by_factorization(model, omega)
    rounding = 0.0
    if model.elastic is None or model.n > _STRAINS_HOLD:
        rounding = rounding_estimate(model, core, _few(omega))
        if rounding > _ROUNDING_SEEN * _ROUNDING_LIMIT:
            rounding = rounding_estimate(model, core, omega)
    _warn(rounding)
    return _small(core.model, omega)


def _few(omega: Array) -> Array:
    return omega[np.linspace(0, len(omega) - 1, min(_GLANCES, len(omega))).astype(int)]


def _core(model: SecondOrderModel, omega: Array) -> Core | None:
    """Return a core, or None for a structure that is not symmetric or not stable enough to have one."""
    if not model.prepared.symmetric:
        return None
    try:
        return build_core(model, omega)
    except (np.linalg.LinAlgError, RuntimeError):
        return None


def _small(model: SecondOrderModel, omega: Array) -> Array:
    """Return the response of a small dense model."""
    if (omega == 0.0).any():
        _check_static(model)
    if model.n > _DIRECT and len(omega) > 4 * model.n:
        by_modes = respond_by_modes(model, omega)
        if by_modes is not None:
            return by_modes
    return direct_response(model, omega)


def _check_static(model: SecondOrderModel) -> None:
    """Raise if the structure can move freely, so that its static response is infinite."""
    K = dense(model.K)
    scale = np.sqrt(np.abs(np.diag(dense(model.M))))
    scale[scale == 0.0] = 1.0
    size = np.linalg.svd(K / np.outer(scale, scale), compute_uv=False)
    if size[-1] <= _FREE * size[0]:
        raise ValueError("omega = 0: the structure moves freely (a rigid-body mode), its static response is infinite")


def direct_response(model: SecondOrderModel, omega: Array) -> Array:
    """Return the response by a dense solution at each frequency.

    Raises
    ------
    ValueError
        The model has an undamped resonance exactly at one of the frequencies.
    """
    s = 1j * omega
    M, C, K = (dense(matrix) for matrix in (model.M, model.C, model.K))
    D = (s**2)[:, None, None] * M + s[:, None, None] * C + K
    try:
        X = np.linalg.solve(D, evaluate(model.ports.B, s))
    except np.linalg.LinAlgError:
        raise ValueError(
            "omega hits an undamped resonance (or a rigid-body mode at 0): the response is infinite"
        ) from None
    return _conditioned(model, s, evaluate(model.ports.L, s) @ X + evaluate(model.ports.E, s))


def _by_factorization(model: SecondOrderModel, omega: Array) -> Array:
    s = 1j * omega
    M, C, K = (sparse.csc_array(matrix) for matrix in (model.M, model.C, model.K))
    L, E, B = evaluate(model.ports.L, s), evaluate(model.ports.E, s), evaluate(model.ports.B, s)
    Y = np.empty(E.shape, dtype=complex)
    if (omega == 0.0).any() and model.n <= _DENSE_CHECK:
        _check_static(model)
    glances = set(np.linspace(0, len(s) - 1, min(_GLANCES, len(s))).astype(int))
    shaken = np.finfo(float).eps * np.abs(K.diagonal())[:, None]
    rounding = 0.0
    for f, value in enumerate(s):
        try:
            solve = splu(sparse.csc_array(K + value * C + value**2 * M)).solve
        except RuntimeError:
            raise ValueError(f"the response at omega = {omega[f]:g} is infinite: an undamped resonance") from None
        X = solve(B[f])
        Y[f] = L[f] @ X + E[f]
        if f in glances:
            size = np.abs(Y[f]).max(axis=0, initial=0.0)
            moved = np.abs(L[f] @ solve(shaken * X)).max(axis=0, initial=0.0)
            rounding = max(rounding, float((moved[size > 0] / size[size > 0]).max(initial=0.0)))
    _warn(rounding)
    return _conditioned(model, s, Y)


def _warn(rounding: float) -> None:
    if rounding > _ROUNDING_LIMIT:
        message = f"rounding error of the frequency response is estimated at {rounding:.1g} of its size"
        warnings.warn(f"{message}: the mesh is finer than double precision carries", AccuracyWarning, stacklevel=4)


def _conditioned(model: SecondOrderModel, s: Array, Y: Array) -> Array:
    after, before = model.ports.conditioning(s)
    return np.moveaxis(after[:, :, None] * Y * before[:, None, :], 0, 2)
