"""Reading and writing files: tables of numbers, TOML, JSON; each file is written whole or not at all."""

import csv
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import path as checked_path

_BEGIN_NUMBERS = tuple("0123456789+-.,")  # No column name begins with these.
_SEPARATORS = {";": "semicolon", "\t": "tab", ",": "comma"}
"""Separators of a CSV file: the first of these that occurs in the line of column names is used."""


def prepared_folder(path: str | Path) -> Path:
    """Return a folder that exists and can be written to; it is made if need be.

    Raises
    ------
    OSError
        If it cannot be created or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        why = "a file has that name" if isinstance(error, FileExistsError) else error.strerror or error
        raise OSError(f"output folder {folder}: cannot be written to ({why})") from None
    return folder


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file under another name and move it into place, so that it is never incomplete."""
    write_all({path: content})


def write_all(contents: Mapping[Path, bytes | str]) -> None:
    """Write files under other names and, when all are written, move them into place: all of them, or none.

    Raises
    ------
    OSError
        If a file cannot be written; the error names it, not the temporary file.
    ValueError
        If a folder has the name of a file.
    """
    temporaries: dict[Path, str] = {}
    for path in contents:
        _file(path)
    try:
        for path, content in contents.items():
            data = content.encode("utf-8") if isinstance(content, str) else content
            with _named(path):
                handle, temporaries[path] = tempfile.mkstemp(dir=path.parent, prefix=".boomctl-")
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                os.chmod(temporaries[path], 0o644)
        for path in contents:
            with _named(path):
                os.replace(temporaries[path], path)
            del temporaries[path]
    finally:
        for temporary in temporaries.values():
            os.unlink(temporary)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Set the file name of errors in the block."""
    try:
        yield
    except OSError as error:
        if error.errno is not None:
            error.filename, error.filename2 = os.fspath(path), None
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


def json_text(value: Any) -> str:
    """Return numbers, arrays and mappings as JSON in lines."""
    return json.dumps(plain(value), indent=1, allow_nan=False) + "\n"


def _file(path: str | Path) -> Path:
    """Return a path that is not that of a folder."""
    result = checked_path("path", path)
    if result.is_dir():
        raise ValueError(f"{path}: expected a file, got a folder")
    return result


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file, with or without a byte order mark.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is not TOML, or a folder; the message names the file.
    """
    import tomllib  # only who reads such a file waits for its parser

    try:
        return tomllib.loads(_file(path).read_bytes().decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not a TOML file: {error}") from None
    except RecursionError:
        raise ValueError(f"{path}: tables or arrays are nested too deep; expected a few levels") from None


@dataclass(frozen=True)
class NumberTable:
    """Columns of numbers.

    Attributes
    ----------
    header : tuple of str
        Names of the columns.
    header_line : int
        Line number of the column names.
    values : (n, m) ndarray
        Finite numbers.
    lines : tuple of int
        Line number of each row of numbers.
    comments : tuple of (int, str)
        Line number and text of each comment, without its mark.
    """

    header: tuple[str, ...]
    header_line: int
    values: Array
    lines: tuple[int, ...]
    comments: tuple[tuple[int, str], ...]


def read_numbers(path: str | Path) -> NumberTable:
    """Read a CSV file with a line of column names; lines that begin with ``#`` are comments, empty ones are skipped.

    Values are separated by commas; or by semicolons, tabs or blanks, if the line of names is, and decimal commas are then
    accepted as well as decimal points. A first line ``sep=;``, as written by spreadsheets, is accepted. The names may be in
    a comment above the numbers, as written by ``numpy.savetxt``.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is a folder, has no numbers, a row of another length than the header, a value that is not a finite number, or
        both decimal commas and decimal points. The message names file and line.
    """
    try:
        lines = _file(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in UTF-8") from None
    full = [(i, line) for i, line in enumerate(lines, 1) if line.strip()]
    told = [(i, line) for i, line in full if not line.lstrip().startswith("#")]
    comments = tuple((i, line.lstrip()[1:].strip()) for i, line in full if line.lstrip().startswith("#"))
    if told and told[0][1].lower() in {f"sep={mark}" for mark in _SEPARATORS}:
        told = told[1:]
    if told and told[0][1].lstrip()[:1] in _BEGIN_NUMBERS:  # no names, unless in a comment above
        above = [(i, text) for i, text in comments if i < told[0][0]]
        if not above:
            raise ValueError(f"{path}, line {told[0][0]}: expected a line of column names before the numbers")
        told, comments = [*above[-1:], *told], tuple(line for line in comments if line not in above[-1:])
    if len(told) < 2:
        raise ValueError(f"{path}: expected a line of column names and at least one line of numbers")
    blanks = len(told[1][1].split()) > 1  # of numbers; a name may hold blanks
    separator = next((mark for mark in _SEPARATORS if mark in told[0][1]), " " if blanks else ",")
    rows = [(i, _cells(path, i, line, separator)) for i, line in told]
    header = tuple(name.strip() for name in rows[0][1])
    if separator != ",":
        rows = _with_points(path, rows)
    values = np.array([_numbers(path, line, row, header) for line, row in rows[1:]])
    return NumberTable(header, rows[0][0], values, tuple(line for line, _ in rows[1:]), comments)


def _cells(path: str | Path, line: int, text: str, separator: str) -> list[str]:
    """Return the values of one line; lines are parsed separately, so that a stray quotation mark affects one line only."""
    if separator == " ":
        return text.split()
    try:
        return next(csv.reader([text], strict=True, delimiter=separator))
    except csv.Error as error:
        raise ValueError(f"{path}, line {line}: expected {_SEPARATORS[separator]}-separated values ({error})") from None


def _with_points(path: str | Path, rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Replace decimal commas by points; a file that uses both raises ValueError: one could be a thousands separator."""
    marks = {mark: next((i for i, row in rows[1:] if any(mark in cell for cell in row)), None) for mark in ",."}
    if marks[","] is None:
        return rows
    if marks["."] is not None:
        raise ValueError(
            f"{path}: expected decimal commas or decimal points, got a comma in line {marks[',']} and a point in line"
            f" {marks['.']}"
        )
    return [rows[0], *((i, [cell.replace(",", ".") for cell in row]) for i, row in rows[1:])]


def _numbers(path: str | Path, line: int, row: list[str], header: tuple[str, ...]) -> list[float]:
    if len(row) != len(header):
        hint = "; decimal commas need semicolons between values" if len(row) == 2 * len(header) else ""
        raise ValueError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}{hint}")
    numbers = []
    for name, text in zip(header, row, strict=True):
        try:
            value = float(text)
        except ValueError:
            value = None
        # 1_000 and digits of other scripts are numbers to Python, not to others who read CSV files
        if value is None or "_" in text or not text.isascii():
            raise ValueError(f"{path}, line {line}: expected a number in {name!r}, got {text[:50]!r}")
        if not np.isfinite(value):
            raise ValueError(f"{path}, line {line}: expected a finite number in {name!r}, got {text!r}")
        numbers.append(value)
    return numbers
