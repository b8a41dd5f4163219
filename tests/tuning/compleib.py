"""The plants of COMPleib that tuning is tested on: those the collection prints, from its own numbers.

Four plants are in data files of the collection that are not text.  They come from ``controlgym``, where it is installed,
which numbers them anew and keeps four decimals of them; their rows say so.
"""

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.files import read_toml
from boomctl.lti.python_control import control

_FILE = Path(__file__).parent / "plants.toml"
_ROD_POINTS = 130  # of the heat flow HF1, as in the collection
# names in controlgym: a B767 aircraft at flutter, a binary distillation tower, a cable with a mass
_RENUMBERED = {"AC10": "ac7", "BDT2": "bdt2", "CM3": "cm3"}
_ROUNDED = "cut to four decimals by controlgym"


@dataclass(frozen=True)
class BenchmarkPlant:
    """A generalised plant of the collection.

    Attributes
    ----------
    P : control.StateSpace
        Disturbances and controls to performance signals and measurements.
    nmeas, ncon : int
        Numbers of measurements and controls.
    data : str
        Empty where the numbers are the collection's own, otherwise what was done to them.
    """

    P: control.StateSpace
    nmeas: int
    ncon: int
    data: str = ""


def plant_names() -> tuple[str, ...]:
    """Return the names of all plants that are there: those of controlgym where it is installed."""
    return (*_printed(), "HF1", *(name for name in _RENUMBERED if _gym_file(name) is not None))


def plant(name: str) -> BenchmarkPlant:
    """Return a plant by its name in COMPleib.

    Raises
    ------
    ValueError
        No such plant, or none without controlgym.
    """
    if name == "HF1":
        return _generalised(_rod())
    if name in _RENUMBERED:
        path = _gym_file(name)
        if path is None:
            raise ValueError(f"plant {name!r}: its numbers come with controlgym, which is not installed")
        from scipy import io

        found = {
            key: value for key, value in io.loadmat(path).items() if key in ("A", "B1", "C1", "C", "D11", "D12", "D21")
        }
        return _generalised(found | {"B": io.loadmat(path)["B2"]}, _ROUNDED)
    if name not in _printed():
        raise ValueError(f"plant {name!r}: expected one of {', '.join(plant_names())}")
    return _generalised(_printed()[name])


@cache
def _printed() -> dict[str, dict[str, Any]]:
    return read_toml(_FILE)


def _gym_file(name: str) -> Path | None:
    """Return the data file of a plant in controlgym, whose import would bring much along that is not wanted."""
    found = find_spec("controlgym")
    if found is None or found.origin is None:
        return None
    path = Path(found.origin).parent / "envs" / "linear_control_src" / f"{_RENUMBERED[name]}.mat"
    return path if path.is_file() else None


def _generalised(found: dict[str, Any], data: str = "") -> BenchmarkPlant:
    """Return the plant of some matrices; those that are not there follow the collection's rules."""
    have = {key: np.asarray(value, dtype=float) for key, value in found.items() if key not in ("about", "source")}
    A, B, C = have["A"], have["B"], have["C"]
    n, ncon = B.shape
    if "B1" not in have:
        have |= {"B1": np.eye(n), "C1": np.eye(n), "D12": np.vstack([np.zeros((n - ncon, ncon)), np.eye(ncon)])}
    B1, C1 = have["B1"], have["C1"]
    nw, nz, nmeas = B1.shape[1], len(C1), len(C)
    D11, D12, D21 = (
        have.get(key, np.zeros(shape)) for key, shape in (("D11", (nz, nw)), ("D12", (nz, ncon)), ("D21", (nmeas, nw)))
    )
    D = np.block([[D11, D12], [D21, np.zeros((nmeas, ncon))]])
    P = control.ss(A, np.hstack([B1, B]), np.vstack([C1, C]), D)
    return BenchmarkPlant(P, nmeas, ncon, data)


def _rod() -> dict[str, Array]:
    """Return differences of second order along a rod, insulated at one end; at the other enter heat and control.

    A. S. Hodel, K. P. Poolla and B. Tenison, "Numerical solution of the Lyapunov equation by approximate power iteration",
    Linear Algebra and its Applications 236, 1996.
    """
    n = _ROD_POINTS
    A = np.diag(np.full(n, -2.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    A[0, 0] = -1.0
    B, C = np.zeros((n, 1)), np.zeros((2, n))
    B[-1] = n + 1.0
    C[0, 0] = C[1, n // 2 - 1] = 1.0
    return {"A": (n + 1.0) * A, "B": B, "C": C, "B1": B, "C1": C, "D12": np.array([[0.0], [1.0]])}
