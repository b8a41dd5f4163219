# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.families import boom_family, yaw_family
from boomctl.boom.motion import PlatformMotion, platform_motion, read_motion, sine_sweep, write_motion
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.spray import Footprint, SprayResult, nozzle_positions, split_motion, spray_by_motion, spray_deposit
from boomctl.boom.track_filter import PlatformDensity, platform_density, track_filter
from boomctl.boom.tracks import Track, bump_track, iso_track, road_density, track_coherence
from boomctl.boom.tractor import TractorParameters, tractor_system

__all__ = [
    "BoomParameters",
    "Footprint",
    "PlatformDensity",
    "PlatformMotion",
    "SprayResult",
    "Track",
    "TractorParameters",
    "boom_family",
    "bump_track",
    "exact_eigenfrequencies_hz",
    "exact_frequency_response",
    "iso_track",
    "nozzle_positions",
    "platform_density",
    "platform_motion",
    "read_motion",
    "road_density",
    "sine_sweep",
    "split_motion",
    "spray_boom",
    "spray_by_motion",
    "spray_deposit",
    "track_coherence",
    "track_filter",
    "tractor_system",
    "write_motion",
    "yaw_family",
]
