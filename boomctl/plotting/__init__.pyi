# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.plotting.canvas import figure_bytes as figure_bytes
from boomctl.plotting.canvas import figure_of as figure_of
from boomctl.plotting.canvas import new_figure as new_figure
from boomctl.plotting.canvas import picture as picture
from boomctl.plotting.canvas import style as style
from boomctl.plotting.slew import animate_slew as animate_slew
