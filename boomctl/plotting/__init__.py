"""Drawing: the only part that knows matplotlib.  It draws results; it computes nothing."""

from boomctl.plotting.canvas import figure_bytes, new_figure, style
from boomctl.plotting.sigma import plot_measured, plot_sigma

__all__ = ["figure_bytes", "new_figure", "plot_measured", "plot_sigma", "style"]
