"""A sweep in a file, one line a point, written as each is done: what was interrupted goes on where it was.

Lines are JSON.  Numbers, words and lists stand as they are, numbers to the last bit; arrays in NumPy's own format, anything
else pickled, both in base64.  A line that was cut off in the middle is dropped.
"""

import base64
import inspect
import io
import json
import os
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import partial
from hashlib import sha256
from math import isfinite
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.checks import path as checked_path
from boomctl.files import locked
from boomctl.studies.sweeps.outcome import Outcome
from boomctl.studies.sweeps.plan import Axis, Label

_FORMAT = "boomctl sweep 1"
_BEGIN = json.dumps({"format": _FORMAT}).rstrip("}").encode("utf-8")
_ARRAY, _PICKLE, _FLOAT, _MAPPING = "array", "pickle", "float", "mapping"


class KeptSweep:
    """The points that a file holds, and the file, open for more.

    Attributes
    ----------
    path : Path
    changed : bool
        Whether the function is not the one, in the same words, that the points were computed with.
    """

    def __init__(self, path: Path, file: io.BufferedRandom, function: Callable[..., Any], names: Sequence[str]) -> None:
        self.path, self._file, self._found = path, file, {}
        self._values: dict[int, tuple[Any, str]] = {}
        head = {
            "format": _FORMAT,
            "function": _name(function),
            "code": sha256(_code(function)).hexdigest(),
            "over": sorted(names),
        }
        text = file.read()
        whole, _, torn = text.rpartition(b"\n")
        lines = whole.split(b"\n") if whole else []
        new = not lines and _BEGIN.startswith(text[: len(_BEGIN)])  # nothing is there, or a head that was cut off
        before = head if new else self._head(lines[0] if lines else text, head)
        self.changed = before["code"] != head["code"]
        for number, line in enumerate(lines[1:], 2):
            try:
                row = json.loads(line)
                columns = {name: _decoded(cell) for name, cell in row["found"].items()}
                self._found[_key(row["point"])] = row.get("given"), Outcome(columns, float(row["seconds"]))
            except Exception:
                raise ValueError(
                    f"{path}, line {number}: not a point of a sweep; expected a file that it wrote"
                ) from None
        if torn:
            file.truncate(len(text) - len(torn))
        file.seek(0, os.SEEK_END)
        if not lines:
            self._write(head)

    def _head(self, line: bytes, head: dict[str, Any]) -> dict[str, Any]:
        try:
            before = json.loads(line)
            is_ours = before["format"] == _FORMAT
        except (ValueError, TypeError, KeyError):
            is_ours, before = False, {}
        if not is_ours:
            raise ValueError(f"file = {self.path}: expected a file that a sweep wrote, or none")
        for what, word in (("function", "the function"), ("over", "parameters")):
            if before[what] != head[what]:
                raise ValueError(
                    f"file = {self.path}: holds a sweep with {word} {before[what]}, not {head[what]}; expected another file"
                )
        return before

    def get(self, point: Mapping[str, Label], arguments: Mapping[str, Any]) -> Outcome | None:
        """Return what came of a point, if that is known: of the same values, which the file knows by their names."""
        given, outcome = self._found.get(_key(point), (None, None))
        return outcome if given is None or given == self._given(arguments) else None

    def keep(self, point: Mapping[str, Label], arguments: Mapping[str, Any], outcome: Outcome) -> None:
        """Write what came of a point; one that failed is not kept, so that it is tried again."""
        if outcome.columns is not None:
            try:
                found = {name: _encoded(cell) for name, cell in outcome.columns.items()}
            except Exception as error:  # pickle raises anything
                raise TypeError(f"file = {self.path}: the function returned what no file keeps: {error}") from None
            row = {"point": dict(point), "given": self._given(arguments), "seconds": outcome.seconds, "found": found}
            self._write(row)

    def _given(self, arguments: Mapping[str, Any]) -> str:
        """Return a digest of values; each, which many points may share, is looked at once."""
        told = []
        for name, value in sorted(arguments.items()):
            if id(value) not in self._values:
                self._values[id(value)] = value, sha256(_told(value)).hexdigest()
            told.append(f"{name} {self._values[id(value)][1]}")
        return sha256("\n".join(told).encode("utf-8")).hexdigest()

    def _write(self, row: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(row).encode("utf-8") + b"\n")
        self._file.flush()


