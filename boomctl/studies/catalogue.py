"""Where the designs are found: by name beside the package, or in a file of the user's own."""

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from boomctl.checks import known

FUNCTIONS = {"suspension": "design", "slew": "slew"}
"""Kinds of designs, and the function of a design's file that returns one."""

T = TypeVar("T")


@dataclass(frozen=True)
class DesignFile:
    """A design before it is run.

    Attributes
    ----------
    name : str
        As it was asked for.
    kind : str
        "suspension" or "slew".
    function : callable
        Returns the design; this is where the work is done.
    """

    name: str
    kind: str
    function: Callable[[], object]

    def made(self, expected: type[T]) -> T:
        """Run the design.

        Raises
        ------
        TypeError
            It returns something else than what is expected.
        """
        found = self.function()
        if not isinstance(found, expected):
            raise TypeError(
                f"design {self.name!r}: {FUNCTIONS[self.kind]}() returned {type(found).__name__}, "
                f"expected {expected.__name__}"
            )
        return found


def design_names(*kinds: str) -> tuple[str, ...]:
    """Return the names of the designs that come with boomctl, of all kinds unless some are given."""
    marks = [f"\ndef {FUNCTIONS[kind]}(" for kind in kinds or FUNCTIONS]
    texts = {path.stem: path.read_text(encoding="utf-8") for path in _folder().glob("*.py")}
    return tuple(sorted(name for name, text in texts.items() if any(mark in text for mark in marks)))


def design_file(name: str, *kinds: str) -> DesignFile:
    """Return the design of a name, or of a Python file with a function ``design()`` or ``slew()``.

    Parameters
    ----------
    name : str
        Of a design of boomctl, or of a file that ends in ``.py``.
    kinds : str
        "suspension", "slew"; either one unless given.

    Raises
    ------
    ValueError
        No such design or file; the file has no such function.
    """
    path = Path(name)
    if path.suffix == ".py":
        if not path.is_file():
            raise ValueError(f"design {name!r}: there is no such file")
    else:
        path = _folder() / f"{known('design', name, design_names(*kinds))}.py"
    module = _loaded(path)
    for kind in kinds or FUNCTIONS:
        function = getattr(module, FUNCTIONS[kind], None)
        if callable(function):
            return DesignFile(name, kind, function)
    wanted = " or ".join(f"{FUNCTIONS[kind]}()" for kind in kinds or FUNCTIONS)
    raise ValueError(f"design {name!r}: expected a file with a function {wanted}")


def _folder() -> Path:
    """Return the folder of the designs: within an installed package, or beside the package in a source tree."""
    package = Path(__file__).parents[1]
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
