"""Hash of functions and values by content: code, defaults, closure, the globals that are read, bound data.

``joblib.hash`` identifies functions and classes by name.  Here those of the user are replaced by what defines them, so that
two functions with the same name have different hashes.  Those of installed packages are identified by name and version.
"""

import dis
import sys
from contextlib import suppress
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

from joblib.hashing import NumpyHasher

_LOADS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
_ATTRIBUTES = ("LOAD_ATTR", "LOAD_METHOD")
_PARTS = ("__func__", "fget", "fset", "fdel", "func")  # functions in static methods, properties and cached properties


def content_hash(what: str, value: Any) -> str:
    """Return a hash of what a value holds and does; records are hashed by their fields.

    Raises
    ------
    TypeError
        A part of it cannot be hashed; ``what`` names the value in the message.
    """
    try:
        return str(_ContentHasher("sha256").hash(value))
    except Exception as error:  # pickle raises anything
        text = " ".join(str(error).split())
        raise TypeError(
            f"`checkpoint` must be None where a part of {what} cannot be hashed ({type(error).__name__}: {text[:150]})."
            " Create that part within the function."
        ) from None


class _ContentHasher(NumpyHasher):
    """A hasher of joblib that replaces functions, classes, modules and records by their content."""

    def __init__(self, hash_name: str) -> None:
        super().__init__(hash_name)
        self._visited: dict[int, Any] = {}  # functions and classes by id, in order: for recursive definitions

    def save(self, obj: Any) -> None:
        if isinstance(obj, (FunctionType, type)):
            package = _package(obj.__module__ or "__main__")
            if package is None and id(obj) in self._visited:
                obj = ("visited", list(self._visited).index(id(obj)))
            else:
                self._visited[id(obj)] = obj
                obj = (type(obj).__name__, obj.__qualname__, package or _definition(obj))
        elif isinstance(obj, MethodType):
            obj = ("method", obj.__func__, obj.__self__)
        elif isinstance(obj, ModuleType):
            obj = _module(obj.__name__)
        elif isinstance(obj, frozenset):
            obj = ("frozenset", set(obj))  # joblib sorts sets only
        elif is_dataclass(obj):
            obj = ("record", type(obj), {each.name: getattr(obj, each.name) for each in fields(obj)})
        elif type(obj).__module__.startswith("control."):  # whose systems are numbered in their names
            obj = ("record", type(obj), {name: value for name, value in vars(obj).items() if name != "name"})
        elif "__wrapped__" in getattr(obj, "__dict__", ()):  # functools.cache
            obj = ("wrapper", type(obj), obj.__wrapped__)
        super().save(obj)


def _package(module: str) -> tuple[str, Any] | None:
    """Return an installed package and its version; None for a module of the user."""
    top = module.partition(".")[0]
    if top == "__main__":  # of a notebook or of pytest, it has the file of an installed package
        return None
    spec = sys.modules[top].__spec__ if top in sys.modules else find_spec(top)
    folders = Path(getattr(spec, "origin", None) or "").parts
    if top in ("boomctl", *sys.stdlib_module_names) or not {"site-packages", "dist-packages"}.isdisjoint(folders):
        return top, getattr(import_module(top), "__version__", None)
    return None


def _module(name: str) -> tuple[Any, ...]:
    """Return an installed module by name and version, one of the user by the content of its file."""
    package = _package(name)
    spec = None if package or name == "__main__" else find_spec(name)
    return "module", name, package, Path(spec.origin).read_bytes() if spec and spec.origin else None


def _definition(of: FunctionType | type) -> tuple[Any, ...]:
    """Return what defines a function or class: code, bound data and what it reads, or bases and members."""
    if isinstance(of, type):
        members = {}
        for name, member in vars(of).items():
            if hasattr(member, "__get__") and not isinstance(member, FunctionType):
                members[name] = [getattr(member, part, None) for part in _PARTS]
            elif isinstance(member, FunctionType) or not name.startswith(("__", "_abc_")):
                members[name] = member
        return of.__bases__, members
    codes, cells = [of.__code__], {}
    for code in codes:  # with those of the functions within
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    for name, cell in zip(of.__code__.co_freevars, of.__closure__ or (), strict=True):
        with suppress(ValueError):  # empty
            cells[name] = cell.cell_contents
    data = {name: value for name, value in vars(of).items() if name != "__wrapped__"}
    compiled = [_compiled(code) for code in codes]
    return compiled, of.__defaults__, of.__kwdefaults__, cells, _reads(codes, of.__globals__), data


def _compiled(code: CodeType) -> tuple[Any, ...]:
    constants = [each for each in code.co_consts if not isinstance(each, CodeType)]
    return code.co_code, code.co_names, constants, getattr(code, "co_exceptiontable", None)


def _reads(codes: list[CodeType], namespace: dict[str, Any]) -> dict[str, Any]:
    """Return the globals that code reads, and what it imports; of modules of the user also the attributes."""
    steps = [(step.opname, step.argval) for code in codes for step in dis.get_instructions(code)]
    found = {name: namespace[name] for how, name in steps if how in _LOADS and name in namespace}
    attributes = {name for how, name in steps if how in _ATTRIBUTES}
    for of, module in list(found.items()):
        if isinstance(module, ModuleType) and _package(module.__name__) is None:
            found |= {f"{of}.{name}": getattr(module, name) for name in attributes if hasattr(module, name)}
    return found | {f"import {name}": _module(name) for how, name in steps if how == "IMPORT_NAME" and name}
