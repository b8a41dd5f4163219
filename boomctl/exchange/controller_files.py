"""Controller files: JSON, MATLAB, C99."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, mapping, nonnegative, positive, shown, truth
from boomctl.checks import path as checked_path
from boomctl.exchange.c_code import RunningController, c_files
from boomctl.exchange.matlab import matlab_files, read_matlab
from boomctl.files import json_text, write_all
from boomctl.lti.system import Lti, check_scales, controller_of, of
from boomctl.printing import listed
from boomctl.simulation.conditioning import correction
from boomctl.simulation.signals import per_signal
from boomctl.units import half_unit, is_half

if TYPE_CHECKING:
    import control

_FORMAT = "boomctl controller"
_VERSION = 1  # Version of the JSON format; another one raises an error.
SUFFIXES = (".json", ".mat", ".c")
_UNITS = {"stroke": "m", "tip": "m", "cradle_slip": "m", "suspension": "N", "cradle": "N", "torque": "N m"}  # by stem
_RATES = {"hub_angle": "rad", "hub_speed": "rad/s", "_acceleration": "m/s^2", "_speed": "m/s"}  # these come first
_LARGEST = np.finfo(float).max.item()


@dataclass(frozen=True)
class ControllerMetadata:
    """Units, certificate and provenance in a controller file.

    Attributes
    ----------
    units : mapping from signal to str
        Unit of each signal; "" if unknown.
    certificate : mapping
        Entries of the certificate of the synthesis, if any.
    provenance : mapping
        Version of boomctl (``"boomctl"``), and further entries.
    """

    units: Mapping[str, str] = field(default_factory=dict)
    certificate: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        marked = [f"{name} [{unit}]" if unit else name for name, unit in self.units.items()]
        parts = f"{len(self.certificate)} entries of a certificate, {len(self.provenance)} of provenance"
        return f"ControllerMetadata: {listed(marked, 100)}\n  {parts}"


def write_controller(
    controller: "control.StateSpace | Any",
    path: str | Path,
    *,
    sample_time: float | None = None,
    control_limit: float | Mapping[str, float] | None = None,
    rate_limit: float | Mapping[str, float] | None = None,
    anti_windup: bool = True,
    units: Mapping[str, str] | None = None,
    certificate: object = None,
    provenance: Mapping[str, Any] | None = None,
    allow_subsystem: bool = False,
) -> tuple[Path, ...]:
    """Write a controller ``u = K y`` to a file; the suffix determines the format.

    =========  ==========================================================================================================
    ``.json``  matrices, sample time, names, units, certificate, provenance; numbers are exact
    ``.mat``   the same matrices for MATLAB and Octave, and ``NAME.m``, a function that returns ``ss`` with names
    ``.c``     C99: ``NAME.c`` and ``NAME.h``, a step function for each sample, with limits and anti-windup as
               :func:`boomctl.simulate_loop` has them, in double or (``-DNAME_SINGLE``) single precision, no memory
               allocated; and ``NAME_test.c``, a program that compares it with numbers computed here
    =========  ==========================================================================================================

    Parameters
    ----------
    controller : control.StateSpace or a result with ``.controller``
        Controller or result of a synthesis, whose certificate is written too.
    path : str or Path
        File; its folder must exist.
    sample_time : float, optional
        Sample time [s] of a continuous-time controller, for :func:`boomctl.discretize`. Required for C.
    control_limit, rate_limit : float or mapping from control to float, optional
        For C code: maximum absolute control, and its maximum rate.
    anti_windup : bool
        For C code: correct the states if the output is limited.
    units : mapping from signal to str, optional
        Units of the signals. If None, those of the signals of the boom, "" for others.
    certificate : object, optional
        Certificate or mapping. If None, that of the result.
    provenance : mapping, optional
        Further entries of the file.
    allow_subsystem : bool
        Write the controller of a subsystem, whose signals end in ``_sym`` or ``_anti``. The machine has no such signals.

    Returns
    -------
    tuple of Path
        Files written. All or none are written.

    Raises
    ------
    TypeError, ValueError
        If the controller or the suffix is invalid, a signal is unknown, a continuous-time controller is written as C without
        `sample_time`, the name is invalid in C or MATLAB, or the signals are of a subsystem and `allow_subsystem` is False.
    OSError
        If the folder cannot be written to.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> import tempfile
    >>> from pathlib import Path
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0, inputs="stroke", outputs="force")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = bc.write_controller(lag, Path(folder) / "lag.c", sample_time=0.01, control_limit=60.0)
    >>> [file.name for file in written]
    ['lag.c', 'lag.h', 'lag_test.c']
    """
    file = checked_path("path", path)
    K = controller_of(controller, any_time=True)
    halves = [name for name in (*K.input_labels, *K.output_labels) if is_half(name)]
    if not truth("allow_subsystem", allow_subsystem) and halves:
        raise ValueError(
            f"controller: {halves[0]!r} is a signal of a symmetric or antisymmetric subsystem, scaled by"
            " sqrt(2); combine both controllers by join_symmetric, or set allow_subsystem=True"
        )
    contents = controller_contents(
        controller, file.stem, file.suffix, sample_time=sample_time, control_limit=control_limit, rate_limit=rate_limit,
        anti_windup=anti_windup, units=units, certificate=certificate, provenance=provenance,
    )  # fmt: skip
    named = {file.parent / name: content for name, content in contents.items()}
    write_all(named)
    return tuple(named)


def controller_contents(
    controller: "control.StateSpace | Any",
    name: str,
    suffix: str,
    *,
    sample_time: float | None = None,
    control_limit: float | Mapping[str, float] | None = None,
    rate_limit: float | Mapping[str, float] | None = None,
    anti_windup: bool = True,
    units: Mapping[str, str] | None = None,
    certificate: object = None,
    provenance: Mapping[str, Any] | None = None,
) -> dict[str, bytes | str]:
    """Return the contents of the files of :func:`write_controller` by name."""
    from boomctl import __version__

    known("suffix", suffix, SUFFIXES)
    K = controller_of(controller, any_time=True)
    check_scales(K)
    if not np.isnan(K.dt):
        nonnegative("controller: its sampling time", K.dt)
    if K.state_labels and len(K.state_labels) != len(K.A):
        raise ValueError(
            f"controller: expected a name for each of {len(K.A)} states, got {len(K.state_labels)}: some are there twice"
        )
    if sample_time is not None:
        step = positive("sample_time", sample_time)
        if K.dt == 0.0:
            from boomctl.synthesis.discretise import discretize  # with python-control, for those who sample

            K = of(discretize(K.statespace("controller"), step), any_time=True)
        elif K.dt != step:
            raise ValueError(f"sample_time = {step:g} s: the controller's own is {K.dt:g} s; expected that or None")
    notes = ControllerMetadata(
        _units(K, mapping("units", {} if units is None else units, "signals to units")),
        _plain(getattr(controller, "certificate", None) if certificate is None else certificate),
        {"boomctl": __version__, **mapping("provenance", {} if provenance is None else provenance, "names to values")},
    )
    if suffix == ".c":
        if K.dt == 0.0 or np.isnan(K.dt):
            raise ValueError(f"{name}.c: expected sample_time [s] for C code of a continuous-time controller")
        force = per_signal("control_limit", control_limit, K.output_labels)
        rate = per_signal("rate_limit", rate_limit, K.output_labels) * K.dt
        L = correction((K,), force, rate)[0] if truth("anti_windup", anti_windup) else np.zeros((len(K.A), len(K.C)))
        return {**c_files(name, RunningController(K, L, force, rate), notes.units)}
    if control_limit is not None or rate_limit is not None:
        raise ValueError(
            f"{name}{suffix}: limits are written to C files alone; expected neither control_limit nor rate_limit"
        )
    if suffix == ".mat":
        return matlab_files(name, K, notes.units)
    return {f"{name}.json": json_text(_record(name, K, notes))}


def read_controller(path: str | Path) -> "control.StateSpace":
    """Read a controller from a ``.json`` or ``.mat`` file of :func:`write_controller`.

    Parameters
    ----------
    path : str or Path
        The ``.json`` or ``.mat`` file.

    Returns
    -------
    control.StateSpace
        Controller ``u = K y`` with all names.

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        If the file is invalid; the message names the defect.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> import tempfile
    >>> from pathlib import Path
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0, inputs="stroke", outputs="force")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = bc.write_controller(lag, Path(folder) / "lag.json")
    ...     again = bc.read_controller(written[0])
    >>> again.input_labels, again.A
    (['stroke'], array([[-2.]]))
    """
    file = checked_path("path", path)
    return _read(file)[0].statespace(file.stem.replace(".", "_"))  # python-control allows no dots in names


def read_controller_metadata(path: str | Path) -> ControllerMetadata:
    """Read units, certificate and provenance from a ``.json`` controller file.

    Parameters
    ----------
    path : str or Path
        A ``.json`` file of :func:`write_controller`.

    Returns
    -------
    ControllerMetadata
        Units, certificate and provenance.

    Raises
    ------
    OSError, TypeError, ValueError
        As for :func:`read_controller`.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> import tempfile
    >>> from pathlib import Path
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0, inputs="stroke", outputs="force")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = bc.write_controller(lag, Path(folder) / "lag.json", units={"stroke": "m", "force": "N"})
    ...     notes = bc.exchange.read_controller_metadata(written[0])
    >>> notes.units
    {'stroke': 'm', 'force': 'N'}
    """
    return _read(checked_path("path", path))[1]


def _read(file: Path) -> tuple[Lti, ControllerMetadata]:
    known("suffix", file.suffix, (".json", ".mat"))
    held = read_matlab(file) if file.suffix == ".mat" else _read_json(file)
    try:
        units, certificate, provenance = (
            mapping(key, held.get(key, {}), "entries by name") for key in ("units", "certificate", "provenance")
        )
        if not all(isinstance(unit, str) for unit in units.values()):
            raise TypeError(f"units = {shown(units)}: expected texts by name of signal")
        return checked_controller(held), ControllerMetadata(units, certificate, provenance)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{file}: a controller is not complete there: {type(error).__name__} {error}") from None


def _read_json(file: Path) -> dict[str, Any]:
    try:
        held = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:  # of JSON, of UTF-8, and of whole numbers too long to be read
        raise ValueError(f"{file}: not a JSON file: {error}") from None
    except RecursionError:
        raise ValueError(f"{file}: lists or objects are nested too deep; expected a few levels") from None
    if not isinstance(held, dict) or held.get("format") != _FORMAT:
        raise ValueError(f"{file}: expected a file of write_controller, whose format is {_FORMAT!r}")
    if held.get("version") != _VERSION:
        raise ValueError(f"{file}: its version is {shown(held.get('version'))}; expected {_VERSION}")
    return held


def _units(K: Lti, units: Mapping[str, str]) -> dict[str, str]:
    for name in units:
        known("signal", name, (*K.input_labels, *K.output_labels))
    result = {}
    for name in (*K.input_labels, *K.output_labels):
        rate = next((unit for ending, unit in _RATES.items() if ending in name), None)
        stem = next((unit for start, unit in _UNITS.items() if name.startswith(start)), "")
        result[name] = str(units.get(name, half_unit(rate or stem, name)))
    return result


def _record(name: str, K: Lti, notes: ControllerMetadata) -> dict[str, Any]:
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "name": name,
        "law": "u = K y; y: inputs, u: outputs",
        "sample_time": True if np.isnan(K.dt) else K.dt,
        "inputs": list(K.input_labels),
        "outputs": list(K.output_labels),
        "states": list(K.state_labels) or [f"x{i}" for i in range(len(K.A))],
        **vars(notes),
        **{letter: getattr(K, letter) for letter in "ABCD"},
    }


def _plain(certificate: object) -> dict[str, Any]:
    """Return the numbers and strings of a certificate, nested ones included."""
    if certificate is None:
        return {}
    if isinstance(certificate, Mapping):
        return dict(certificate)
    if not is_dataclass(certificate) or isinstance(certificate, type):
        raise TypeError(f"certificate: expected a certificate or a mapping, got {type(certificate).__name__}")
    result: dict[str, Any] = {}
    for entry in fields(certificate):
        value = getattr(certificate, entry.name)
        if is_dataclass(value) and not isinstance(value, type):
            result[entry.name] = _plain(value)
            continue
        items = value if isinstance(value, (tuple, list)) else (value,)
        if all(item is None or isinstance(item, (bool, int, float, str, np.generic)) for item in items):
            result[entry.name] = value
    return result


def checked_controller(held: Mapping[str, Any]) -> Lti:
    """Return the controller with the matrices, names and sample time of a file.

    Parameters
    ----------
    held : mapping
        ``A, B, C, D``: arrays of numbers, or lists of rows; ``inputs, outputs, states``: lists of names;
        ``sample_time``: a number [s], 0 for continuous time, or True if unspecified.

    Raises
    ------
    KeyError
        If an entry is missing.
    TypeError, ValueError
        If an entry is invalid.
    """
    inputs, outputs, states = (_names(kind, held[kind]) for kind in ("inputs", "outputs", "states"))
    n, m, p = len(states), len(inputs), len(outputs)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    A, B, C, D = (_matrix(letter, held[letter], shape) for letter, shape in shapes.items())
    time = held["sample_time"]
    return Lti(A, B, C, D, inputs, outputs, states, np.nan if time is True else nonnegative("sample_time", time))


def _names(kind: str, names: object) -> tuple[str, ...]:
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise TypeError(f"{kind} = {shown(names)}: expected a list of names")
    if len({name.replace(".", "_") for name in names}) < len(names):  # python-control allows no dots
        raise ValueError(f"{kind} = {shown(names)}: expected names that are there once")
    return tuple(names)


def _matrix(letter: str, rows: object, shape: tuple[int, int]) -> Array:
    """Return a matrix of numbers; lists are checked, because NumPy converts strings and booleans to numbers."""
    if isinstance(rows, np.ndarray) and rows.dtype.kind in "iuf":
        rows = rows.tolist() if rows.size else [[] for _ in range(shape[0])]
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
        raise TypeError(f"{letter} = {shown(rows)}: expected a list of rows of numbers")
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        result = f"{len(rows)} of {' or '.join(map(str, sorted({len(row) for row in rows}))) or 0}"
        raise ValueError(f"{letter}: expected {shape[0]} rows of {shape[1]} numbers, as there are names, got {result}")
    for value in (value for row in rows for value in row):
        if type(value) not in (int, float) or not -_LARGEST <= value <= _LARGEST:
            raise ValueError(f"expected finite numbers in {letter}, got {shown(value)}")
    return np.array(rows, dtype=float).reshape(shape)
