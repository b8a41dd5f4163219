"""Least further delay, of one control or one measurement, that makes a sampled loop around a continuous plant unstable.

A delay consists of ``W`` whole samples and a fraction ``t`` of one.  The loop opened at the signal is ``z^-W h(z, t)``.  At
each fraction of a grid, eigenvalues yield the stability of the loop without whole samples, and the points of the unit circle
with ``|h| = 1``, whose angles yield the whole samples at which poles leave the circle.  The least delay of all fractions is
then refined by bisection.  The delay is not proved: the search may overlook a range of delays narrower than the grid.
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

_PARTS = 32  # Number of grid delays per sample.
_OFFSET = 1e-6  # Distance of additional grid delays from a discontinuity, in samples.
_BRACKET_RTOL = 1e-8  # Relative width of the last bracket.
_HALVINGS = 40  # Largest number of bisections.
# Frequencies relative to a crossing at which the sign of the gain's derivative is determined.
_NEAR_CROSSING = np.array([1.0 - 1e-6, 1.0, 1.0 + 1e-6])
_SAMPLES = 1000  # Whole samples after the first crossing at which poles outside the circle are counted.


def least_further_delay(plant: Lti, controller: Lti, delay: float, index: int) -> tuple[float, float]:
    """Compute the least further delay [s] that makes a loop unstable, and its frequency [rad/s]; ``inf`` and NaN without.

    Parameters
    ----------
    plant : Lti
        Plant in continuous time.
    controller : Lti
        Controller in discrete time.
    delay : float
        Delay of all controls [s].
    index : int
        Index of the signal with the further delay, among the controls followed by the measurements.
    """
    dt, (m, p) = controller.dt, controller.D.shape
    ends = signals_of(controller, plant.input_labels, plant.output_labels, scales=plant.scales)
    P = plant.between(*ends).balanced()

    def unstable_from(part: float) -> tuple[float, float]:
        """Return the number of whole samples, beyond a fraction of one, of an unstable loop, and the angle per sample."""
        late = [delay] * m + [0.0] * p
        late[index] += part * dt
        loop = joined(sampled_plant(P, range(m), dt, late[:m], late[m:]), controller, 0.0)
        poles = loop.system.poles
        if (sides(poles, dt) >= 0).any():
            return 0.0, float(abs(np.angle(poles[np.argmax(np.abs(poles))])))
        return _whole_samples(continuous_image(loop.sensitivity.between([index], [index])), dt)

    jump = 1.0 - whole_samples(delay, dt)[1] / dt  # a control crosses the sample, and a feedthrough is discontinuous
    parts = np.unique(np.r_[np.arange(_PARTS) / _PARTS, np.array([jump - _OFFSET, jump + _OFFSET, -_OFFSET]) % 1.0])
    delays = [part + unstable_from(part)[0] for part in parts.tolist()]
    least = int(np.argmin(delays))
    high = delays[least]
    if high == inf:
        return inf, nan
    low = max(high - float(parts[least] - parts[least - 1]) % 1.0, 0.0)
    for _ in range(_HALVINGS):
        if high - low <= _BRACKET_RTOL * high:
            break
        middle = 0.5 * (low + high)
        unstable = unstable_from(middle % 1.0)[0] <= floor(middle)
        low, high = (low, middle) if unstable else (middle, high)
    return float(0.5 * (low + high) * dt), unstable_from(high % 1.0)[1] / dt


def _whole_samples(S: Lti, dt: float) -> tuple[float, float]:
    """Return the number of whole samples of delay that make a loop of one signal unstable, and the angle per sample.

    ``S`` is the loop's sensitivity, mapped to continuous time.
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
    below, at_crossing, above = (1.0 - 1.0 / respond(np.outer(_NEAR_CROSSING, omega).ravel())).reshape(3, -1)
    at_one, leaving = np.angle(at_crossing) % (2.0 * np.pi) / turn, np.sign(np.abs(below) - np.abs(above))
    # With each further turn of a crossing, two poles leave the circle if the gain falls, and return if it rises.
    samples = ceil(at_one.min()) + np.arange(_SAMPLES)
    crossed = np.maximum(np.floor((samples[:, None] - at_one) * turn / (2.0 * np.pi)) + 1.0, 0.0)
    outside = np.flatnonzero(crossed @ leaving > 0.0)
    return (float(samples[outside[0]]), float(turn[np.argmin(at_one)])) if len(outside) else (inf, nan)
