"""Control design for flexible structures on a moving base.

Names are loaded when first used, so that ``import boomctl`` itself costs next to nothing.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "BoomParameters": "boomctl.boom",
    "spray_boom": "boomctl.boom",
    "exact_frequency_response": "boomctl.boom",
    "exact_eigenfrequencies_hz": "boomctl.boom",
    "iso_track": "boomctl.boom",
    "bump_track": "boomctl.boom",
    "Track": "boomctl.boom",
    "TractorParameters": "boomctl.boom",
    "tractor_system": "boomctl.boom",
    "PlatformMotion": "boomctl.boom",
    "platform_motion": "boomctl.boom",
    "platform_density": "boomctl.boom",
    "track_filter": "boomctl.boom",
    "sine_sweep": "boomctl.boom",
    "read_motion": "boomctl.boom",
    "write_motion": "boomctl.boom",
    "Footprint": "boomctl.boom",
    "nozzle_positions": "boomctl.boom",
    "spray_deposit": "boomctl.boom",
    "spray_by_motion": "boomctl.boom",
    "split_motion": "boomctl.boom",
    "split_symmetric": "boomctl.structure",
    "sigma": "boomctl.analysis",
    "read_measured_curve": "boomctl.analysis",
    "hinf_norm": "boomctl.analysis",
    "h2_norm": "boomctl.analysis",
    "mode_table": "boomctl.analysis",
    "margins": "boomctl.analysis",
    "feedback_loop": "boomctl.analysis",
    "closed_loop_response": "boomctl.analysis",
    "exact_loop_stability": "boomctl.analysis",
    "robust_stability": "boomctl.analysis",
    "structured_margin": "boomctl.analysis",
    "worst_case": "boomctl.analysis",
    "boom_family": "boomctl.boom",
    "yaw_family": "boomctl.boom",
    "HubBeamParameters": "boomctl.rotating_beam",
    "hub_beam": "boomctl.rotating_beam",
    "spin_up": "boomctl.rotating_beam",
    "sine_torque": "boomctl.rotating_beam",
    "hub_profile": "boomctl.rotating_beam",
    "torque": "boomctl.rotating_beam",
    "hold": "boomctl.rotating_beam",
    "free": "boomctl.rotating_beam",
    "reduce": "boomctl.reduction",
    "lqr": "boomctl.synthesis",
    "kalman": "boomctl.synthesis",
    "lqg": "boomctl.synthesis",
    "loop_transfer_recovery": "boomctl.synthesis",
    "h2": "boomctl.synthesis",
    "discretize": "boomctl.synthesis",
    "SynthesisError": "boomctl.synthesis",
    "join_symmetric": "boomctl.synthesis",
    "split_controller": "boomctl.synthesis",
    "in_units": "boomctl.synthesis",
    "from_units": "boomctl.synthesis",
    "h_infinity": "boomctl.synthesis",
    "generalized_plant": "boomctl.synthesis",
    "mixed_sensitivity": "boomctl.synthesis",
    "close_loop": "boomctl.synthesis",
    "reduce_controller": "boomctl.synthesis",
    "select_channels": "boomctl.synthesis",
    "low_pass": "boomctl.synthesis",
    "high_pass": "boomctl.synthesis",
    "band_pass": "boomctl.synthesis",
    "shelf": "boomctl.synthesis",
    "simulate_loop": "boomctl.simulation",
    "CoulombFriction": "boomctl.simulation",
    "forced_response": "boomctl.simulation",
    "describing_function": "boomctl.simulation",
    "swept_sine": "boomctl.simulation",
    "sine_sigma": "boomctl.simulation",
    "optimal_slew": "boomctl.slew",
    "SlewError": "boomctl.slew",
    "SlewResult": "boomctl.slew",
}

__all__ = [*_HOME, "__version__"]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'boomctl' has no attribute {name!r}; it offers {', '.join(sorted(_HOME))}")


def __dir__() -> list[str]:
    return sorted(__all__)
