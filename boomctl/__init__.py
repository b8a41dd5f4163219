"""Control design for flexible structures on a moving base.

Functions by task; the packages contain more (``boomctl.boom.write_motion``).

A spray boom
    spray_boom, BoomParameters, split_symmetric, exact_frequency_response, exact_eigenfrequencies_hz; its field:
    iso_track, bump_track, platform_motion, sine_sweep, read_motion, nozzle_positions, spray_deposit,
    spray_deposit_components.
A rotating hub-beam
    hub_beam, HubBeamParameters; motion of its hub: spin_up, sine_torque; more in the package ``maneuvers``.
Any machine
    the package ``structure``; fit finds its parameters from a measured curve: read_frequency_response; or from a record:
    estimate_frequency_response, identify.
Analyze a system
    sigma, compare_sigma, bode, nyquist, pzmap, step, impulse, mode_table, compare.
Check norms and stability
    hinf_norm, h2_norm, margins, prove.
Reduce it
    reduce, reduce_controller, scale_signals, unscale_controller, ScaledStateSpace.
Design a controller
    lqr, kalman, lqg, h2, h_infinity, discretize, gain_schedule; its plant: with_state_outputs,
    generalized_plant, mixed_sensitivity, low_pass, shelf.
Tune a fixed structure
    tune, and the package ``tunable``.
Close the loop
    feedback_loop, lft, join_symmetric, simulate_loop, forced_response, BeamSensor, CoulombFriction.
Analyze robustness
    boom_family, robust_stability, worst_case.
Plan a slew
    optimal_slew.
Run sweeps, read and write
    sweep, progress_callback, Progress, read_controller, write_controller.
Handle errors and warnings
    the module ``exceptions``.

Names are loaded when first used, so that ``import boomctl`` is quick.
"""

from boomctl.lazy import loader

__version__ = "0.1.0"

__all__, __getattr__, __dir__ = loader(__name__)
__all__.append("__version__")
