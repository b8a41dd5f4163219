"""File of a sweep with one JSON line for each point, written as it is computed; an interrupted sweep resumes from it.

The first line identifies the function: a file answers only for the function that wrote it.  Numbers and strings are JSON,
anything else is pickled.  A last line that was cut off is dropped.
"""

import base64
import json
import os
import pickle
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from boomctl.checks import path as checked_path
from boomctl.checks import shown
from boomctl.studies.sweeps.identity import content_hash

_PLAIN = (bool, int, float, str, type(None))  # types that JSON returns to the last bit


class Outcome(NamedTuple):
    """What the function returned at a point, or None and what it raised; run time [s]."""

    columns: dict[str, Any] | None
    seconds: float
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
            self._found = {row["key"]: Outcome(_decoded(row["found"]), row["seconds"]) for row in done}
        except Exception:  # pickle raises anything
            raise ValueError(f"`checkpoint` must be a file that a sweep wrote, got {path} with other lines.") from None

    def get(self, point: Mapping[str, Any]) -> Outcome | None:
        """Return the outcome of a point that was computed before, None of one that was not, or failed."""
        return self._found.get(_key(point))

    def add(self, labels: Mapping[str, Any], point: Mapping[str, Any], outcome: Outcome) -> None:
        """Write the outcome of a point."""
        try:
            found = outcome.columns and {name: _encoded(cell) for name, cell in outcome.columns.items()}
        except Exception as error:  # pickle raises anything
            raise TypeError(f"`checkpoint` must be None for values that cannot be pickled, got {error}.") from None
        row = {"point": labels, "found": found, "seconds": outcome.seconds, "error": outcome.error or None}
        with open(self._path, "ab") as file:
            file.write(json.dumps({**row, "key": _key(point)}).encode() + b"\n")


def _key(point: Mapping[str, Any]) -> str:
    """Return a hash of the values of a point."""
    return content_hash("over", {name: content_hash(f"over[{name!r}]", value) for name, value in point.items()})


def _encoded(value: Any) -> Any:
    return value if type(value) in _PLAIN else [base64.b64encode(pickle.dumps(value)).decode("ascii")]


def _decoded(found: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: pickle.loads(base64.b64decode(*cell)) if isinstance(cell, list) else cell for name, cell in found.items()
    }
