"""Frequency responses from universal files (UFF), data sets 58; the package pyuff, an extra, reads them."""

import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE

_FREQUENCY = 18  # what an abscissa of data set 58 is of, if it is frequency
_RESPONSES = (4, 5)  # function types of data set 58: frequency response, transmissibility
_DIRECTIONS = {0: "", 1: "+x", 2: "+y", 3: "+z", 4: "+rx", 5: "+ry", 6: "+rz"}  # codes of data set 58
_DIRECTIONS |= {-k: word.replace("+", "-") for k, word in _DIRECTIONS.items() if k}  # codes below zero: the other way
_MARK = b"    -1"  # the line before and after each data set
_OTHER = frozenset(
    {"g", "gn", "mm", "cm", "um", "in", "inch", "ft", "lb", "lbf", "kgf", "kn"}
)  # lengths, forces: not SI
# words that a label of a unit has where numbers are not in SI units, of each axis
_OTHER_UNITS = {"abscissa": frozenset({"khz", "rpm", "cpm", "rad"}), "ordinate": _OTHER, "orddenom": _OTHER}


def read_responses(path: Path) -> tuple[Array, Array, tuple[str, ...], tuple[str, ...]]:
    """Return frequencies [Hz], the response (outputs, inputs, frequencies), and the names of inputs and outputs.

    Raises
    ------
    OSError, ValueError, ImportError
        As for :func:`boomctl.read_frequency_response`.
    """
    result: dict[tuple[tuple[int, int], tuple[int, int]], Array] = {}
    grid = None
    kinds, responses = _data_sets(path)
    for k, item in responses.items():
        location = f"{path}, data set {k + 1}"
        out, into = ((int(item[f"{side}_node"]), int(item[f"{side}_dir"])) for side in ("rsp", "ref"))
        freq, values = _curve(location, item)
        grid = freq if grid is None else grid
        if freq.shape != grid.shape or not np.allclose(freq, grid, rtol=ALIKE, atol=0.0):
            raise ValueError(f"{location}: expected the frequencies of the data sets before it")
        if (out, into) in result:
            raise ValueError(f"{location}: the response of {_signal(out)} to {_signal(into)} is there twice")
        result[out, into] = values
    if grid is None:
        there = ", ".join(map(str, sorted(kinds))) or "none"
        raise ValueError(f"{path}: expected data sets 58 with frequency responses, got data sets {there}")
    outputs, inputs = (sorted({key[side] for key in result}) for side in (0, 1))
    missing = next((key for key in product(outputs, inputs) if key not in result), None)
    if missing is not None:
        raise ValueError(f"{path}: the response of {_signal(missing[0])} to {_signal(missing[1])} is missing")
    response = np.array([[result[out, into] for into in inputs] for out in outputs])
    return grid, response, tuple(map(_signal, inputs)), tuple(map(_signal, outputs))


def _data_sets(path: Path) -> tuple[set[int], dict[int, dict[str, Any]]]:
    """Return the kinds of all data sets, and the frequency responses by their place in the file."""
    try:
        import pyuff  # an extra of its own
    except ImportError:
        raise ImportError(
            f"{path}: universal files are read by the package pyuff: pip install 'boomctl[uff]'"
        ) from None
    lines = path.read_bytes().splitlines()  # pyuff's own message for a file that is not there names no file
    if sum(line.rstrip() == _MARK for line in lines) % 2:
        raise ValueError(
            f"{path}: expected a line '{_MARK.decode()}' before and after each data set, got an odd number"
        )
    try:
        file = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in file.get_set_types()]
        sets = {k: file.read_sets(k) for k, kind in enumerate(kinds) if kind in (58, 164)}
        factors = [(name, float(sets[k][name])) for k in sets if kinds[k] == 164 for name in ("length", "force")]
        responses = {}
        for k in (k for k in sets if kinds[k] == 58):
            kind, _ = int(sets[k]["func_type"]), (int(sets[k]["num_pts"]), sets[k]["x"], sets[k]["data"])
            if int(sets[k]["abscissa_spec_data_type"]) == _FREQUENCY and kind in _RESPONSES:
                responses[k] = sets[k]  # Other data sets of the file are ignored.
    except Exception as error:  # of a broken file it may raise anything
        raise ValueError(f"{path}: not a universal file that pyuff can read: {error}") from None
    if 0 in kinds:
        raise ValueError(f"{path}, data set {kinds.index(0) + 1}: expected the number of its kind in its first line")
    for name, factor in factors:
        if not abs(factor - 1.0) <= ALIKE:
            raise ValueError(
                f"{path}: expected SI units, got a file whose unit of {name} is 1/{factor:g} of that (data set 164)"
            )
    return set(kinds), responses


def _curve(location: str, item: dict[str, Any]) -> tuple[Array, Array]:
    """Return frequencies and complex values of one data set, checked."""
    freq, values = np.asarray(item["x"], dtype=float), np.asarray(item["data"])
    if not np.iscomplexobj(values):
        raise ValueError(f"{location}: expected a complex frequency response, got real numbers")
    if not (np.isfinite(freq).all() and np.isfinite(values).all() and len(freq) and freq.shape == values.shape):
        raise ValueError(f"{location}: expected finite numbers, one a frequency")
    if len(freq) != int(item["num_pts"]):
        raise ValueError(f"{location}: expected {int(item['num_pts'])} values, as it says itself, got {len(freq)}")
    for axis, others in _OTHER_UNITS.items():
        unit = str(item.get(f"{axis}_axis_units_lab", ""))
        if others.intersection(re.findall(r"[a-z]+", unit.lower())):
            raise ValueError(f"{location}: expected SI units and frequencies in Hz, got the unit {unit!r}")
    if (freq < 0.0).any() or not (np.diff(freq) > 0.0).all():
        raise ValueError(f"{location}: expected frequencies not below zero and ascending")
    return freq, values


def _signal(location: tuple[int, int]) -> str:
    """Return a node and direction as a name."""
    node, direction = location
    return f"{node}{_DIRECTIONS.get(direction, f'({direction})')}"
