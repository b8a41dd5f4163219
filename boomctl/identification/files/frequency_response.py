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


@dataclass(frozen=True)
class MeasuredFrequencyResponse:
    """Measured singular values over frequency, and the complex response that they are of, where it is known.

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

        names: dict[str, Any] = {"inputs": list(self.input_labels), "outputs": list(self.output_labels)}
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
    r"""Read a measured curve or frequency response.

    CSV: the first line names the columns, in a comment or not.  ``freq_hz`` or ``frequency_hz`` [Hz] comes first.
    Magnitudes: any further names, one column a curve; phases, decibels and coherences raise an error.  Complex
    frequency response: pairs of columns ``re_OUT_IN, im_OUT_IN`` (``OUT``, ``IN`` whole numbers from 1), of which the
    singular values are taken; ``response`` keeps the phase.  Other lines that begin with ``#`` are comments.  Values are
    separated by commas; or by semicolons or tabs, and then decimal commas are read as well as decimal points.

    Universal files (``.uff``, ``.unv``, ``.58``): the frequency responses of all data sets 58, one for each entry, in SI
    units.  Signals are named by node and direction, such as ``3+y``.  This needs the package pyuff:
    ``pip install 'boomctl[uff]'``.

    Parameters
    ----------
    path : str or Path
        The file; its suffix says of which kind it is.

    Returns
    -------
    MeasuredFrequencyResponse
        Frequencies [Hz], magnitudes or singular values, and the complex response where the file has it.

    Raises
    ------
    OSError
        The file cannot be read.
    TypeError, ValueError
        A column or value is missing, not a number, negative where it cannot be, or frequencies do not ascend; a name is
        there twice or is none of a magnitude; data sets do not make up a whole matrix at the same frequencies; the message
        names file and line or data set.
    ImportError
        A universal file, and pyuff is not installed.

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
        from boomctl.identification.files.universal import read_responses

        return _of_response(*read_responses(file))
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
