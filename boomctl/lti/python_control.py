"""python-control, imported in one place so that its state-space systems can be pickled; systems in scaled signals.

A ``control.StateSpace`` stores two functions that its constructor creates (python-control 0.10.2), which cannot be pickled.
Once this module is imported, and boomctl imports python-control only here, pickle and copy rebuild such a system from its
matrices, names and sampling time instead, in the entire process and also for systems created outside boomctl.
"""

import copyreg
from collections.abc import Mapping
from typing import Any

import control

UNSCALED = "_boomctl_unscaled"  # attribute of a state-space system whose signals are in the units of the machine


class ScaledStateSpace(control.StateSpace):
    """State-space system whose signals are divided by their scales.

    A scale is the value of a signal, in its own unit, that is scaled to one. `boomctl.scale_signals` returns such a
    system. The scales are retained by `boomctl.reduce`, `boomctl.generalized_plant`, `boomctl.mixed_sensitivity`,
    `boomctl.with_state_outputs`, `boomctl.discretize`, `boomctl.analysis.sample_plant`, `boomctl.feedback_loop` and
    `boomctl.synthesis.select_channels`. Arithmetic and conversions of python-control return a plain
    ``control.StateSpace``, whose scales are unknown.

    Parameters
    ----------
    *args, **kwargs
        Passed to ``control.StateSpace``.
    scales : mapping from str to float
        Scale of each input and output [unit of the signal]. Signals without an entry have scale 1.

    Attributes
    ----------
    scales : dict of str to float
        Scale of each input and output, by label.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> spring = control.ss([[-1.0]], [[1.0]], [[0.001]], 0.0, inputs="force", outputs="position")
    >>> bc.scale_signals(spring, {"force": 100.0, "position": 0.001}).scales
    {'force': 100.0, 'position': 0.001}
    """

    def __init__(self, *args: Any, scales: Mapping[str, float], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._boomctl_scales = tuple(scales.get(label, 1.0) for label in (*self.input_labels, *self.output_labels))

    @property
    def scales(self) -> dict[str, float]:
        """Scale of each input and output, by label."""
        return dict(zip((*self.input_labels, *self.output_labels), self._boomctl_scales, strict=True))


def _state_space(matrices: tuple[Any, ...], dt: float | bool | None, names: dict[str, Any]) -> control.StateSpace:
    """Return the system again; the process that unpickles finds this function by name, and with it this module."""
    kind = ScaledStateSpace if "scales" in names else control.StateSpace
    return kind(*matrices, dt=dt, remove_useless_states=False, **names)


def _parts(system: control.StateSpace) -> tuple[Any, tuple[Any, ...], dict[str, Any] | None]:
    names = {
        "name": system.name,
        "inputs": system.input_labels,
        "outputs": system.output_labels,
        "states": system.state_labels,
    }
    if isinstance(system, ScaledStateSpace):
        names["scales"] = system.scales
    # What boomctl adds to it.
    ours = {name: value for name, value in vars(system).items() if name.startswith("_boomctl_")}
    return _state_space, ((system.A, system.B, system.C, system.D), system.dt, names), ours or None


copyreg.pickle(control.StateSpace, _parts)
copyreg.pickle(ScaledStateSpace, _parts)
