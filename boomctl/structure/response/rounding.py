"""How much of a frequency response is rounding: the response is computed again with operands shaken by half a digit."""

import numpy as np
from scipy import sparse

from boomctl.arrays import Array
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import evaluate
from boomctl.structure.response.core import Core

_SAMPLES = 24
_EPS = np.finfo(float).eps


def rounding_estimate(model: SecondOrderModel, core: Core, omega: Array) -> float:
    """Return the relative change of the largest output when operands change by one unit in the last place.

    With strain rows it is the strains that are shaken, by the rounding of the displacements they are differences of;
    otherwise the entries of the stiffness matrix.
    """
    V, small = core.basis, core.model
    random = np.random.default_rng(0)
    if model.elastic is not None:
        rows = model.elastic
        strain = rows.R @ V
        noise = _EPS * (abs(rows.R) @ np.abs(V)) * random.uniform(-1, 1, strain.shape)
        change = noise.T @ (rows.k[:, None] * strain)
        change = change + change.T
    else:
        K = sparse.csr_array(model.K)
        shaken = sparse.csr_array((_EPS * K.data * random.uniform(-1, 1, len(K.data)), K.indices, K.indptr), K.shape)
        change = V.T @ ((shaken + shaken.T) @ V)
        diagonal = _EPS * K.diagonal()  # equal elements are rounded alike, so that their errors add up
        aligned = V.T @ (diagonal[:, None] * V)
        change = change + np.where(change < 0, -1.0, 1.0) * np.abs(aligned)
    s = 1j * np.unique(np.quantile(omega, np.linspace(0, 1, _SAMPLES), method="nearest"))
    D = (s**2)[:, None, None] * small.M + s[:, None, None] * small.C + small.K
    B, L, E = evaluate(small.ports.B, s), evaluate(small.ports.L, s), evaluate(small.ports.E, s)
    X = np.linalg.solve(D, B)
    Y = L @ X + E
    moved = L @ np.linalg.solve(D, change @ X)
    size = np.abs(Y).max(axis=1)
    return float((np.abs(moved).max(axis=1)[size > 0] / size[size > 0]).max(initial=0.0))
