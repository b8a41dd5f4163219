"""Hash of functions and values by content: source, bytecode, closure, the globals that are read, bound data.

``joblib.hash`` identifies functions and classes by name.  Here those of the user are replaced by what defines them, so that
two functions with the same name have different hashes.  Those of installed packages are identified by name and version.
"""

import dis
import inspect
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

from joblib.hashing import NumpyHasher

_INSTALLED = ("site-packages", "dist-packages")
_CONTAINERS = (
    "builtins",
    "numpy",
    NumpyHasher.__module__,
)  # modules of types that hold data, whose versions do not matter
_LOADS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
_ATTRIBUTES = ("LOAD_ATTR", "LOAD_METHOD")


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
        self._visited: dict[int, tuple[int, Any]] = {}  # functions and classes by id, for recursive definitions

    def save(self, obj: Any) -> None:
        if isinstance(obj, (FunctionType, type)):
            if obj.__module__ in _CONTAINERS:
                obj = (obj.__module__, obj.__qualname__)
            elif _is_installed(obj.__module__):
                obj = ("installed", obj.__qualname__, _module(obj.__module__))
            elif id(obj) in self._visited:
                obj = ("visited", self._visited[id(obj)][0])
            else:
                self._visited[id(obj)] = len(self._visited), obj
                obj = _function(obj) if isinstance(obj, FunctionType) else _class(obj)
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


def _is_installed(module: str | None) -> bool:
    top = (module or "__main__").partition(".")[0]
    if top == "__main__":  # of a notebook or of pytest, it has the file of an installed package
        return False
    if top in ("boomctl", *sys.stdlib_module_names):
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is not None and any(folder in _INSTALLED for folder in Path(file).parts)


def _module(name: str) -> tuple[Any, ...]:
    """Return an installed module by name and version, one of the user by the content of its file."""
    if _is_installed(name):
        return "module", name, getattr(sys.modules.get(name.partition(".")[0]), "__version__", None)
    spec = None if name == "__main__" else find_spec(name)
    return "module", name, Path(spec.origin).read_bytes() if spec and spec.origin else None


def _source(of: Any) -> str | None:
    try:
        return inspect.getsource(of)
    except (OSError, TypeError):  # typed at a prompt, or made by exec
        return None


def _function(function: FunctionType) -> tuple[Any, ...]:
    """Return what defines a function."""
    codes, reads, cells = list(_codes(function.__code__)), {}, {}
    for code in codes:
        reads |= _reads(code, function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        with suppress(ValueError):  # empty
            cells[name] = cell.cell_contents
    instructions = [
        (c.co_code, c.co_names, c.co_varnames, c.co_flags, [x for x in c.co_consts if not isinstance(x, CodeType)])
        for c in codes
    ]
    attributes = {name: value for name, value in vars(function).items() if name != "__wrapped__"}
    defaults = function.__defaults__, function.__kwdefaults__
    return "function", function.__qualname__, _source(function), instructions, defaults, cells, reads, attributes


def _class(kind: type) -> tuple[Any, ...]:
    """Return what defines a class: its source, bases, functions and data."""
    functions, data = {}, {}
    for name, member in vars(kind).items():
        if isinstance(member, (staticmethod, classmethod)):
            functions[name] = member.__func__
        elif isinstance(member, property):
            functions[name] = (member.fget, member.fset, member.fdel)
        elif isinstance(member, cached_property):
            functions[name] = member.func
        elif isinstance(member, FunctionType):
            functions[name] = member
        elif not (name.startswith(("__", "_abc_")) or hasattr(member, "__get__")):
            data[name] = member
    return "class", kind.__qualname__, _source(kind), kind.__bases__, functions, data


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and those of the functions within."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _reads(code: CodeType, namespace: dict[str, Any]) -> dict[str, Any]:
    """Return the globals that a code object reads, and what it imports; attributes of modules by their dotted names."""
    found: dict[str, Any] = {}
    name, value = "", None
    for step in dis.get_instructions(code):
        if step.opname in _LOADS and step.argval in namespace:
            name, value = step.argval, namespace[step.argval]
        elif step.opname in _ATTRIBUTES and isinstance(value, ModuleType):
            found.pop(name)
            name, value = f"{name}.{step.argval}", getattr(value, step.argval, None)
        elif step.opname == "IMPORT_NAME":
            name, value = f"import {step.argval}", _module(step.argval) if step.argval else None
        else:
            name, value = "", None
        if name:
            found[name] = value
    return found
