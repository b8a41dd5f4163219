"""Certified norms and resonances of second-order models, through small cores that stand for them.

A symmetric model stands as its two halves, a large one as Galerkin cores.  A core speaks for the model up to the
frequency it was built for; above it, dissipation bounds the response: with ``D = K - omega^2 M + i omega C`` and ``C``
positive definite, ``|L D^-1 B(omega)| <= |C^-1/2 L^T| |C^-1/2 B(omega)|/omega``.
"""

from math import inf

import numpy as np
from scipy import linalg, sparse

from boomctl.analysis.norm import NormCertificate, grows_towards, matrices_norm
from boomctl.arrays import Array
from boomctl.lti.frequency import Resonances, singular_values
from boomctl.lti.system import Lti
from boomctl.structure.matrices import dense, halves
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.core import Core, build_core
from boomctl.structure.response.direct import direct_response, respond
from boomctl.structure.response.pencil import factorized
from boomctl.structure.response.poles import damped_poles, first_order_poles, undamped_modes
from boomctl.structure.response.realisation import realize

_CORE_FROM = 40  # coordinates from which on a core is worth its building (a choice)
# verified error of a core, relative, that a norm may be certified with: a hundredth of what that allows
_CORE_ERROR = 1e-7
_CORE_POINTS = 16  # frequencies at which a core is built (a choice)
_BAND = 8  # elastic modes that a picture shows and a core speaks for (a choice)
_SPARE = 3  # modes asked for beyond these, so that as many are left without the rigid ones of a plane body
_REACH = 4.0  # how far above those modes a core reaches, so that above it dissipation bounds the response (a choice)
_RIGID = 1e-8  # share of the highest frequency asked for below which a mode is a rigid-body one: root of rounding
_LARGEST_DENSE = 400  # coordinates up to which a structure without a core is taken whole (a choice of run time)
_SCANNED = 200  # frequencies of a scan without proof (a choice)
_SHOWN = 1.5  # how far above its modes a band reaches, so that the last peak is seen from both sides (a choice)
_BELOW = 0.25  # where it begins, relative to the lowest mode (a choice)
_ALMOST_ZERO = 1e-9  # [rad/s], in place of zero for integrated inputs, whose response there is infinite
_INDEFINITE = 1e-9  # share of the largest eigenvalue up to which a negative one is rounding


def orthonormal_parts(model: SecondOrderModel) -> tuple[SecondOrderModel, ...]:
    """Return models whose singular values together are those of ``model``: its halves if it splits, or itself."""
    parts = halves(model.structure, model.ports)
    return (model,) if parts is None else tuple(SecondOrderModel.of(part.structure, part.ports) for part in parts)


def resonances(model: SecondOrderModel) -> Resonances:
    """Return the poles of a model up to a few times its eighth mode, and a band that shows them."""
    band = _modal_band(model)
    if band is None:
        return Resonances.of(first_order_poles(dense(model.M), dense(model.C), dense(model.K)))
    low, top = band[0], _SHOWN * band[1]
    return Resonances(np.concatenate([_poles(part, low, top) for part in orthonormal_parts(model)]), _BELOW * low, top)


def _modal_band(model: SecondOrderModel) -> tuple[float, float] | None:
    """Return the lowest and the eighth elastic frequency [rad/s]; None for matrices that have no real modes."""
    try:
        frequencies, _ = undamped_modes(model.structure, min(_BAND + _SPARE, model.n))
    except ValueError:
        return None
    elastic = frequencies[frequencies > _RIGID * frequencies[-1]][:_BAND]
    return (float(elastic[0]), float(elastic[-1])) if len(elastic) else None


def _poles(part: SecondOrderModel, low: float, top: float) -> Array:
    core = _built(part, low, top) if part.n >= _CORE_FROM else None
    small = part.structure if core is None else core.structure
    if small.n > _LARGEST_DENSE:
        return damped_poles(part.structure, _BAND)
    poles = first_order_poles(dense(small.M), dense(small.C), dense(small.K))
    return poles[(poles.imag >= 0.0) & (np.abs(poles) <= top)]


def _built(part: SecondOrderModel, low: float, top: float) -> Core | None:
    """Return a core for the band, or None where there is none."""
    try:
        return build_core(part.structure, part.ports, np.geomspace(0.1 * low, top, _CORE_POINTS))
    except (np.linalg.LinAlgError, RuntimeError):
        return None


