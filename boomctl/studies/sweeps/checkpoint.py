"""File of a sweep with one JSON line a point, written as each is computed; an interrupted sweep resumes from it.

The first line identifies the function: a file answers only for the function that wrote it.  Numbers and strings are JSON,
anything else is pickled.  A last line that was cut off is dropped.
"""

import base64
import json
import pickle
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from io import BufferedRandom
from math import isfinite
from pathlib import Path
from typing import Any

from boomctl.checks import path as checked_path
from boomctl.studies.sweeps.identity import content_hash
from boomctl.studies.sweeps.outcome import Outcome
from boomctl.studies.sweeps.points import Label

_FORMAT = "boomctl sweep 2"
_PICKLE = "pickle"


@contextmanager
def opened(path: object, function: Callable[..., Any]) -> Iterator["Checkpoint | None"]:
    """Open the checkpoint of a function, which is created if there is none; return None without a path."""
    if path is None:
        yield None
        return
    name = _name(function)
    head = {"format": _FORMAT, "function": name, "identity": content_hash(f"the function {name}", function)}
    where = checked_path("checkpoint", path)
    if where.is_dir():
        raise ValueError(f"`checkpoint` must be a file, got the folder {where}.")
    where.touch()
    with open(where, "r+b") as file:
        yield Checkpoint(where, file, head)


class Checkpoint:
    """Outcomes by point, and the file, open for more."""

    def __init__(self, path: Path, file: BufferedRandom, head: Mapping[str, str]) -> None:
        self._file, self._hashes = file, {}  # type: ignore[var-annotated]
        self._outcomes: dict[str, Outcome] = {}
        first = json.dumps(head).encode("utf-8")
        content = file.read()
        whole, _, torn = content.rpartition(b"\n")
        lines = whole.split(b"\n") if whole else []
        if not lines and first.startswith(content):  # empty, or its first line was cut off
            file.truncate(0)
            self._write(first)
            return
        _check(path, lines[0] if lines else content, head)
        file.truncate(len(content) - len(torn))
        for number, line in enumerate(lines[1:], 2):
            try:
                row = json.loads(line)
                if row["error"] is None:
                    columns = {name: _decoded(cell) for name, cell in row["found"].items()}
                    self._outcomes[row["key"]] = Outcome(columns, float(row["seconds"]))
            except Exception:
                raise ValueError(
                    f"`checkpoint` must be a file that a sweep wrote, got {path}, in which line {number} is no point."
                ) from None

    def get(self, arguments: Mapping[str, Any]) -> Outcome | None:
        """Return the outcome of a point that was computed before, None of one that was not, or failed."""
        return self._outcomes.get(self._key(arguments))

    def add(self, labels: Mapping[str, Label], arguments: Mapping[str, Any], outcome: Outcome) -> None:
        """Write the outcome of a point."""
        try:
            found = {name: _encoded(cell) for name, cell in (outcome.columns or {}).items()}
        except Exception as error:  # pickle raises anything
            raise TypeError(f"`checkpoint` must be None for values that cannot be pickled, got {error}.") from None
        row = {"point": dict(labels), "found": found, "seconds": outcome.seconds, "error": outcome.error or None}
        self._write(json.dumps({**row, "key": self._key(arguments)}).encode("utf-8"))

    def _key(self, arguments: Mapping[str, Any]) -> str:
        """Return a hash of the values of a point; a value that many points share is hashed once."""
        for name, value in arguments.items():
            if id(value) not in self._hashes:
                self._hashes[id(value)] = content_hash(f"over[{name!r}]", value), value
        return content_hash("over", {name: self._hashes[id(value)][0] for name, value in arguments.items()})

    def _write(self, line: bytes) -> None:
        self._file.seek(0, 2)
        self._file.write(line + b"\n")
        self._file.flush()


def _check(path: Path, line: bytes, head: Mapping[str, str]) -> None:
    """Raise an error for a file that another function, or no sweep, wrote."""
    try:
        before = json.loads(line)
        ours = before["format"] == head["format"]
    except (ValueError, TypeError, KeyError):
        before, ours = {}, False
    if not ours:
        raise ValueError(f"`checkpoint` must be a file that a sweep wrote, or a new one, got {path}.")
    if before["identity"] != head["identity"]:
        raise ValueError(
            f"`checkpoint` must be a file of the function {head['function']} as it is now, got {path} of"
            f" {before['function']}: another source, closure, global, or bound value. Choose another file, or delete it."
        )


def _name(function: Callable[..., Any]) -> str:
    while isinstance(function, partial):
        function = function.func
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _is_plain(value: Any) -> bool:
    """Return whether JSON returns the same value, to the last bit."""
    if type(value) is list:
        return all(_is_plain(item) for item in value)
    return value is None or type(value) in (bool, int, str) or (type(value) is float and isfinite(value))


def _encoded(value: Any) -> Any:
    return value if _is_plain(value) else {_PICKLE: base64.b64encode(pickle.dumps(value)).decode("ascii")}


def _decoded(cell: Any) -> Any:
    return pickle.loads(base64.b64decode(cell[_PICKLE])) if isinstance(cell, dict) else cell
