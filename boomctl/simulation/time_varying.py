"""Controllers whose matrices change from sample to sample, as along a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import exactly, finite_array, positive, sequence, signal_name
from boomctl.printing import between, count


@dataclass(frozen=True, repr=False, eq=False)
class TimeVaryingController:
    """Controller ``x+ = A_k x + B_k y + L_k (applied - commanded)``, ``commanded = C_k x + D_k y``; the last matrices stay.

    Parameters
    ----------
    A, B, C, D : array_like
        The matrices at each sample, (k, n, n), (k, n, p), (k, m, n) and (k, m, p).
    input_labels, output_labels : sequence of str
        Names of the p measurements and the m controls.
    dt : float
        Time between samples [s].
    anti_windup_gain : array_like, optional
        Gain ``L`` by which the applied control corrects the state, (k, n, m); zero by default.

    Raises
    ------
    TypeError, ValueError
        If shapes of matrices do not match, a matrix is not finite, a name is used twice, or `dt` is not positive.

    Examples
    --------
    A gain that grows while a hub turns:

    >>> import boomctl as bc
    >>> import numpy as np
    >>> gains = np.linspace(-100.0, -200.0, 5)[:, None, None] * np.array([[1.0, 2.0]])
    >>> none = np.zeros((5, 0, 0)), np.zeros((5, 0, 2)), np.zeros((5, 1, 0))
    >>> bc.simulation.TimeVaryingController(*none, gains, ["hub_angle", "hub_speed"], ["torque"], dt=0.01)
    TimeVaryingController: 0 states, every 0.01 s, hub_angle, hub_speed -> torque
      5 samples, the last matrices stay
    """

    A: Array
    B: Array
    C: Array
    D: Array
    input_labels: Sequence[str]
    output_labels: Sequence[str]
    dt: float
    anti_windup_gain: Array | None = None

    def __post_init__(self) -> None:
        for what in ("input_labels", "output_labels"):
            labels = sequence(what, getattr(self, what), "str")
            result = tuple(signal_name(f"{what}[{i}]", item) for i, item in enumerate(labels))
            if len(set(result)) < len(result) or not result:
                raise ValueError(f"{what} = {result!r}: expected one name or more, each once")
            object.__setattr__(self, what, result)
        object.__setattr__(self, "dt", positive("dt", self.dt))
        for letter in "ABCD":
            object.__setattr__(self, letter, finite_array(letter, getattr(self, letter), ndim=3))
        (k, n), p, m = self.A.shape[:2], len(self.input_labels), len(self.output_labels)
        gain = np.zeros((k, n, m)) if self.anti_windup_gain is None else self.anti_windup_gain
        object.__setattr__(self, "anti_windup_gain", finite_array("anti_windup_gain", gain, ndim=3))
        wanted = {"A": (k, n, n), "B": (k, n, p), "C": (k, m, n), "D": (k, m, p), "anti_windup_gain": (k, n, m)}
        for letter, shape in wanted.items():
            if k < 1 or getattr(self, letter).shape != shape:
                raise ValueError(
                    f"{letter} has shape {getattr(self, letter).shape}; expected {(max(k, 1), *shape[1:])}, a matrix for "
                    f"each of one sample or more"
                )

    def __repr__(self) -> str:
        signals = between(self.input_labels, self.output_labels)
        first = f"{count(self.A.shape[1], 'state')}, every {exactly(self.dt)} s, {signals}"
        return f"TimeVaryingController: {first}\n  {count(len(self.A), 'sample')}, the last matrices stay"