@contextmanager
def kept_sweep(path: object, function: Callable[..., Any], axes: Sequence[Axis]) -> Iterator[KeptSweep | None]:
    """Give the sweep that a file holds, which is made if there is none, and which no other sweep writes to meanwhile.

    None without a file.
    """
    if path is None:
        yield None
        return
    for axis in axes:
        if not axis.named:
            raise ValueError(
                f"over[{axis.name!r}]: expected a mapping of names to values where the sweep is kept in a file, which knows"
                " points by name"
            )
    where = checked_path("file", path)
    if where.is_dir():
        raise ValueError(f"file = {where}: expected a file, got a folder")
    where.touch()
    taken = f"file {where}: another sweep writes to it; wait until it has ended, or choose another file"
    with open(where, "r+b") as file, locked(file.fileno(), taken):
        yield KeptSweep(where, file, function, [axis.name for axis in axes])


def _key(point: Mapping[str, Label]) -> str:
    return json.dumps(dict(point), sort_keys=True)


def _name(function: Callable[..., Any]) -> str:
    if isinstance(function, partial):
        return _name(function.func)
    return getattr(function, "__qualname__", type(function).__qualname__)


def _code(function: Callable[..., Any], deep: bool = True) -> bytes:
    """Return what a function does: its words and, if ``deep``, what it holds; of an object its class and data."""
    if isinstance(function, partial):
        return _code(function.func) + _told((function.args, function.keywords))
    if inspect.ismethod(function):
        return _code(function.__func__) + _told(function.__self__)
    if not inspect.isroutine(function):
        return _words(type(function)) + _told(function)
    if not (inspect.isfunction(function) and deep):
        return _words(function)
    # defaults, and what it uses of the functions around it
    function = inspect.unwrap(function)
    held = function.__defaults__, function.__kwdefaults__, inspect.getclosurevars(function).nonlocals
    return _words(function) + (_told(held, deep=False) if any(held) else b"")


def _words(of: Any) -> bytes:
    try:
        return inspect.getsource(of).encode("utf-8")
    except (OSError, TypeError):  # of C, or typed at a prompt
        return b""


def _told(value: Any, deep: bool = True) -> bytes:
    """Return what a value holds: records by their fields, not by what they have computed of themselves since."""
    if inspect.isroutine(value):
        return _code(value, deep)
    if is_dataclass(value) and not isinstance(value, type):
        own = {each.name: getattr(value, each.name) for each in fields(value)}
        return type(value).__qualname__.encode("utf-8") + _told(own, deep)
    if isinstance(value, (tuple, list)):
        return b"[" + b",".join(_told(each, deep) for each in value) + b"]"
    if isinstance(value, Mapping):
        return _told(sorted(([repr(key), item] for key, item in value.items()), key=itemgetter(0)), deep)
    try:
        return pickle.dumps(value)
    except Exception:  # what does not pickle is told by nothing
        return b""


def _encoded(value: Any) -> Any:
    if value is None or type(value) in (bool, int, str) or (type(value) is float and isfinite(value)):
        return value
    if type(value) is float:
        return {_FLOAT: repr(value)}
    if type(value) is list:
        return [_encoded(item) for item in value]
    if type(value) is dict and all(isinstance(key, str) for key in value):
        return {_MAPPING: {key: _encoded(item) for key, item in value.items()}}
    if type(value) is np.ndarray and value.dtype.kind in "biufcU":
        written = io.BytesIO()
        np.save(written, value, allow_pickle=False)
        return {_ARRAY: base64.b64encode(written.getvalue()).decode("ascii")}
    return {_PICKLE: base64.b64encode(pickle.dumps(value)).decode("ascii")}


def _decoded(cell: Any) -> Any:
    if isinstance(cell, list):
        return [_decoded(item) for item in cell]
    if not isinstance(cell, dict):
        return cell
    ((kind, content),) = cell.items()
    if kind == _FLOAT:
        return float(content)
    if kind == _MAPPING:
        return {key: _decoded(item) for key, item in content.items()}
    if kind == _ARRAY:
        return np.load(io.BytesIO(base64.b64decode(content)), allow_pickle=False)
    return pickle.loads(base64.b64decode(content))
