"""Subspace identification as a peer: SLICOT's MOESP and N4SID, by ``ctrlsys``."""

from importlib import import_module

import numpy as np
from scipy import linalg

from boomctl.arrays import Array

Discrete = tuple[Array, Array, Array, Array]
"""A, B, C, D of a model from sample to sample."""


def subspace(method: str, order: int, u: Array, y: Array, band: tuple[float, float]) -> Discrete:
    """Return a stable model of a record (inputs (N, m), outputs (N, p)) by "MOESP" or "N4SID", from fewest block rows.

    A and C are SLICOT's without unstable poles, which records of band-limited inputs give; B and D those of least squares
    in a band (shares of the sampling rate), as ``ib01cd`` of ctrlsys 1.1.1 corrupts memory (order 48, 28 outputs).
    """
    slicot, rows, (m, p) = import_module("ctrlsys"), order + 1, (u.shape[1], y.shape[1])
    given = (np.array(x, order="F") for x in (u, y))  # copies, which are written over
    _, R, *_ = slicot.ib01ad(method[0], "C", "N", "O", "N", "N", rows, m, p, *given, 0.0, -1.0)
    A, C, *_ = slicot.ib01bd(method[0], "C", "N", rows, order, m, p, len(u), R, 0.0)
    T, Q, n = linalg.schur(A, sort="iuc")
    A, C = T[:n, :n], C @ Q[:, :n]
    U, Y, states, free = _spectra(A, C, u, y, band)
    driven = np.einsum("okn,kj->oknj", states, U).reshape(p, len(U), n * m)
    columns = [np.broadcast_to(U, (p, *U.shape)), driven, free, Y.T[:, :, None]]
    R = np.asarray(
        np.linalg.qr(_real(np.concatenate(columns, axis=2)), mode="r")
    )  # of each output: D is its own, B that of all
    shared = R[:, m:, m:].reshape(-1, R.shape[2] - m)
    found = np.linalg.lstsq(shared[:, :-1], shared[:, -1])[0]
    D = np.linalg.solve(R[:, :m, :m], (R[:, :m, -1] - R[:, :m, m:-1] @ found)[:, :, None])[:, :, 0]
    return A, found[: n * m].reshape(n, m), C, D


def unexplained(model: Discrete, u: Array, y: Array, band: tuple[float, float]) -> tuple[Array, Array]:
    """Return the outputs' spectrum in a band, (lines, p), and what is left of it by the best free motion."""
    A, B, C, D = model
    U, Y, states, free = _spectra(A, C, u, y, band)
    left = Y.T - np.einsum("okn,nj,kj->ok", states, B, U, optimize=True) - D @ U.T
    stacked = _real(free).reshape(-1, len(A))
    return Y, (left - free @ np.linalg.lstsq(stacked, _real(left[:, :, None]).ravel())[0]).T


def _spectra(A: Array, C: Array, u: Array, y: Array, band: tuple[float, float]) -> tuple[Array, Array, Array, Array]:
    """Return spectra of inputs and outputs, and what outputs have of driven states and of free ones, (p, lines, n)."""
    share = np.fft.rfftfreq(len(u))
    inside = (share >= band[0]) & (share <= band[1])
    z = np.exp(2j * np.pi * share[inside])[:, None, None]
    states = np.linalg.solve((z * np.eye(len(A)) - A).swapaxes(1, 2), C.T.astype(complex)[None]).transpose(2, 0, 1)
    return np.fft.rfft(u, axis=0)[inside], np.fft.rfft(y, axis=0)[inside], states, states * z[:, 0]


def _real(x: Array) -> Array:
    return np.concatenate([x.real, x.imag], axis=1)
