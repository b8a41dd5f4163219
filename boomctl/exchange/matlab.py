"""Controllers for MATLAB and Octave: a ``.mat`` file and a function that returns an ``ss`` object."""

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import shown
from boomctl.lti.system import Lti

_LARGEST = 63  # Length of a name in MATLAB.
_NOT_SAID = -1.0  # Unspecified sample time in MATLAB.


def matlab_files(name: str, K: Lti, units: Mapping[str, str]) -> dict[str, bytes | str]:
    """Return the contents of ``NAME.mat`` and ``NAME.m``.

    Raises
    ------
    ValueError
        If ``name`` is not an identifier of MATLAB, or a name or unit cannot be stored.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > _LARGEST:
        raise ValueError(
            f"path: {name!r} is no name of a MATLAB function: expected letters, digits and _, a letter first"
        )
    from scipy.io import savemat  # for those who write such a file

    states = K.state_labels or tuple(f"x{i}" for i in range(len(K.A)))
    held = {
        **{letter: getattr(K, letter) for letter in "ABCD"},
        "sample_time": _NOT_SAID if np.isnan(K.dt) else K.dt,
        "inputs": _cells(K.input_labels),
        "outputs": _cells(K.output_labels),
        "states": _cells(states),
        "input_units": _cells([units.get(signal, "") for signal in K.input_labels]),
        "output_units": _cells([units.get(signal, "") for signal in K.output_labels]),
    }
    file = io.BytesIO()
    savemat(file, held)
    return {f"{name}.mat": file.getvalue(), f"{name}.m": _FUNCTION.replace("NAME", name)}


def read_matlab(path: Path) -> dict[str, Any]:
    """Read matrices A, B, C, D, names and sample time of a ``.mat`` file; missing names are replaced.

    Raises
    ------
    ValueError
        If the file is not a MAT-file, or a matrix is missing.
    """
    from scipy.io import loadmat

    content = io.BytesIO(path.read_bytes())
    try:
        held = loadmat(content)
    except Exception as error:  # SciPy raises various exceptions for other files.
        raise ValueError(f"{path}: not a MATLAB file of version 5: {' '.join(str(error).split())}") from None
    missing = [letter for letter in "ABCD" if letter not in held]
    if missing:
        raise ValueError(f"{path}: expected matrices A, B, C, D; {', '.join(missing)} not there")
    p, m = np.shape(held["D"]) if np.ndim(held["D"]) == 2 else (0, 0)
    result = {letter: held[letter] for letter in "ABCD"}
    for kind, count in (("inputs", m), ("outputs", p), ("states", np.shape(held["A"])[0])):
        result[kind] = _names(held.get(kind), count, kind[0])
    time = np.asarray(held.get("sample_time", 0.0))
    seconds = time.item() if time.size == 1 and time.dtype.kind in "iuf" else time
    return result | {"sample_time": True if seconds is not time and seconds == _NOT_SAID else seconds}


def _cells(words: "tuple[str, ...] | list[str]") -> Array:
    cells = np.empty((len(words), 1), dtype=object)
    for i, word in enumerate(words):
        if any(letter == "\0" or "\ud800" <= letter <= "\udfff" for letter in word):
            raise ValueError(
                f"controller: name or unit {shown(word)}: expected one without null characters and surrogates"
            )
        cells[i, 0] = word
    return cells


def _names(cells: object, count: int, letter: str) -> list[object]:
    if cells is None:
        return [f"{letter}{i}" for i in range(count)]
    result = (np.ravel(cell) for cell in np.ravel(np.asarray(cells, dtype=object)))
    return ["" if not cell.size else cell[0] if cell.dtype.kind != "U" else str(cell[0]) for cell in result]


_FUNCTION = """\
function K = NAME ()
% NAME  The controller u = K y of NAME.mat, as ss with names.
  s = load (fullfile (fileparts (mfilename ('fullpath')), 'NAME.mat'));
  if exist ('OCTAVE_VERSION', 'builtin')
    pkg load control
  end
  K = ss (s.A, s.B, s.C, s.D, s.sample_time);
  K.InputName = s.inputs;
  K.OutputName = s.outputs;
  if ~isempty (s.A)
    K.StateName = s.states;
  end
  if ~exist ('OCTAVE_VERSION', 'builtin')
    K.InputUnit = s.input_units;
    K.OutputUnit = s.output_units;
  end
end
"""
