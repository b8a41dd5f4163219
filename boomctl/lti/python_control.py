"""python-control, imported in one place so that its state-space systems can be pickled.

A ``control.StateSpace`` keeps two functions that its constructor makes (python-control 0.10.2), which pickle refuses.
Once this module is imported, and boomctl imports python-control only here, pickle and copy rebuild such a system from its
matrices, names and sampling time instead: in the whole process, for systems that boomctl did not make too.
"""

import copyreg
from typing import Any

import control


def _state_space(matrices: tuple[Any, ...], dt: float | bool | None, names: dict[str, Any]) -> control.StateSpace:
    """Return the system again; the process that unpickles finds this function by name, and with it this module."""
    return control.StateSpace(*matrices, dt=dt, remove_useless_states=False, **names)


def _parts(system: control.StateSpace) -> tuple[Any, tuple[Any, ...], dict[str, Any] | None]:
    names = {
        "name": system.name,
        "inputs": system.input_labels,
        "outputs": system.output_labels,
        "states": system.state_labels,
    }
    ours = {
        name: value for name, value in vars(system).items() if name.startswith("_boomctl_")
    }  # what boomctl adds to it
    return _state_space, ((system.A, system.B, system.C, system.D), system.dt, names), ours or None


copyreg.pickle(control.StateSpace, _parts)
