"""Measured curves from CSV files, complex frequency responses from CSV files and universal files (UFF)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from itertools import product
from math import tau
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import path as checked_path
from boomctl.files import read_numbers
from boomctl.lti.frequency import singular_values
from boomctl.lti.rounding import ALIKE
from boomctl.printing import listed

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

_FREQUENCY = ("freq_hz", "frequency_hz")  # names of the first column
_UNIVERSAL = (".uff", ".unv", ".uf", ".58")  # ends of the names of universal files
_NO_MAGNITUDES = {  # what the words of a column's name say that it holds
    "a phase": r"(.* )?(phases?|phi|deg|degrees?)( .*)?|angle|arg|argument",
    "decibels": r"(.* )?([a-z]*db|decibels?)( .*)?",
    "a part of complex numbers": r"(.* )?(re|im|real|imag|imaginary)( .*)?",
    "a frequency": r"(freq|frequency|omega)( hz| rad s)?|hz",
    "a coherence": r"(.* )?(coh|coherence)( .*)?",
}
_UFF_FREQUENCY = 18  # what an abscissa of data set 58 is of, if it is frequency
_RESPONSES = (4, 5)  # function types of data set 58: frequency response, transmissibility
_DIRECTIONS = {0: "", 1: "+x", 2: "+y", 3: "+z", 4: "+rx", 5: "+ry", 6: "+rz"}  # codes of data set 58
_DIRECTIONS |= {-k: word.replace("+", "-") for k, word in _DIRECTIONS.items() if k}  # codes below zero: the other way
_MARK = b"    -1"  # the line before and after each data set
_OTHER = frozenset(
    {"g", "gn", "mm", "cm", "um", "in", "inch", "ft", "lb", "lbf", "kgf", "kn"}
)  # lengths, forces: not SI
# words that a label of a unit has where numbers are not in SI units, of each axis
_OTHER_UNITS = {"abscissa": frozenset({"khz", "rpm", "cpm", "rad"}), "ordinate": _OTHER, "orddenom": _OTHER}


@dataclass(frozen=True)
class MeasuredFrequencyResponse:
    """Measured singular values over frequency, with the complex frequency response if available.

    Attributes
    ----------
    frequency_hz : (n,) ndarray
        Frequencies, ascending [Hz].
    magnitude : (k, n) ndarray
        Curves as in the file, or the singular values of a measured frequency response.
    labels : tuple of str
        Names of the curves.
    frdata : (p, m, n) ndarray or None
        The complex frequency response; None where the file has magnitudes only.
    input_labels, output_labels : tuple of str
        Names of its signals.
    """

    frequency_hz: Array
    magnitude: Array
    labels: tuple[str, ...]
    frdata: Array | None = None
    input_labels: tuple[str, ...] = ()
    output_labels: tuple[str, ...] = ()

    def __repr__(self) -> str:
        span = f"{len(self.frequency_hz)} frequencies, {self.frequency_hz[0]:.4g} to {self.frequency_hz[-1]:.4g} Hz"
        of = "" if self.frdata is None else f"; with phase, {len(self.output_labels)} x {len(self.input_labels)}"
        return f"MeasuredFrequencyResponse: {listed(self.labels)}\n  {span}, largest {self.magnitude.max():.6g}{of}"

    @cached_property
    def response(self) -> "control.FrequencyResponseData | None":
        """The complex frequency response, as python-control has it; None where the file has magnitudes only."""
        if self.frdata is None:
            return None
        from boomctl.lti.python_control import control

        labels = {"inputs": self.input_labels, "outputs": self.output_labels}
        names: dict[str, Any] = {kind: list(given) for kind, given in labels.items() if given}
        return control.frd(self.frdata, tau * self.frequency_hz, **names, name="measured")

    def plot(self, ax: "Axes | None" = None, *, frequency_unit: str | None = None, **style: Any) -> "Axes":
        """Draw the curve over frequency, on a sigma plot over the computed ones.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis; by default that of the curves that are there already, otherwise Hz.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the names in the file.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting.sigma").plot_measured(self, ax, frequency_unit=frequency_unit, **style)


