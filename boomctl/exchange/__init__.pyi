# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.exchange.controller_files import ControllerNotes, read_controller, read_controller_notes, write_controller

__all__ = [
    "ControllerNotes",
    "read_controller",
    "read_controller_notes",
    "write_controller",
]
