"""Tables of numbers in CSV files: a line of column names, then numbers; errors name file and line."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from boomctl.arrays import Array


@dataclass(frozen=True)
class NumberTable:
    """Columns of numbers.

    Attributes
    ----------
    header : tuple of str
        Names of the columns.
    header_line : int
        Line of the file in which they stand.
    values : (n, m) ndarray
        Finite numbers.
    lines : tuple of int
        Line of the file in which each row of numbers stands.
    """

    header: tuple[str, ...]
    header_line: int
    values: Array
    lines: tuple[int, ...]


def read_numbers(path: str | Path) -> NumberTable:
    """Read a CSV file with a line of column names; lines that begin with ``#`` are comments, empty ones are skipped.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        No numbers, a row of another length than the header, a value that is not a finite number; file and line named.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in UTF-8") from None
    told = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    if len(told) < 2:
        raise ValueError(f"{path}: expected a line of column names and at least one line of numbers")
    rows = [(i, _cells(path, i, line)) for i, line in told]
    header = tuple(name.strip() for name in rows[0][1])
    values = np.array([_numbers(path, line, row, header) for line, row in rows[1:]])
    return NumberTable(header, rows[0][0], values, tuple(line for line, _ in rows[1:]))


def _cells(path: str | Path, line: int, text: str) -> list[str]:
    """Return the values of one line; a line is read for itself, so that a stray quotation mark swallows no others."""
    try:
        return next(csv.reader([text], strict=True))
    except csv.Error as error:
        raise ValueError(f"{path}, line {line}: expected comma-separated values ({error})") from None


def _numbers(path: str | Path, line: int, row: list[str], header: tuple[str, ...]) -> list[float]:
    if len(row) != len(header):
        raise ValueError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}")
    numbers = []
    for name, text in zip(header, row, strict=True):
        try:
            value = float(text)
        except ValueError:
            value = None
        if (
            value is None or "_" in text or not text.isascii()
        ):  # Python's own 1_000 and foreign digits are no CSV numbers
            raise ValueError(f"{path}, line {line}: expected a number in {name!r}, got {text[:50]!r}")
        if not np.isfinite(value):
            raise ValueError(f"{path}, line {line}: expected a finite number in {name!r}, got {text!r}")
        numbers.append(value)
    return numbers
