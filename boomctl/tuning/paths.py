"""What leads through a channel of a closed loop at a frequency: from disturbances and from changes of the controller."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.tuning.problem import Closed
from boomctl.tuning.responses import Response


class Passage(NamedTuple):
    """A channel at one frequency: its response, by singular values, and what carries changes of the controller to it.

    A change ``d`` of the controller's matrices changes the response by ``left @ d @ right``, and reads itself through
    ``around``.
    """

    U: Array
    values: Array
    Vh: Array
    left: Array
    right: Array
    around: Array


@dataclass(frozen=True)
class Paths:
    """A channel of a closed loop whose inputs are changes of the controller too, and whose outputs what the controller reads.

    Attributes
    ----------
    response : Response
        The channel.
    into : (n, r) ndarray
        What changes of the controller do to the states, in the channel's coordinates.
    out_of : (c, n) ndarray
        What the controller reads of the states.
    beside : (p + c, m + r) ndarray
        What passes the states by.
    """

    response: Response
    into: Array
    out_of: Array
    beside: Array

    @classmethod
    def of(cls, response: Response, loop: Closed, columns: Array, rows: Array) -> "Paths":
        """Return what leads through a channel of a loop, whose response is known."""
        n, (_, into, out_of) = len(loop.A), loop.coordinates
        top = np.concatenate([response.D, loop.before[n + rows]], axis=1)
        beside = np.concatenate([top, np.concatenate([loop.after[:, n + columns], loop.around], axis=1)])
        return cls(response, into @ loop.before[:n], loop.after[:, :n] @ out_of, beside)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """What all paths do to the states, and what they read of them."""
        into = np.concatenate([self.response.B, self.into], axis=1)
        return into, np.concatenate([self.response.C, self.out_of])

    def through_states(self, omega: Array, power: int) -> Array:
        """Return what passes at finite frequencies through a power of the resolvent, (frequencies, p + c, m + r)."""
        A, (into, out_of) = self.response.A, self._ends
        if A.ndim == 1:
            shares = 1.0 / (1j * omega[:, None] - A)
            weights = shares
            for _ in range(power - 1):
                weights = weights * shares
            return (out_of * weights[:, None, :]) @ into
        resolvent = np.linalg.inv(1j * omega[:, None, None] * np.eye(len(A)) - A)
        return out_of @ np.linalg.matrix_power(resolvent, power) @ into

    def passages(self, omega: Array) -> list[Passage]:
        """Return the channel at some frequencies, infinity among them or not."""
        whole = np.repeat(self.beside[None].astype(complex), len(omega), axis=0)
        finite = np.isfinite(omega)
        if finite.any() and len(self.into):
            whole[finite] += self.through_states(omega[finite], 1)
        p, m = self.response.D.shape
        U, values, Vh = np.linalg.svd(whole[:, :p, :m], full_matrices=False)
        parts = (U, values, Vh, whole[:, :p, m:], whole[:, p:, :m], whole[:, p:, m:])
        return [Passage(*each) for each in zip(*parts, strict=True)]
