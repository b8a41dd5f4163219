"""Control design for flexible structures on a moving base.

Names are loaded when first used, so that ``import boomctl`` itself costs next to nothing.
"""

from importlib import import_module

__version__ = "0.1.0"

_HOME = {
    "BoomParameters": "boomctl.boom",
    "spray_boom": "boomctl.boom",
    "exact_frequency_response": "boomctl.boom",
    "exact_eigenfrequencies_hz": "boomctl.boom",
    "split_symmetric": "boomctl.structure",
    "sigma": "boomctl.analysis",
    "read_measured_curve": "boomctl.analysis",
    "HubBeamParameters": "boomctl.hub_beam",
    "hub_beam": "boomctl.hub_beam",
    "spin_up": "boomctl.hub_beam",
    "sine_torque": "boomctl.hub_beam",
    "hub_profile": "boomctl.hub_beam",
    "torque": "boomctl.hub_beam",
    "hold": "boomctl.hub_beam",
    "free": "boomctl.hub_beam",
    "reduce": "boomctl.reduction",
    "optimal_slew": "boomctl.slew",
    "SlewError": "boomctl.slew",
    "SlewResult": "boomctl.slew",
}

__all__ = [*_HOME, "__version__"]


def __getattr__(name: str) -> object:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'boomctl' has no attribute {name!r}; it offers {', '.join(sorted(_HOME))}")


def __dir__() -> list[str]:
    return sorted(__all__)
