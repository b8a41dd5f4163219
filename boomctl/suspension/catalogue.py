"""Where the designs are found: by name beside the package, or in a file of the user's own."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from boomctl.checks import known
from boomctl.suspension.design import SuspensionDesign

__all__ = ["design_names", "load_design"]

_MARK = "def design("


def design_names() -> tuple[str, ...]:
    """Return the names of the suspension designs that come with boomctl."""
    return tuple(sorted(path.stem for path in _folder().glob("*.py") if _MARK in path.read_text(encoding="utf-8")))


def load_design(name: str) -> SuspensionDesign:
    """Return the design of a name, or of a Python file whose ``design()`` returns a :class:`SuspensionDesign`.

    Raises
    ------
    ValueError
        No such design; the file has no ``design()``.
    TypeError
        ``design()`` returns something else.
    """
    path = Path(name)
    if path.suffix == ".py":
        if not path.is_file():
            raise ValueError(f"design {name!r}: there is no such file")
    else:
        path = _folder() / f"{known('design', name, design_names())}.py"
    make = getattr(_loaded(path), "design", None)
    if not callable(make):
        raise ValueError(f"design {name!r}: expected a file with a function design()")
    found = make()
    if not isinstance(found, SuspensionDesign):
        raise TypeError(f"design {name!r}: design() returned {type(found).__name__}, expected SuspensionDesign")
    return found


def _folder() -> Path:
    """Return the folder of the designs: within an installed package, or beside the package in a source tree."""
    package = Path(__file__).parent.parent
    installed = package / "designs"
    return installed if installed.is_dir() else package.parent / "designs"


def _loaded(path: Path) -> ModuleType:
    label = f"_boomctl_design_{path.stem}"
    spec = importlib.util.spec_from_file_location(label, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"design {str(path)!r}: cannot be read as Python")
    module = importlib.util.module_from_spec(spec)
    # dataclasses look their module up while they are made
    sys.modules[label] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[label]
    return module
