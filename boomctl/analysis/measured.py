"""Measured curves from CSV files."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from boomctl.arrays import Array
from boomctl.files import read_numbers
from boomctl.lti.frequency import singular_values
from boomctl.printing import listed


@dataclass(frozen=True)
class MeasuredCurve:
    """Measured singular values over frequency.

    Attributes
    ----------
    freq_hz : (n,) ndarray
        Ascending.
    magnitude : (k, n) ndarray
        One line a curve, as they stand in the file, or the singular values of a measured frequency response.
    labels : tuple of str
        One a curve.
    """

    freq_hz: Array
    magnitude: Array
    labels: tuple[str, ...]

    def __repr__(self) -> str:
        span = f"{len(self.freq_hz)} frequencies, {self.freq_hz[0]:.4g} to {self.freq_hz[-1]:.4g} Hz"
        return f"MeasuredCurve: {listed(self.labels)}\n  {span}, largest {self.magnitude.max():.6g}"


def read_measured_curve(path: str | Path) -> MeasuredCurve:
    """Read a measured curve.

    The first line names the columns.  ``freq_hz`` [Hz] comes first.  Magnitudes: any further names, one column a curve.
    Complex frequency response: pairs of columns ``re_OUT_IN, im_OUT_IN`` (``OUT``, ``IN`` whole numbers from 1), of
    which the singular values are taken.  Lines that begin with ``#`` are comments.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        A column or value is missing, not a number, negative where it cannot be, or frequencies do not ascend; the
        message names file and line.
    """
    table = read_numbers(path)
    header, values = table.header, table.values
    if header[0] != "freq_hz" or len(header) < 2:
        raise ValueError(
            f"{path}, line {table.header_line}: expected columns freq_hz and at least one more, got {list(header)}"
        )
    freq = values[:, 0]
    if (freq < 0).any() or not (np.diff(freq) > 0).all():
        bad = int(np.argmax(np.concatenate([[freq[0] < 0], ~(np.diff(freq) > 0)])))
        raise ValueError(
            f"{path}, line {table.lines[bad]}: expected freq_hz not below zero and ascending, got {freq[bad]:g}"
        )
    if header[1].startswith(("re_", "im_")):
        curves = singular_values(_complex_response(path, header, values))
        return MeasuredCurve(freq, curves, tuple(f"measured {i + 1}" for i in range(len(curves))))
    if (values[:, 1:] < 0).any():
        line, column = (int(i) for i in np.argwhere(values[:, 1:] < 0)[0])
        raise ValueError(
            f"{path}, line {table.lines[line]}: expected a magnitude not below zero in {header[1 + column]!r}"
        )
    return MeasuredCurve(freq, values[:, 1:].T.copy(), header[1:])


def _complex_response(path: str | Path, header: tuple[str, ...], table: Array) -> Array:
    entries = {}
    for column, name in enumerate(header[1:], 1):
        part, *place = name.split("_")
        if part not in ("re", "im") or len(place) != 2 or not all(text.isdigit() and int(text) > 0 for text in place):
            raise ValueError(f"{path}: expected columns re_OUT_IN and im_OUT_IN with numbers from 1, got {name!r}")
        entries[part, int(place[0]) - 1, int(place[1]) - 1] = table[:, column]
    p, m = 1 + max(key[1] for key in entries), 1 + max(key[2] for key in entries)
    response = np.zeros((p, m, len(table)), dtype=complex)
    for o in range(p):
        for i in range(m):
            for part, unit in (("re", 1.0), ("im", 1j)):
                if (part, o, i) not in entries:
                    raise ValueError(f"{path}: column {part}_{o + 1}_{i + 1} is missing")
                response[o, i] += unit * entries[part, o, i]
    return response
