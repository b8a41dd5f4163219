"""Writing results: into folders known to be writable, each file whole or not at all."""

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def prepared_folder(path: str | Path) -> Path:
    """Return a folder that exists and can be written to; it is made if need be.

    Raises
    ------
    OSError
        It cannot be made or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, probe = tempfile.mkstemp(dir=folder, prefix=".boomctl-")
    except OSError as error:
        raise OSError(f"output folder {folder}: cannot be written to ({error.strerror or error})") from None
    os.close(handle)
    os.unlink(probe)
    return folder


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file under another name and move it into place, so that no half of it is ever seen."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".boomctl-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def plain(value: Any) -> Any:
    """Return numbers, arrays and mappings as what JSON knows; numbers that are not finite become strings."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value


def write_json(path: Path, value: Any) -> None:
    """Write numbers, arrays and mappings as JSON."""
    write_whole(path, json.dumps(plain(value), indent=1, allow_nan=False) + "\n")
