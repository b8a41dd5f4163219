"""The least further delay, of one control or one reading, that makes a sampled loop around a continuous plant unstable.

A delay is whole samples and a part of one.  Whole samples turn the loop by ``exp(-j omega dt)`` each; a part of one changes
what the controller sees of the plant, so that its gain at a frequency changes as well.  Where the two together bring the
loop to one is found by Newton's method from where the angle alone would; that nothing is unstable before is looked at.  A
feedthrough jumps where a control passes a sample, and a loop may become unstable there without ever being one.
"""

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from boomctl.analysis.loops import signals_of
from boomctl.analysis.sampled_loops.sampled_plant import sampled_plant, whole_samples
from boomctl.arrays import Array
from boomctl.lti.modal import sides
from boomctl.lti.system import Lti, lower_lft

_TRIED = 4  # crossings followed, those of least delay; the first is it, but for aliases
_FURTHER = 8.0  # times as far as angles say, at which no more delays are looked at (a choice)
_STEPS = 20  # of Newton's method: five do
_DIFFERENCE = 1e-6  # of a frequency and of a delay, for slopes: their cube root of rounding is near
_FOUND = 1e-10  # change of frequency and delay, relative, at which the search ends
_LOOKED_AT = (
    8  # delays below the one found at which the loop must be stable, so many a sample, to their square (a choice)
)
_MANY = 60  # states of a loop with its delay, beyond which it is looked at less often (a choice)
_STATES = 300  # up to which it is looked at: tens of milliseconds each (a choice)
_AFTER = 1e-6  # of a sample, beside a jump: far above rounding, which must not say on which side of it a delay is
_HALVINGS = 60  # of a bracket of delays


