"""Catalogue of designs, by name or from a file."""

import re
import runpy
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from boomctl.studies.machine import MachineDesign
    from boomctl.studies.slew import SlewDesign
    from boomctl.studies.suspension.design import SuspensionDesign

_DESIGN = "design"  # the function of a design's file
_RETURNS = re.compile(rf"^def {_DESIGN}\(.*\) -> (\w+\.)*\w+Design:", re.MULTILINE)
_REPORTED = (OSError, ImportError, ArithmeticError, RuntimeError, TypeError, ValueError)  # with a message for users


def design_names() -> tuple[str, ...]:
    """Return the names of the designs that come with boomctl.

    Returns
    -------
    tuple of str
        Names that :func:`load_design` takes.

    Examples
    --------
    >>> import boomctl as bc
    >>> "min_time_slew" in bc.studies.design_names()
    True
    """
    paths = shipped("designs").glob("*.py")
    return tuple(sorted(path.stem for path in paths if _RETURNS.search(path.read_text(encoding="utf-8"))))


def design_path(name: str) -> Path:
    """Return the file of a design, by name or by its path, which ends in ``.py``.

    Raises
    ------
    ValueError
        There is no such design or file.
    """
    path = Path(name)
    if path.suffix != ".py":
        from boomctl.checks import known  # it imports numpy, which a list of names does not need

        return shipped("designs") / f"{known('design', name, design_names())}.py"
    if not path.is_file():
        raise ValueError(
            f"design {name!r}: {'expected a file, got a folder' if path.is_dir() else 'there is no such file'}"
        )
    return path


def load_design(name: "str | Path") -> "SuspensionDesign | MachineDesign | SlewDesign":
    """Create a design that comes with boomctl, or one of your own, by its function ``design()``, with all synthesis.

    Parameters
    ----------
    name : str or Path
        One of `design_names`, or a Python file with a function ``design()`` that returns a `SuspensionDesign`, a
        `MachineDesign` or a `SlewDesign`.

    Returns
    -------
    SuspensionDesign, MachineDesign or SlewDesign
        ``.evaluate()`` evaluates it; a suspension in a `FieldScenario`.

    Raises
    ------
    TypeError, ValueError
        There is no such design or file, or its function returns something else; an error in the file is named with file and
        line.

    Examples
    --------
    >>> import boomctl as bc
    >>> design = bc.studies.load_design("lqr_suspension")
    >>> design.controller.output_labels
    ['suspension_left', 'suspension_right']
    >>> design.synthesis_info["slowest pole"]
    '-0.685 rad/s'
    """
    if not isinstance(name, (str, Path)):
        raise TypeError(f"name: expected the name of a design or a file, got {type(name).__name__}")
    path = design_path(str(name))
    sys.path.insert(0, str(path.resolve().parent))  # A script can import modules from its folder.
    try:
        function = runpy.run_path(str(path), run_name=path.stem).get(_DESIGN)
        if not callable(function):
            raise ValueError(f"design {str(name)!r}: expected a file with a function {_DESIGN}()")
        result: Any = function()
    except (Exception, SystemExit) as error:
        if isinstance(error, _REPORTED) and not isinstance(error, NotImplementedError | RecursionError):
            raise
        raise ValueError(_located(path, error)) from error
    finally:
        sys.path.remove(str(path.resolve().parent))
    if not hasattr(result, "evaluate"):
        expected = "a SuspensionDesign, a MachineDesign or a SlewDesign"
        raise TypeError(f"design {str(name)!r}: {_DESIGN}() returned {type(result).__name__}, expected {expected}")
    return result


def shipped(name: str) -> Path:
    """Return a folder that is distributed with boomctl: in the installed package, or in the source tree."""
    package = Path(__file__).parents[1]
    installed = package / name
    return installed if installed.is_dir() else package.parent / name


def _located(path: Path, error: BaseException) -> str:
    """Return an error of Python in a file in one line, with the last line of the file that led to it."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}: SyntaxError: {error.msg}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    return f"{path}, line {lines[-1] if lines else 1}: {type(error).__name__}: {error}".rstrip(": ")
