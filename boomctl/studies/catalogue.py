"""What every kind of design offers, and where designs are found: by name beside the package, or in a user's own file."""

import importlib.util
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from boomctl.studies.machine import MachineDesign
    from boomctl.studies.slew.design import SlewDesign
    from boomctl.studies.spin_up import SpinUpDesign
    from boomctl.studies.suspension.design import SuspensionDesign


@dataclass(frozen=True)
class Kind:
    """A kind of design.

    Attributes
    ----------
    name : str
    function : str
        The function of a design's file that makes one.
    module, returns : str
        The class of which it returns an instance; it is imported when a design is run, not to list names.
    steps : int
        What making, judging and reporting one tell of.
    options : tuple of str
        What can be chosen of the scene.
    """

    name: str
    function: str
    module: str
    returns: str
    steps: int = 3
    options: tuple[str, ...] = ()

    @property
    def design_class(self) -> Any:
        """The class of the designs: its ``scene(**options)`` is what ``evaluate(scene)`` judges one in."""
        return getattr(import_module(f"boomctl.studies.{self.module}"), self.returns)


_TOLD = (OSError, ImportError, ArithmeticError, RuntimeError, TypeError, ValueError)  # kinds the command line tells
_FIELD = ("road_class", "speed", "seed")  # options of the suspensions' scene
_KINDS = (
    Kind("suspension", "design", "suspension.design", "SuspensionDesign", options=_FIELD),
    Kind("machine", "design", "machine", "MachineDesign"),
    Kind("slew", "slew", "slew.design", "SlewDesign", steps=6),
    Kind("spin-up", "drive", "spin_up", "SpinUpDesign"),
)
KINDS = {kind.name: kind for kind in _KINDS}


@dataclass(frozen=True)
class DesignFile:
    """A design before it is made.

    Attributes
    ----------
    name : str
        As it was asked for.
    path : Path
    kind : Kind
    function : callable
        Returns the design; this is where the work is done.
    """

    name: str
    path: Path
    kind: Kind
    function: Callable[[], object]

    def made(self) -> Any:
        """Make the design.

        Raises
        ------
        TypeError
            The function returns something else.
        ValueError
            The file fails by an error of Python; the message names file and line.
        """
        kind = self.kind
        with _own_code(self.path, refusals=True):
            found = self.function()
        alike = [other for other in KINDS.values() if other.function == kind.function]
        if not any(isinstance(found, other.design_class) for other in alike):
            expected = " or ".join(other.returns for other in alike)
            raise TypeError(
                f"design {self.name!r}: {kind.function}() returned {type(found).__name__}, expected {expected}"
            )
        return found


def design_names(*kinds: str) -> tuple[str, ...]:
    """Return the names of the designs that come with boomctl.

    Parameters
    ----------
    kinds : "suspension", "machine", "slew" or "spin-up"
        Kinds of designs; all unless given.

    Returns
    -------
    tuple of str
        Names that :func:`load_design` takes.

    Raises
    ------
    ValueError
        Another word.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.studies.design_names("slew")
    ('min_time_slew', 'robust_payload_slew', 'spin_up_slew', 'tracked_slew')
    """
    for kind in kinds:
        if not (isinstance(kind, str) and kind in KINDS):
            raise ValueError(f"kind = {kind!r}: expected one of {', '.join(KINDS)}")
    wanted = [KINDS[kind] for kind in kinds or KINDS]
    # suspensions and machines are made by functions of one name: what they return tells them apart
    marks = [re.compile(rf"^def {kind.function}\(.*\) -> (\w+\.)*{kind.returns}:", re.MULTILINE) for kind in wanted]
    texts = {path.stem: path.read_text(encoding="utf-8") for path in shipped("designs").glob("*.py")}
    return tuple(sorted(name for name, text in texts.items() if any(mark.search(text) for mark in marks)))


