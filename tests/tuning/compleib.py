"""The plants of COMPleib that tuning is tested on: those the collection prints, from its own numbers.

Three plants are in data files of the collection that are not text.  They come from ``controlgym``, where it is installed,
which numbers them anew and keeps four decimals of them.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.files import read_toml
from boomctl.lti.python_control import control
from tests.test_collections import gym, gym_names

_FILE = Path(__file__).parent / "plants.toml"
_ROD_POINTS = 130  # of the heat flow HF1, as in the collection
# names in controlgym: a B767 aircraft at flutter, a binary distillation tower, a cable with a mass
_RENUMBERED = {"AC10": "ac7", "BDT2": "bdt2", "CM3": "cm3"}

# disturbances and controls to performance signals and measurements, numbers of measurements and controls
BenchmarkPlant = tuple[control.StateSpace, int, int]


def exact_names() -> tuple[str, ...]:
    """Return the names of the plants whose numbers are those of the collection."""
    return (*_printed(), "HF1")


def plant_names() -> tuple[str, ...]:
    """Return the names of all plants that are there: those of controlgym where it is installed."""
    return (*exact_names(), *(name for name, theirs in _RENUMBERED.items() if theirs in gym_names()))


def plant(name: str) -> BenchmarkPlant:
    """Return a plant by its name in COMPleib."""
    if name in _RENUMBERED:
        found = gym(_RENUMBERED[name])
        return found.generalized, len(found.C2), found.B2.shape[1]
    return _generalized(_rod() if name == "HF1" else _printed()[name])


@cache
def _printed() -> dict[str, dict[str, Any]]:
    return read_toml(_FILE)


def _generalized(found: dict[str, Any]) -> BenchmarkPlant:
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
    return P, nmeas, ncon


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