@dataclass(frozen=True)
class FurtherDelay:
    """A sampled loop and the signal, a control or a measurement, that is delayed further.

    Attributes
    ----------
    plant, controller : Lti
        The plant in continuous time between the controller's signals, in their order.
    delay : float
        That of all controls [s].
    control, measurement : int or None
        Which of them is delayed; the other is None.
    """

    plant: Lti
    controller: Lti
    delay: float
    control: int | None
    measurement: int | None

    @classmethod
    def of(cls, plant: Lti, controller: Lti, delay: float, signal: str) -> "FurtherDelay":
        """Return the loop of a plant and a controller, found by name, delayed at a signal."""
        acting, measured = signals_of(controller, plant.inputs, plant.outputs)
        control = controller.outputs.index(signal) if signal in controller.outputs else None
        measurement = controller.inputs.index(signal) if control is None else None
        return cls(plant.between(acting, measured), controller, delay, control, measurement)

    def sampled(self, further: float) -> Lti:
        """Return the plant from sample to sample with a further delay [s] at the signal."""
        delays, readings = [self.delay] * len(self.controller.C), [0.0] * self.controller.B.shape[1]
        if self.control is not None:
            delays[self.control] += further
        elif self.measurement is not None:
            readings[self.measurement] = further
        return sampled_plant(self.plant, range(len(delays)), self.controller.dt, delays, readings)

    def stable(self, further: float) -> bool:
        """Return whether the loop with a further delay is stable."""
        closed = lower_lft(self.sampled(further), self.controller)
        return bool((sides(closed.balanced().poles, closed.dt) < 0).all())

    def response(self, omega: float, further: float) -> complex:
        """Return the loop opened at the signal, all others closed, with a further delay there."""
        dt = self.controller.dt
        whole, rest = whole_samples(further, dt)
        at = np.array([omega])
        G, K = (system.response(at, quiet=True)[:, :, 0] for system in (self.sampled(rest), self.controller))
        turned = complex(np.exp(-1j * omega * dt * whole))
        if self.control is not None:
            others = np.arange(len(K)) != self.control
            y = np.linalg.solve(np.eye(len(G)) - G[:, others] @ K[others], G[:, self.control])
            return complex(K[self.control] @ y) * turned
        others = np.arange(len(G)) != self.measurement
        u = np.linalg.solve(np.eye(len(K)) - K[:, others] @ G[others], K[:, self.measurement])
        return complex(G[self.measurement] @ u) * turned

    def least(self, guesses: list[tuple[float, float]]) -> tuple[float, float]:
        """Return the least delay [s] and its frequency [rad/s], from those by the angle alone; ``inf`` and ``nan`` without.

        Where no delay is found by angles, two samples are looked at; where none of theirs is one, up to eight times as far.
        """
        dt = self.controller.dt
        turns = [(delay + k * 2.0 * np.pi / omega, omega) for delay, omega in guesses for k in (0, 1)]
        followed = [self._followed(*guess) for guess in sorted(turns)[:_TRIED]]
        found = min((place for place in followed if place is not None), default=None)
        end = found[0] if found else 2.0 * dt + 2.0 * min(guesses, default=(0.0, nan))[0]
        stable_until = 0.0
        for further in self._looked_at(0.0, end):
            if not self.stable(further):
                return self._first(stable_until, further)
            stable_until = further
        if found or not guesses:
            return found or (inf, nan)
        for further in self._looked_at(end, _FURTHER * end):
            if not self.stable(further):
                return self._first(stable_until, further)
            stable_until = further
        return inf, nan

    def _looked_at(self, start: float, end: float) -> list[float]:
        """Return delays between two, at which the loop is looked at; none where it has too many states.

        Where an output has a feedthrough from a control, it jumps as that control passes the sample: there too.
        """
        dt = self.controller.dt
        states = len(self.plant.A) + len(self.controller.A) + end / dt
        if states > _STATES:
            return []
        most = _LOOKED_AT**2 if states <= _MANY else _LOOKED_AT
        count = int(min(max(_LOOKED_AT, np.ceil(_LOOKED_AT * (end - start) / dt)), most))
        places = start + (end - start) * np.arange(1, count) / count
        if self.plant.D.any():
            first = int(np.floor((self.delay + start) / dt)) + 1
            jumps = (np.arange(first, first + int((end - start) / dt) + 2) + _AFTER) * dt - self.delay
            places = np.concatenate([places, jumps[(jumps > start) & (jumps < end)]])
        return np.unique(places).tolist()

    def _followed(self, delay: float, omega: float) -> tuple[float, float] | None:
        """Return where the loop is one, by Newton's method on ``log L`` over the logarithm of the frequency and the delay."""
        dt, x = self.controller.dt, np.array([np.log(omega), delay])
        top, unit = np.log(np.pi / dt), np.array([1.0, delay + dt])

        def miss(x: Array) -> Array:
            value = np.log(self.response(float(np.exp(x[0])), float(x[1])))
            return np.array([value.real, value.imag])

        for _ in range(_STEPS):
            try:
                here = miss(x)
                # one-sided, towards lower frequencies and longer delays: both are there
                steps = np.diag([-_DIFFERENCE, _DIFFERENCE]) * unit
                slopes = np.array([(miss(x + step) - here) / step[k] for k, step in enumerate(steps)]).T
                change = np.linalg.solve(slopes, -here)
            except np.linalg.LinAlgError:
                return None
            if not np.isfinite(change).all():
                return None
            x = np.array([min(x[0] + np.clip(change[0], -0.5, 0.5), top), max(x[1] + change[1], 0.0)])
            if (np.abs(change) <= _FOUND * unit).all():
                return float(x[1]), float(np.exp(x[0]))
        return None

    def _first(self, low: float, high: float) -> tuple[float, float]:
        """Return the delay at which the loop becomes unstable, stable at one and unstable at the other, and its frequency."""
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if high - low <= _FOUND * high or not low < middle < high:
                break
            low, high = (middle, high) if self.stable(middle) else (low, middle)
        closed = lower_lft(self.sampled(high), self.controller)
        pole = closed.poles[np.argmax(np.abs(closed.poles))]
        return high, float(abs(np.angle(pole))) / self.controller.dt
