"""The least further delay, of one control or one reading, that makes a sampled loop around a continuous plant unstable.

A delay is whole samples ``W`` and a part ``t`` of one.  The loop opened at the signal is ``z^-W h(z, t)``.  At each part of a
grid, eigenvalues tell whether the loop is stable without whole samples, and where ``|h| = 1`` on the unit circle: from the
angles there follow the whole samples at which poles leave the circle.  The least delay of all parts is then refined by
bisection.  The delay is found, not proved: a range of delays narrower than the grid may be missed.
"""

from math import ceil, floor, inf, nan

import numpy as np

from boomctl.analysis.crossings import unit_crossings
from boomctl.analysis.loops import joined, signals_of
from boomctl.arrays import Array
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.modal import sides
from boomctl.lti.sampled import sampled_plant, whole_samples
from boomctl.lti.system import Lti

_PARTS = 32  # of a sample: delays of the grid
_BESIDE = 1e-6  # of a sample, beside a jump
_FOUND = 1e-8  # relative width of the last bracket
_HALVINGS = 40  # of a bracket at most
# relative change of a frequency over which the gain rises or falls
_BESIDE_CROSSING = np.array([1.0 - 1e-6, 1.0, 1.0 + 1e-6])
_SAMPLES = 1000  # whole samples after the first crossing at which poles outside the circle are counted


def least_further_delay(plant: Lti, controller: Lti, delay: float, place: int) -> tuple[float, float]:
    """Compute the least further delay [s] that makes a loop unstable, and its frequency [rad/s]; ``inf`` and NaN without.

    Parameters
    ----------
    plant : Lti
        In continuous time.
    controller : Lti
        In discrete time.
    delay : float
        Of all controls [s].
    place : int
        Which signal is delayed further, of the controls and then the measurements.
    """
    dt, (m, p) = controller.dt, controller.D.shape
    ends = signals_of(controller, plant.input_labels, plant.output_labels, scales=plant.scales)
    P = plant.between(*ends).balanced()

    def unstable_from(part: float) -> tuple[float, float]:
        """Return after how many whole samples, beyond a part of one, the loop is unstable, and the angle a sample there."""
        late = [delay] * m + [0.0] * p
        late[place] += part * dt
        loop = joined(sampled_plant(P, range(m), dt, late[:m], late[m:]), controller, 0.0)
        poles = loop.system.poles
        if (sides(poles, dt) >= 0).any():
            return 0.0, float(abs(np.angle(poles[np.argmax(np.abs(poles))])))
        return _whole_samples(continuous_image(loop.sensitivity.between([place], [place])), dt)

    jump = 1.0 - whole_samples(delay, dt)[1] / dt  # where a control passes the sample; a feedthrough jumps there
    parts = np.unique(np.r_[np.arange(_PARTS) / _PARTS, np.array([jump - _BESIDE, jump + _BESIDE, -_BESIDE]) % 1.0])
    delays = [part + unstable_from(part)[0] for part in parts.tolist()]
    least = int(np.argmin(delays))
    high = delays[least]
    if high == inf:
        return inf, nan
    low = max(high - float(parts[least] - parts[least - 1]) % 1.0, 0.0)
    for _ in range(_HALVINGS):
        if high - low <= _FOUND * high:
            break
        middle = 0.5 * (low + high)
        unstable = unstable_from(middle % 1.0)[0] <= floor(middle)
        low, high = (low, middle) if unstable else (middle, high)
    return float(0.5 * (low + high) * dt), unstable_from(high % 1.0)[1] / dt


def _whole_samples(S: Lti, dt: float) -> tuple[float, float]:
    """Return after how many whole samples of delay a loop of one signal is unstable, and the angle a sample there.

    Its sensitivity is given, mapped to continuous time.
    """
    if float(S.D[0, 0]) <= 0.5:  # the gain at z = -1 is one or more: one sample adds a pole beyond it
        return 1.0, np.pi

    def respond(omega: Array) -> Array:
        return S.response(omega, quiet=True)[0, 0]

    omega = unit_crossings(S, respond)
    omega = omega[omega > 0.0]
    if not len(omega):
        return inf, nan
    turn = omega_of_image(omega, dt) * dt
    below, at_crossing, above = (1.0 - 1.0 / respond(np.outer(_BESIDE_CROSSING, omega).ravel())).reshape(3, -1)
    at_one, leaving = np.angle(at_crossing) % (2.0 * np.pi) / turn, np.sign(np.abs(below) - np.abs(above))
    # with each more turn of a crossing, two poles leave the circle where the gain falls, and return where it rises
    samples = ceil(at_one.min()) + np.arange(_SAMPLES)
    crossed = np.maximum(np.floor((samples[:, None] - at_one) * turn / (2.0 * np.pi)) + 1.0, 0.0)
    outside = np.flatnonzero(crossed @ leaving > 0.0)
    return (float(samples[outside[0]]), float(turn[np.argmin(at_one)])) if len(outside) else (inf, nan)
