"""The least further delay, of one control or one reading, that makes a sampled loop around a continuous plant unstable.

A delay is whole samples ``W`` and a part ``t`` of one.  The loop opened at the signal is ``z^-W h(z, t)``.  At each part of a
grid, eigenvalues tell whether the loop is stable without whole samples, and where ``|h| = 1`` on the unit circle: from the
angles there follow the whole samples at which poles leave the circle.  The least delay of all parts is then refined by
bisection.  The delay is found, not proved: a range of delays narrower than the grid may be missed.
"""

from dataclasses import dataclass
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
_BESIDE_CROSSING = np.array(
    [1.0 - 1e-6, 1.0, 1.0 + 1e-6]
)  # relative change of a frequency over which the gain rises or falls
_SAMPLES = 1000  # whole samples after the first crossing at which poles outside the circle are counted


@dataclass(frozen=True)
class FurtherDelay:
    """A sampled loop and the signal, a control or a measurement, that is delayed further.

    Attributes
    ----------
    plant, controller : Lti
        The plant in continuous time between the controller's signals, in their order.
    delay : float
        That of all controls [s].
    acting : bool
        Whether a control is delayed, or a measurement.
    index : int
        Which one.
    """

    plant: Lti
    controller: Lti
    delay: float
    acting: bool
    index: int

    @classmethod
    def of(cls, plant: Lti, controller: Lti, delay: float, signal: str) -> "FurtherDelay":
        """Return the loop of a plant and a controller, found by name, delayed at a signal."""
        between, acting = (
            signals_of(controller, plant.input_labels, plant.output_labels, scales=plant.scales),
            signal in controller.output_labels,
        )
        index = (controller.output_labels if acting else controller.input_labels).index(signal)
        return cls(plant.between(*between).balanced(), controller, delay, acting, index)

    def least(self) -> tuple[float, float]:
        """Return the least delay [s] that makes the loop unstable, and its frequency [rad/s]; ``inf`` and NaN without."""
        dt = self.controller.dt
        jump = (
            1.0 - whole_samples(self.delay, dt)[1] / dt
        )  # where a control passes the sample; a feedthrough jumps there
        parts = np.unique(np.r_[np.arange(_PARTS) / _PARTS, np.array([jump - _BESIDE, jump + _BESIDE, -_BESIDE]) % 1.0])
        delays = [part + self._unstable_from(part)[0] for part in parts.tolist()]
        least = int(np.argmin(delays))
        high = delays[least]
        if high == inf:
            return inf, nan
        low = max(high - float(parts[least] - parts[least - 1]) % 1.0, 0.0)
        for _ in range(_HALVINGS):
            if high - low <= _FOUND * high:
                break
            middle = 0.5 * (low + high)
            if self._unstable_from(middle % 1.0)[0] <= floor(middle):
                high = middle
            else:
                low = middle
        return float(0.5 * (low + high) * dt), self._unstable_from(high % 1.0)[1] / dt

    def _unstable_from(self, part: float) -> tuple[float, float]:
        """Return after how many whole samples, beyond a part of one, the loop is unstable, and the angle a sample there."""
        K, dt = self.controller, self.controller.dt
        delays, readings = [self.delay] * len(K.C), [0.0] * K.B.shape[1]
        (delays if self.acting else readings)[self.index] += part * dt
        loop = joined(sampled_plant(self.plant, range(len(delays)), dt, delays, readings), K, 0.0)
        poles = loop.system.poles
        if (sides(poles, dt) >= 0).any():
            return 0.0, float(abs(np.angle(poles[np.argmax(np.abs(poles))])))
        at = self.index + (0 if self.acting else len(delays))
        S = continuous_image(loop.sensitivity.between([at], [at]))
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
