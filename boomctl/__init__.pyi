# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.analysis.box.robustness import robust_stability
from boomctl.analysis.box.worst_case import worst_case
from boomctl.analysis.h2 import h2_norm
from boomctl.analysis.looking.bode import bode
from boomctl.analysis.looking.comparison import compare
from boomctl.analysis.looking.nyquist import nyquist
from boomctl.analysis.looking.pole_zero import pzmap
from boomctl.analysis.looking.transients import impulse, step
from boomctl.analysis.loops import feedback_loop
from boomctl.analysis.margins import margins
from boomctl.analysis.measured import read_measured_curve
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.modes import mode_table
from boomctl.analysis.prove import prove
from boomctl.analysis.sigma import compare_sigma, sigma
from boomctl.analysis.state_outputs import with_states
from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.families import boom_family
from boomctl.boom.motion import platform_motion, read_motion, sine_sweep
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.spray import nozzle_positions, spray_by_motion, spray_deposit
from boomctl.boom.tracks import iso_track
from boomctl.exchange.controller_files import read_controller, write_controller
from boomctl.identification.fit import fit
from boomctl.identification.identify import identify
from boomctl.identification.response import estimate_response
from boomctl.lti.controllers.scheduled import schedule
from boomctl.progress import Progress, listening
from boomctl.reduction.reduce import reduce
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import free, hold, hub_profile, sine_torque, spin_up, torque
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.sensors import BeamSensor
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.simulation.forced_response import forced_response
from boomctl.simulation.loop import simulate_loop
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.result import SlewError
from boomctl.structure.model import split_symmetric
from boomctl.studies.sweeps.sweep import sweep
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.discretise import discretize
from boomctl.synthesis.hinf.h_infinity import h_infinity
from boomctl.synthesis.lq.h2 import h2
from boomctl.synthesis.lq.kalman import kalman
from boomctl.synthesis.lq.lqg import lqg
from boomctl.synthesis.lq.lqr import lqr
from boomctl.synthesis.plants.generalized import generalized_plant, mixed_sensitivity
from boomctl.synthesis.plants.partition import close_loop
from boomctl.synthesis.plants.symmetry import join_symmetric
from boomctl.synthesis.plants.units import from_units, in_units
from boomctl.synthesis.plants.weights import low_pass, shelf
from boomctl.synthesis.reduce_controller import reduce_controller
from boomctl.tuning.tune import tune

from . import analysis as analysis
from . import boom as boom
from . import exchange as exchange
from . import identification as identification
from . import plotting as plotting
from . import reduction as reduction
from . import rotating_beam as rotating_beam
from . import simulation as simulation
from . import slew as slew
from . import structure as structure
from . import studies as studies
from . import synthesis as synthesis
from . import tunable as tunable
from . import tuning as tuning

__version__: str

__all__ = [
    "BeamSensor",
    "BoomParameters",
    "CoulombFriction",
    "HubBeamParameters",
    "Progress",
    "SlewError",
    "SynthesisError",
    "__version__",
    "bode",
    "boom_family",
    "close_loop",
    "compare",
    "compare_sigma",
    "discretize",
    "estimate_response",
    "exact_eigenfrequencies_hz",
    "exact_frequency_response",
    "feedback_loop",
    "fit",
    "forced_response",
    "free",
    "from_units",
    "generalized_plant",
    "h2",
    "h2_norm",
    "h_infinity",
    "hinf_norm",
    "hold",
    "hub_beam",
    "hub_profile",
    "identify",
    "impulse",
    "in_units",
    "iso_track",
    "join_symmetric",
    "kalman",
    "listening",
    "low_pass",
    "lqg",
    "lqr",
    "margins",
    "mixed_sensitivity",
    "mode_table",
    "nozzle_positions",
    "nyquist",
    "optimal_slew",
    "platform_motion",
    "prove",
    "pzmap",
    "read_controller",
    "read_measured_curve",
    "read_motion",
    "reduce",
    "reduce_controller",
    "robust_stability",
    "schedule",
    "shelf",
    "sigma",
    "simulate_loop",
    "sine_sweep",
    "sine_torque",
    "spin_up",
    "split_symmetric",
    "spray_boom",
    "spray_by_motion",
    "spray_deposit",
    "step",
    "sweep",
    "torque",
    "tune",
    "with_states",
    "worst_case",
    "write_controller",
]
