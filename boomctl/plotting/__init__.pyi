# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.plotting.canvas import figure_bytes, figure_of, new_figure, picture, style
from boomctl.plotting.design import plot_recovery, plot_reduction, plot_sines
from boomctl.plotting.loop import plot_forced_response, plot_loop
from boomctl.plotting.margins import plot_loop_margin, plot_margins
from boomctl.plotting.rotating_beam import plot_simulation
from boomctl.plotting.sigma import plot_measured, plot_sigma, plot_sigma_comparison
from boomctl.plotting.slew import (
    plot_mesh_study,
    plot_payloads,
    plot_slew,
    plot_slew_comparison,
    plot_spin_ups,
    plot_switching,
    plot_torque,
    plot_tracking,
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

__all__ = [
    "draw_deposit",
    "draw_motion",
    "draw_track_density",
    "figure_bytes",
    "figure_of",
    "new_figure",
    "picture",
    "plot_density",
    "plot_deposit",
    "plot_forced_response",
    "plot_loop",
    "plot_loop_margin",
    "plot_margins",
    "plot_measured",
    "plot_mesh_study",
    "plot_motion",
    "plot_payloads",
    "plot_recovery",
    "plot_reduction",
    "plot_sigma",
    "plot_sigma_comparison",
    "plot_simulation",
    "plot_sines",
    "plot_slew",
    "plot_slew_comparison",
    "plot_spin_ups",
    "plot_switching",
    "plot_torque",
    "plot_track",
    "plot_tracking",
    "slew_film",
    "style",
]
