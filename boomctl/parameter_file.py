"""Parameters from a TOML file."""

import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from boomctl.checks import known

T = TypeVar("T")


def read_parameters(kind: type[T], path: str | Path) -> T:
    """Return a frozen dataclass of numbers from the keys of a TOML file; errors name the file and the key."""
    text = Path(path).read_bytes()
    try:
        table: dict[str, Any] = tomllib.loads(text.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not a TOML file: {error}") from None
    allowed = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    try:
        for key, value in table.items():
            known("key", key, allowed)
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise TypeError(f"{key} = {value!r}: expected a number, got {type(value).__name__}")
        return kind(**table)
    except (ValueError, TypeError) as error:
        raise type(error)(f"{path}: {error}") from None
