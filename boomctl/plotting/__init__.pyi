# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.plotting.canvas import figure_bytes, new_figure, picture, style
from boomctl.plotting.sigma import plot_measured, plot_sigma
from boomctl.plotting.slew import (
    plot_mesh_study,
    plot_payloads,
    plot_slew,
    plot_slew_comparison,
    plot_spin_ups,
    plot_switching,
    plot_tracking,
    slew_film,
)
from boomctl.plotting.spray import draw_deposit, draw_motion, draw_track_density

__all__ = [
    "draw_deposit",
    "draw_motion",
    "draw_track_density",
    "figure_bytes",
    "new_figure",
    "picture",
    "plot_measured",
    "plot_mesh_study",
    "plot_payloads",
    "plot_sigma",
    "plot_slew",
    "plot_slew_comparison",
    "plot_spin_ups",
    "plot_switching",
    "plot_tracking",
    "slew_film",
    "style",
]
