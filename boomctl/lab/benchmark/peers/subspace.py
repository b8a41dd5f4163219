"""Subspace identification: SLICOT's MOESP and N4SID, by ``ctrlsys``."""

from importlib import import_module

import numpy as np

from boomctl.arrays import Array


def subspace_frequencies(method: str, order: int, u: Array, y: Array, step: float) -> Array:
    """Return the damped frequencies [Hz] of the stable poles of a model of a record, by "MOESP" or "N4SID".

    Parameters
    ----------
    method : str
    order : int
        Of the model; the block rows are the fewest.
    u, y : ndarray
        Inputs (samples, inputs) and outputs (samples, outputs).
    step : float
        Between samples [s].
    """
    slicot, rows, (m, p) = import_module("ctrlsys"), order + 1, (u.shape[1], y.shape[1])
    copies = (np.array(x, order="F") for x in (u, y))  # which are written over
    _, R, *_ = slicot.ib01ad(method[0], "C", "N", "O", "N", "N", rows, m, p, *copies, 0.0, -1.0)
    poles = np.linalg.eigvals(slicot.ib01bd(method[0], "C", "N", rows, order, m, p, len(u), R, 0.0)[0]).astype(complex)
    hz = np.log(poles[np.abs(poles) < 1.0]).imag / (2.0 * np.pi * step)
    return hz[hz > 0.0]