def design_file(name: str) -> DesignFile:
    """Return the design of a name, or of a Python file with a function ``design()``, ``slew()`` or ``drive()``.

    Parameters
    ----------
    name : str
        Of a design of boomctl, or of a file that ends in ``.py``.

    Raises
    ------
    ValueError
        No such design or file; the file has no such function, or fails; the message names file and line.
    """
    path = Path(name)
    if path.suffix == ".py":
        if not path.is_file():
            what = "expected a file, got a folder" if path.is_dir() else "there is no such file"
            raise ValueError(f"design {name!r}: {what}")
    else:
        from boomctl.checks import known  # it imports numpy, which listing the names of designs does not wait for

        path = shipped("designs") / f"{known('design', name, design_names())}.py"
    module = _loaded(path)
    for kind in KINDS.values():
        function = getattr(module, kind.function, None)
        if callable(function):
            return DesignFile(name, path, kind, function)
    wanted = " or ".join(dict.fromkeys(f"{kind.function}()" for kind in KINDS.values()))
    raise ValueError(f"design {name!r}: expected a file with a function {wanted}")


def load_design(name: str) -> "SuspensionDesign | MachineDesign | SlewDesign | SpinUpDesign":
    """Make a design that comes with boomctl, or one of your own.

    Parameters
    ----------
    name : str
        One of `design_names`, or a Python file with a function ``design()`` that returns a `SuspensionDesign` or a
        `MachineDesign`, ``slew()`` that returns a `SlewDesign`, or ``drive()`` that returns a `SpinUpDesign`.

    Returns
    -------
    SuspensionDesign, MachineDesign, SlewDesign or SpinUpDesign
        ``.evaluate()`` judges it; a suspension in a `FieldScene`.

    Raises
    ------
    TypeError, ValueError
        No such design or file, or one that makes something else; what fails in a file is named with file and line.

    Examples
    --------
    >>> import boomctl as bc
    >>> design = bc.studies.load_design("lqr_suspension")
    >>> design.controller.output_labels
    ['suspension_left', 'suspension_right']
    >>> design.facts["slowest pole"]
    '-0.685 rad/s'
    """
    if not isinstance(name, (str, Path)):
        raise TypeError(f"name: expected the name of a design or a file, got {type(name).__name__}")
    return design_file(str(name)).made()


def shipped(name: str) -> Path:
    """Return a folder that comes with boomctl: within an installed package, or beside the package in a source tree."""
    package = Path(__file__).parents[1]
    installed = package / name
    return installed if installed.is_dir() else package.parent / name


def _loaded(path: Path) -> ModuleType:
    label = f"_boomctl_design_{path.stem}"
    spec = importlib.util.spec_from_file_location(label, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"design {str(path)!r}: cannot be read as Python")
    module = importlib.util.module_from_spec(spec)
    # dataclasses look their module up while they are made
    sys.modules[label] = module
    try:
        with _own_code(path):
            spec.loader.exec_module(module)
    finally:
        del sys.modules[label]
    return module


@contextmanager
def _own_code(path: Path, refusals: bool = False) -> Iterator[None]:
    """Run the code of a file: it finds its neighbours as a script does, and its errors name file and line.

    With ``refusals`` what boomctl itself refuses, or cannot do, is left as it is.
    """
    folder, before = path.resolve().parent, set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # of any kind that a file may make of its own
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if Path(frame.filename).resolve().parent == folder]
        kind = next((kind for kind in _TOLD if isinstance(error, kind)), None)
        if isinstance(error, NotImplementedError | RecursionError):
            kind = None
        if refusals and kind is not None and frames[-1] not in own:
            raise
        where, line = (own[-1].filename, own[-1].lineno) if own else (path, None)
        try:
            said = str(error)
        except Exception:  # words of their own that fail
            said = ""
        if isinstance(error, SyntaxError):
            where, line, said = error.filename or where, error.lineno, error.msg
        place = f"{where}, line {line}" if line else str(where)
        raise (kind or ValueError)(f"{place}: {type(error).__name__}: {said}".rstrip(": ")) from error
    finally:
        sys.path.remove(str(folder))
        # another file may have neighbours of the same names
        for name in set(sys.modules) - before:
            if (folder / f"{name}.py").is_file() or (folder / name.split(".")[0] / "__init__.py").is_file():
                del sys.modules[name]
