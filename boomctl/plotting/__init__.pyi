# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.plotting.canvas import figure_bytes, figure_of, new_figure, picture, style
from boomctl.plotting.design import plot_h_infinity, plot_recovery, plot_reduction, plot_sines, plot_tune
from boomctl.plotting.looking import (
    plot_bode,
    plot_comparison,
    plot_exact_loop,
    plot_mode_table,
    plot_nyquist,
    plot_pole_zero,
    plot_transient,
)
from boomctl.plotting.loop import plot_forced_response, plot_loop
from boomctl.plotting.margins import plot_loop_margin, plot_margins
from boomctl.plotting.mode_shapes import plot_mode_shapes
from boomctl.plotting.rotating_beam import plot_campbell, plot_simulation
from boomctl.plotting.sigma import plot_measured, plot_sigma, plot_sigma_comparison
from boomctl.plotting.slew import (
    plot_mesh_study,
    plot_payloads,
    plot_shaper,
    plot_slew,
    plot_slew_comparison,
    plot_spin_ups,
    plot_switching,
    plot_torque,
    plot_tracking,
    plot_tracking_study,
    slew_film,
)
from boomctl.plotting.spray import (
    draw_deposit,
    draw_motion,
    draw_track_density,
    plot_density,
    plot_deposit,
    plot_motion,
    plot_track,
)
from boomctl.plotting.studies.spin_up import plot_decay, plot_spin_up_runs

__all__ = [
    "draw_deposit",
    "draw_motion",
    "draw_track_density",
    "figure_bytes",
    "figure_of",
    "new_figure",
    "picture",
    "plot_bode",
    "plot_campbell",
    "plot_comparison",
    "plot_decay",
    "plot_density",
    "plot_deposit",
    "plot_exact_loop",
    "plot_forced_response",
    "plot_h_infinity",
    "plot_loop",
    "plot_loop_margin",
    "plot_margins",
    "plot_measured",
    "plot_mesh_study",
    "plot_mode_shapes",
    "plot_mode_table",
    "plot_motion",
    "plot_nyquist",
    "plot_payloads",
    "plot_pole_zero",
    "plot_recovery",
    "plot_reduction",
    "plot_shaper",
    "plot_sigma",
    "plot_sigma_comparison",
    "plot_simulation",
    "plot_sines",
    "plot_slew",
    "plot_slew_comparison",
    "plot_spin_up_runs",
    "plot_spin_ups",
    "plot_switching",
    "plot_torque",
    "plot_track",
    "plot_tracking",
    "plot_tracking_study",
    "plot_transient",
    "plot_tune",
    "slew_film",
    "style",
]