def model_norm(model: SecondOrderModel) -> NormCertificate:
    """Return the certified H-infinity norm of a second-order model; infinite with undamped or integrating modes.

    Raises
    ------
    ValueError
        A response that is not proper (an output that needs a derivative of an input).
    """
    found = [_part_norm(part) for part in orthonormal_parts(model)]
    if not found:
        return NormCertificate(0.0, 0.0, 0.0, "no response")
    largest = max(found, key=lambda certificate: certificate.lower)
    return NormCertificate(largest.lower, max(item.upper for item in found), largest.omega, largest.method)


def _part_norm(model: SecondOrderModel) -> NormCertificate:
    band = _modal_band(model)
    if model.n < _CORE_FROM or band is None:
        return _small_norm(model)
    top = _REACH * band[1]
    core = _built(model, band[0], top)
    if core is None:
        return _small_norm(model) if model.n <= _LARGEST_DENSE else _scanned(model, band[0], top)
    inside = _small_norm(SecondOrderModel.of(core.structure, core.ports))
    if inside.lower == inf:
        return inside
    if core.error > _CORE_ERROR:
        return NormCertificate(inside.lower, inf, inside.omega, "a Galerkin core that could not be verified")
    upper = max(inside.upper * (1.0 + core.error), _dissipation_bound(model, top))
    return NormCertificate(inside.lower, upper, inside.omega, f"{inside.method}; dissipation above {top:.3g} rad/s")


def _scanned(model: SecondOrderModel, low: float, top: float) -> NormCertificate:
    """Return the largest value found on a grid, for a large structure that no small one stands for."""
    omega = np.geomspace(0.1 * low, top, _SCANNED)
    values = singular_values(respond(model.structure, model.ports, omega).values)[0]
    best = int(np.argmax(values))
    return NormCertificate(float(values[best]), inf, float(omega[best]), "a scan, without proof")


def _small_norm(small: SecondOrderModel) -> NormCertificate:
    """Return the norm of a small model, in modal coordinates if it has real modes."""
    try:
        frequencies, V = undamped_modes(small.structure)
    except ValueError:
        return matrices_norm(realize(small.structure, small.ports).balanced(), lambda omega: _response(small, omega))
    if any(small.ports.integrators) or frequencies[0] <= _RIGID * frequencies[-1]:
        low = float(frequencies[frequencies > _RIGID * frequencies[-1]].min(initial=np.inf))
        if grows_towards(lambda omega: _response(small, omega), 0.0, low if np.isfinite(low) else 1.0):
            return NormCertificate(inf, inf, 0.0, "an integrating or rigid-body mode")
    return matrices_norm(in_modes(small, V).balanced(), lambda omega: _response(small, omega))


def in_modes(model: SecondOrderModel, V: Array) -> Lti:
    """Return the state-space form of a model over undamped modes, projected through its strain rows where it has them."""
    names = tuple(f"mode{i + 1}" for i in range(V.shape[1]))
    return realize(model.structure.projected(V, names), model.ports.congruent(V))


def modal_realization(model: SecondOrderModel) -> Lti:
    """Return a state-space system of a model in the coordinates of its undamped modes, or, without them, its own.

    Raises
    ------
    ValueError
        An output that needs a derivative of an input.
    """
    try:
        _, V = undamped_modes(model.structure)
    except ValueError:
        return realize(model.structure, model.ports)
    return in_modes(model, V)


def _response(small: SecondOrderModel, omega: Array) -> Array:
    return direct_response(
        small.structure, small.ports, np.maximum(omega, _ALMOST_ZERO) if any(small.ports.integrators) else omega
    )


def _dissipation_bound(model: SecondOrderModel, omega: float) -> float:
    """Return a bound of the response at all frequencies from ``omega`` on; ``inf`` where there is none."""
    ports = model.ports
    if ports.B[2].any() or any(line.any() for line in ports.L[1:]) or any(e.any() for e in ports.E[1:]):
        return inf
    C = sparse.csr_array(model.C)
    try:
        solve = factorized(C)
        reading, *acting = (_gram(solve, columns) for columns in (ports.L[0].T, ports.B[0], ports.B[1]))
    except (RuntimeError, linalg.LinAlgError, ValueError):
        return inf
    return reading * (acting[0] / omega + acting[1]) + float(np.linalg.norm(ports.E[0], 2))


def _gram(solve: object, columns: Array) -> float:
    """Return the largest singular value of ``C^-1/2 columns``."""
    gram = columns.T @ solve(columns)  # type: ignore[operator]
    values = linalg.eigvalsh(0.5 * (gram + gram.T))
    if values[0] < -_INDEFINITE * abs(values[-1]):
        raise ValueError("damping is not definite")
    return float(np.sqrt(max(values[-1], 0.0)))
