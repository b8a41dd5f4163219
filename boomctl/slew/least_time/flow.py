"""Linear motion under a torque that is constant piece by piece: matrix exponentials, no time steps."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """``z' = A z + B u``.

    Attributes
    ----------
    A, B : ndarray, n x n and n
    """

    A: Array
    B: Array

    def step(self, h: float) -> tuple[Array, Array]:
        """``exp(A h)`` and the response ``int_0^h exp(A s) ds B`` to unit torque."""
        from scipy.linalg import expm

        n = self.B.size
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = self.A, self.B
        whole = expm(block * h)
        return whole[:n, :n], whole[:n, n]

    def responses(self, duration: float, intervals: int) -> Array:
        """End states that unit torque on each of equal intervals causes, n x intervals."""
        E, push = self.step(duration / intervals)
        columns = np.empty((self.B.size, intervals))
        for k in range(intervals - 1, -1, -1):
            columns[:, k] = push
            push = E @ push
        return columns

    def sampled(self, start: Array, edges: Array, values: Array, samples: int = 1) -> tuple[Array, Array]:
        """Instants [s] and states at `samples` places an interval and at the end, the torque held between edges."""
        times, states, z = [float(edges[0])], [start], start
        steps: dict[float, tuple[Array, Array]] = {}
        for k, value in enumerate(values):
            h = (edges[k + 1] - edges[k]) / samples
            key = float(f"{h:.15g}")
            E, push = steps.setdefault(key, self.step(key))
            for j in range(samples):
                z = E @ z + push * value
                times.append(float(edges[k] + (j + 1) * h))
                states.append(z)
        return np.array(times), np.array(states)
