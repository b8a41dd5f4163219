"""Controllers for MATLAB and Octave: matrices and names in a ``.mat`` file, a function that makes ``ss`` of them."""

import io
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_LARGEST = 63  # letters of a name in MATLAB


def matlab_files(name: str, K: Lti, units: Mapping[str, str]) -> dict[str, bytes | str]:
    """Return the contents of ``NAME.mat`` and ``NAME.m``.

    Raises
    ------
    ValueError
        ``name`` is none of a function.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > _LARGEST:
        raise ValueError(
            f"path: {name!r} is no name of a MATLAB function: expected letters, digits and _, a letter first"
        )
    from scipy.io import savemat  # for those who write such a file

    states = K.states or tuple(f"x{i}" for i in range(len(K.A)))
    held = {
        "A": K.A,
        "B": K.B,
        "C": K.C,
        "D": K.D,
        "sample_time": -1.0 if np.isnan(K.dt) else K.dt,  # -1 is MATLAB's for a time step that is not said
        "inputs": _cells(K.inputs),
        "outputs": _cells(K.outputs),
        "states": _cells(states),
        "input_units": _cells([units.get(signal, "") for signal in K.inputs]),
        "output_units": _cells([units.get(signal, "") for signal in K.outputs]),
    }
    file = io.BytesIO()
    savemat(file, held)
    return {f"{name}.mat": file.getvalue(), f"{name}.m": _FUNCTION.replace("NAME", name)}


def read_matlab(path: Path) -> Lti:
    """Return the system of a ``.mat`` file with the matrices A, B, C, D; names where there are any.

    Raises
    ------
    ValueError
        Another kind of file, or not these matrices.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        held = loadmat(path)
    except (MatReadError, ValueError, NotImplementedError, TypeError) as error:
        raise ValueError(f"{path}: not a MATLAB file of version 5: {error}") from None
    missing = [letter for letter in "ABCD" if letter not in held]
    if missing:
        raise ValueError(f"{path}: expected matrices A, B, C, D; {', '.join(missing)} not there")
    A, D = np.asarray(held["A"], dtype=float), np.asarray(held["D"], dtype=float)
    n, (p, m) = len(A), D.shape
    B, C = np.asarray(held["B"], dtype=float).reshape(n, m), np.asarray(held["C"], dtype=float).reshape(p, n)
    time = float(np.ravel(held.get("sample_time", 0.0))[0])
    names = [_names(held.get(kind), count, kind[0]) for kind, count in (("inputs", m), ("outputs", p), ("states", n))]
    inputs, outputs, states = names
    return Lti(A.reshape(n, n), B, C, D, inputs, outputs, states, float("nan") if time < 0.0 else time)


def _cells(words: "tuple[str, ...] | list[str]") -> Array:
    cells = np.empty((len(words), 1), dtype=object)
    for i, word in enumerate(words):
        cells[i, 0] = word
    return cells


def _names(cells: object, count: int, letter: str) -> tuple[str, ...]:
    if cells is None:
        return tuple(f"{letter}{i}" for i in range(count))
    return tuple(str(cell[0]) if np.size(cell) else "" for cell in np.ravel(np.asarray(cells, dtype=object)))


_FUNCTION = """\
function K = NAME ()
% NAME  The controller u = K y of NAME.mat, as ss with names.
  s = load (fullfile (fileparts (mfilename ('fullpath')), 'NAME.mat'));
  if exist ('OCTAVE_VERSION', 'builtin')
    pkg load control
  end
  if s.sample_time == 0
    K = ss (s.A, s.B, s.C, s.D);
  else
    K = ss (s.A, s.B, s.C, s.D, s.sample_time);
  end
  if exist ('OCTAVE_VERSION', 'builtin')
    K = set (K, 'inname', s.inputs, 'outname', s.outputs);
    if ~isempty (s.A)
      K = set (K, 'stname', s.states);
    end
  else
    K.InputName = s.inputs;
    K.OutputName = s.outputs;
    K.InputUnit = s.input_units;
    K.OutputUnit = s.output_units;
    if ~isempty (s.A)
      K.StateName = s.states;
    end
  end
end
"""
