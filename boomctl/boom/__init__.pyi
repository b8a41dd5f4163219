# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.boom.exact import exact_eigenfrequencies_hz as exact_eigenfrequencies_hz
from boomctl.boom.exact import exact_frequency_response as exact_frequency_response
from boomctl.boom.factory import spray_boom as spray_boom
from boomctl.boom.families import boom_family as boom_family
from boomctl.boom.families import yaw_family as yaw_family
from boomctl.boom.motion import PlatformMotion as PlatformMotion
from boomctl.boom.motion import platform_motion as platform_motion
from boomctl.boom.motion import read_motion as read_motion
from boomctl.boom.motion import sine_sweep as sine_sweep
from boomctl.boom.motion import write_motion as write_motion
from boomctl.boom.parameters import BoomParameters as BoomParameters
from boomctl.boom.spray import Footprint as Footprint
from boomctl.boom.spray import SprayResult as SprayResult
from boomctl.boom.spray import nozzle_positions as nozzle_positions
from boomctl.boom.spray import split_jolt_yaw as split_jolt_yaw
from boomctl.boom.spray import spray_deposit as spray_deposit
from boomctl.boom.spray import spray_deposit_components as spray_deposit_components
from boomctl.boom.tracks import Track as Track
from boomctl.boom.tracks import bump_track as bump_track
from boomctl.boom.tracks import iso_track as iso_track
from boomctl.boom.tracks import road_psd as road_psd
from boomctl.boom.tracks import track_coherence as track_coherence
from boomctl.boom.tractor import TractorParameters as TractorParameters
from boomctl.boom.tractor import tractor_system as tractor_system

from . import published as published
