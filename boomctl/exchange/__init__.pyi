# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.exchange.controller_files import ControllerMetadata as ControllerMetadata
from boomctl.exchange.controller_files import read_controller as read_controller
from boomctl.exchange.controller_files import read_controller_metadata as read_controller_metadata
from boomctl.exchange.controller_files import write_controller as write_controller