def read_frequency_response(path: str | Path) -> MeasuredFrequencyResponse:
    r"""Read a measured frequency response or magnitude.

    CSV: the first line contains the names of the columns, as a comment or not.  ``freq_hz`` or ``frequency_hz`` [Hz]
    comes first. Magnitudes: any further names, one column per curve; phases, decibels and coherences raise an error.
    Complex frequency response: pairs of columns ``re_OUT_IN, im_OUT_IN`` (``OUT``, ``IN`` whole numbers from 1), of
    which the singular values are taken; ``response`` keeps the phase.  Other lines that begin with ``#`` are
    comments.  Values are separated by commas; or by semicolons or tabs, and then decimal commas are read as well as
    decimal points.

    Universal files (``.uff``, ``.unv``, ``.58``): the frequency responses of all data sets 58, one for each entry, in SI
    units.  Signals are named by node and direction, such as ``3+y``.  This needs the package pyuff:
    ``pip install 'boomctl[uff]'``.

    Parameters
    ----------
    path : str or Path
        File; the suffix determines the format.

    Returns
    -------
    MeasuredFrequencyResponse
        Frequencies [Hz], magnitudes or singular values, and the complex response where the file has it.

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        If a column or value is missing or invalid, frequencies do not ascend, a name is duplicate or not that of a
        magnitude, or data sets do not form a complete matrix at the same frequencies; the message contains file and
        line or data set.
    ImportError
        If pyuff is not installed and the file is a universal file.

    Examples
    --------
    >>> import boomctl as bc
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "shaker.csv"
    ...     _ = path.write_text("freq_hz,upper,lower\n0.5,3.1,0.9\n1.0,1.2,0.4\n")
    ...     curve = bc.read_frequency_response(path)
    >>> curve.labels, curve.magnitude[0]
    (('upper', 'lower'), array([3.1, 1.2]))
    """
    file = checked_path("path", path)
    if file.suffix.lower() in _UNIVERSAL:
        return _of_response(*_read_universal(file))
    table = read_numbers(path)
    header, freq, values = table.header, table.values[:, 0], table.values[:, 1:]
    heads = f"{path}, line {table.header_line}"
    if header[0] not in _FREQUENCY or len(header) < 2:
        raise ValueError(f"{heads}: expected columns freq_hz and at least one more, got {list(header)}")
    wrong = np.flatnonzero(~(np.diff(freq, prepend=-1.0) > 0.0) | (freq < 0.0))
    if len(wrong):
        line, got = table.lines[wrong[0]], freq[wrong[0]]
        raise ValueError(f"{path}, line {line}: expected freq_hz not below zero and ascending, got {got:g}")
    twice = next((name for i, name in enumerate(header) if name in header[:i]), None)
    if twice is not None:
        raise ValueError(f"{heads}: column {twice!r} is there twice")
    if any(name.startswith(("re_", "im_")) for name in header):
        response = _complex_response(heads, header[1:], values)
        outputs, inputs = (
            tuple(f"{word}_{k + 1}" for k in range(size))
            for word, size in zip(("out", "in"), response.shape, strict=False)
        )
        return _of_response(freq, response, inputs, outputs)
    for name in header[1:]:
        words = " ".join(re.findall(r"[a-z]+", name.lower()))
        for what, said in _NO_MAGNITUDES.items():
            if re.fullmatch(said, words):
                raise ValueError(
                    f"{heads}: expected columns of magnitudes, got {name!r}, the name of {what};"
                    " leave it out, or give complex responses as re_OUT_IN, im_OUT_IN"
                )
    if (values < 0).any():
        row, column = np.argwhere(values < 0)[0]
        raise ValueError(
            f"{path}, line {table.lines[row]}: expected a magnitude not below zero in {header[1 + column]!r}"
        )
    return MeasuredFrequencyResponse(freq, values.T.copy(), header[1:])


def _of_response(
    freq_hz: Array, response: Array, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> MeasuredFrequencyResponse:
    """Return a response with its singular values."""
    curves = singular_values(response)
    labels = tuple(f"measured {i + 1}" for i in range(len(curves)))
    return MeasuredFrequencyResponse(freq_hz, curves, labels, response, inputs, outputs)


def _complex_response(location: str, header: Sequence[str], values: Array) -> Array:
    """Return the response from columns of real and imaginary parts."""
    columns = {}
    for name, column in zip(header, values.T, strict=True):
        word = re.fullmatch(r"(re|im)_0*([1-9][0-9]*)_0*([1-9][0-9]*)", name)
        if word is None:
            raise ValueError(f"{location}: expected columns re_OUT_IN and im_OUT_IN with numbers from 1, got {name!r}")
        key = word[1], int(word[2]), int(word[3])
        if key in columns:  # re_1_1 and re_01_1
            raise ValueError(f"{location}: column {name!r} is there twice")
        columns[key] = column
    outputs, inputs = (range(1, 1 + max(key[k] for key in columns)) for k in (1, 2))
    missing = next((key for key in product(("re", "im"), outputs, inputs) if key not in columns), None)
    if missing is not None:
        raise ValueError(f"{location}: column {missing[0]}_{missing[1]}_{missing[2]} is missing")
    return np.array([[columns["re", o, i] + 1j * columns["im", o, i] for i in inputs] for o in outputs])


def _read_universal(path: Path) -> tuple[Array, Array, tuple[str, ...], tuple[str, ...]]:
    """Return frequencies [Hz], the response (outputs, inputs, frequencies), and the names of inputs and outputs."""
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
            if int(sets[k]["abscissa_spec_data_type"]) == _UFF_FREQUENCY and kind in _RESPONSES:
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
