"""File of a sweep with one JSON line for each point, written as it is computed; an interrupted sweep resumes from it.

The first line identifies the function: a file answers only for the function that wrote it.  Numbers and strings are JSON,
anything else is pickled.  A last line that was cut off is dropped.
"""

import base64
import dis
import json
import os
import pickle
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, NamedTuple

from joblib.hashing import NumpyHasher

from boomctl.checks import path as checked_path
from boomctl.checks import shown

_PLAIN = (bool, int, float, str, type(None))  # types that JSON returns to the last bit
_LOADS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
_ATTRIBUTES = ("LOAD_ATTR", "LOAD_METHOD")
_PARTS = ("__func__", "fget", "fset", "fdel", "func")  # functions in static methods, properties and cached properties


class Outcome(NamedTuple):
    """Result of a function at a point, or None and its error; run time [s]."""

    columns: dict[str, Any] | None
    elapsed: float
    error: str = ""
    trace: str = ""


class Checkpoint:
    """The file of a function, which is created if there is none, with the outcomes that it holds."""

    def __init__(self, path: str | os.PathLike[str], function: Callable[..., Any]) -> None:
        self._path = checked_path("checkpoint", path)
        if self._path.is_dir():
            raise ValueError(f"`checkpoint` must be a file, got the folder {path}.")
        name = str(getattr(function, "__qualname__", type(function).__qualname__))
        head = json.dumps({"function": name, "identity": content_hash(f"the function {name}", function)})
        content = self._path.read_bytes() if self._path.exists() else b""
        whole, _, torn = content.decode("utf-8", "replace").rpartition("\n")
        first, *lines = whole.split("\n") if whole else [torn]
        if not whole and head.startswith(torn):  # empty, or its first line was cut off
            self._path.write_bytes(head.encode() + b"\n")
        elif first != head:
            raise ValueError(
                f"`checkpoint` must be a file of the function {name} as it is now (code, closure, globals, bound values),"
                f" got {path}, which begins with {shown(first)}. Choose another file, or delete it."
            )
        else:
            os.truncate(self._path, content.rfind(b"\n") + 1)
        try:
            rows = [json.loads(line) for line in lines]
            done = [row for row in rows if row["found"] is not None]
            self._found = {row["key"]: Outcome(_decoded(row["found"]), row["elapsed"]) for row in done}
        except Exception:  # pickle raises anything
            raise ValueError(f"`checkpoint` must be a file that a sweep wrote, got {path} with other lines.") from None

    def get(self, point: Mapping[str, Any]) -> Outcome | None:
        """Return the outcome of a point that was computed before, None of one that was not, or failed."""
        return self._found.get(_key(point))

    def add(self, labels: Mapping[str, Any], point: Mapping[str, Any], outcome: Outcome) -> None:
        """Write the outcome of a point."""
        try:
            result = outcome.columns and {name: _encoded(cell) for name, cell in outcome.columns.items()}
        except Exception as error:  # pickle raises anything
            raise TypeError(f"`checkpoint` must be None for values that cannot be pickled, got {error}.") from None
        row = {"point": labels, "found": result, "elapsed": outcome.elapsed, "error": outcome.error or None}
        with open(self._path, "ab") as file:
            file.write(json.dumps({**row, "key": _key(point)}).encode() + b"\n")


def _key(point: Mapping[str, Any]) -> str:
    """Return a hash of the values of a point."""
    return content_hash("over", {name: content_hash(f"over[{name!r}]", value) for name, value in point.items()})


def _encoded(value: Any) -> Any:
    return value if type(value) in _PLAIN else [base64.b64encode(pickle.dumps(value)).decode("ascii")]


def _decoded(cells: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: pickle.loads(base64.b64decode(*cell)) if isinstance(cell, list) else cell for name, cell in cells.items()
    }


def content_hash(what: str, value: Any) -> str:
    """Return a hash of the content and behavior of a value; records are hashed by their fields.

    Raises
    ------
    TypeError
        If a part of it cannot be hashed; ``what`` names the value in the message.
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
            obj = ("record", type(obj), {item.name: getattr(obj, item.name) for item in fields(obj)})
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
    """Return the definition of a function or class: code, bound data and globals, or bases and members."""
    if isinstance(of, type):
        members = {}
        for name, member in vars(of).items():
            if hasattr(member, "__get__") and not isinstance(member, FunctionType):
                members[name] = [getattr(member, part, None) for part in _PARTS]
            elif isinstance(member, FunctionType) or not name.startswith(("__", "_abc_")):
                members[name] = member
        return of.__bases__, members
    codes, cells = [of.__code__], {}
    for code in codes:  # including nested functions
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    for name, cell in zip(of.__code__.co_freevars, of.__closure__ or (), strict=True):
        with suppress(ValueError):  # empty
            cells[name] = cell.cell_contents
    data = {name: value for name, value in vars(of).items() if name != "__wrapped__"}
    compiled = [_compiled(code) for code in codes]
    return compiled, of.__defaults__, of.__kwdefaults__, cells, _reads(codes, of.__globals__), data


def _compiled(code: CodeType) -> tuple[Any, ...]:
    constants = [item for item in code.co_consts if not isinstance(item, CodeType)]
    return code.co_code, code.co_names, constants, getattr(code, "co_exceptiontable", None)


def _reads(codes: list[CodeType], namespace: dict[str, Any]) -> dict[str, Any]:
    """Return the globals and imports of code; for modules of the user also the attributes."""
    steps = [(step.opname, step.argval) for code in codes for step in dis.get_instructions(code)]
    result = {name: namespace[name] for how, name in steps if how in _LOADS and name in namespace}
    attributes = {name for how, name in steps if how in _ATTRIBUTES}
    for of, module in list(result.items()):
        if isinstance(module, ModuleType) and _package(module.__name__) is None:
            result |= {f"{of}.{name}": getattr(module, name) for name in attributes if hasattr(module, name)}
    return result | {f"import {name}": _module(name) for how, name in steps if how == "IMPORT_NAME" and name}
