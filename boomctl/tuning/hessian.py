"""Second derivatives of peaks of singular values by the free parameters, at the frequency of the peak.

A change ``d`` of the controller's matrices, and of the plant's, changes a response by ``L d (I - S d)^-1 R``, so that all
derivatives are known in closed form; a simple singular value is an eigenvalue of ``[[0, G], [G^H, 0]]``, whose second
derivative is that of perturbation theory (Lancaster 1964).
"""

import numpy as np

from boomctl.arrays import Array
from boomctl.tuning.point import ActiveFunction, Point

_SEPARATION = 1e-3  # relative distance of other singular values to include; nearer ones are separate active functions
_SHARP = 1e-12  # relative curvature over frequency above which the motion of the peak frequency is included


def peak_hessian(point: Point, function: ActiveFunction) -> Array:
    """Return the second derivatives of the logarithm of a peak."""
    assert function.passage is not None
    model, omega, (U, values, Vh, left, right, around) = function.model, function.omega, function.passage
    k, (p, r), (c, m) = len(point.x), left.shape, right.shape
    jacobian = point.jacobian(model).reshape(k, r, c)
    u, v, top = U[:, 0], Vh[0].conj(), float(values[0])
    before, after = u.conj() @ left, right @ v
    a, b = before @ jacobian, jacobian @ after  # derivatives by every free parameter, from the left and from the right
    alpha, beta = a @ right, b @ left.T  # u^H G_i and G_i v
    mixed = a @ around @ b.T
    second = np.real(mixed + mixed.T) + point.hessian(model, np.real(np.outer(before, after)))
    gradient = np.real(a @ after)
    curve = point.curves[model, function.channel]
    moving = np.isfinite(omega) and omega > 0.0 and len(curve.A) > 0
    if moving:
        twofold = -1j * curve.through_states(np.array([omega]), 2)[0]
        threefold = -2.0 * curve.through_states(np.array([omega]), 3)[0, :p, :m]
        by_omega = twofold[:p, :m]
        alpha, beta = np.vstack([alpha, u.conj() @ by_omega]), np.vstack([beta, by_omega @ v])
        turned = np.real((u.conj() @ twofold[:p, m:]) @ jacobian @ after + a @ (twofold[p:, :m] @ v))
        whole = np.empty((k + 1, k + 1))
        whole[:k, :k], whole[:k, k], whole[k, :k] = second, turned, turned
        whole[k, k] = np.real(u.conj() @ threefold @ v)
        second, gradient = whole, np.append(gradient, np.real(u.conj() @ by_omega @ v))
    second = second + _from_others(alpha, beta, U, values, Vh)
    whole = second / top - np.outer(gradient, gradient) / top**2
    if not moving:
        return whole
    bend = whole[k, k]
    if bend >= -_SHARP / max(omega, 1.0) ** 2:
        return whole[:k, :k]
    return whole[:k, :k] - np.outer(whole[:k, k], whole[k, :k]) / bend


def _from_others(alpha: Array, beta: Array, U: Array, values: Array, Vh: Array) -> Array:
    """Return the contribution of other singular vectors to the second derivatives; ``alpha`` is u^H G_i, ``beta`` G_i v."""
    top = float(values[0])
    along, across = alpha @ Vh.conj().T, (beta @ U.conj()).conj()
    both = 0.5 * np.concatenate([across + along, across - along], axis=1)
    gaps = np.concatenate([top - values, top + values])
    separate = gaps > _SEPARATION * top
    result = 2.0 * _squared(both[:, separate], 1.0 / gaps[separate])
    for vectors, inside in ((alpha, along), (beta, across)):
        if vectors.shape[1] > len(values):  # vectors without a singular value
            result += (_squared(vectors) - _squared(inside)) / top
    return result


def _squared(c: Array, weights: Array | float = 1.0) -> Array:
    """Return the real part of ``c diag(weights) c^H``."""
    return (c.real * weights) @ c.real.T + (c.imag * weights) @ c.imag.T
