"""Riccati equations with solutions in closed form, after the CAREX collection (Benner, Laub & Mehrmann 1995)."""

from dataclasses import dataclass

import numpy as np

__all__ = ["CASES", "Case"]


@dataclass(frozen=True)
class Case:
    """``A, B, Q, R`` and the stabilizing ``X``."""

    name: str
    A: np.ndarray
    B: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    X: np.ndarray


def _case(name, A, B, Q, R, X):
    return Case(name, *(np.array(matrix, dtype=float) for matrix in (A, B, Q, R, X)))


def _one_strong_mode(e):
    root = np.sqrt(1.0 + e**2)
    low = 1.0 / (2.0 + root)
    X = [[(1.0 + root) / e**2, low], [low, 0.25 * (1.0 - e**2 * low**2)]]
    return _case(f"2.1 ({e:g})", np.diag([1.0, -2.0]), [[e], [0.0]], np.ones((2, 2)), [[1.0]], X)


def _loose_chain(e):
    root = np.sqrt(1.0 + 2.0 * e)
    return _case(f"2.3 ({e:g})", [[0, e], [0, 0]], [[0], [1]], np.eye(2), [[1]], [[root / e, 1.0], [1.0, root]])


def _small_weight(e):
    V = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2.0)
    a = np.array([e + 2.0, e])
    X = V * (a + np.sqrt(a**2 + e**2)) @ V.T
    return _case(f"2.4 ({e:g})", [[e + 1, 1], [1, e + 1]], np.eye(2), e**2 * np.eye(2), np.eye(2), X)


def _spread(e):
    V = np.eye(3) - 2.0 / 3.0 * np.ones((3, 3))
    a, q = e * np.array([1.0, 2.0, 3.0]), np.array([1.0 / e, 1.0, e])
    X = V * (e * (a + np.sqrt(a**2 + q / e))) @ V
    return _case(f"2.6 ({e:g})", V * a @ V, np.eye(3) / np.sqrt(e), V * q @ V, np.eye(3), X)


def _scalar(a, b, q, r):
    x = r / b**2 * (a + np.sqrt(a**2 + b**2 * q / r))
    return _case(f"scalar ({a:g}, {b:g}, {q:g}, {r:g})", [[a]], [[b]], [[q]], [[r]], [[x]])


CASES = (
    _case("1.1", [[0, 1], [0, 0]], [[0], [1]], np.diag([1.0, 2.0]), [[1]], [[2, 1], [1, 2]]),
    _case(
        "1.2",
        [[4, 3], [-4.5, -3.5]],
        [[1], [-1]],
        [[9, 6], [6, 4]],
        [[1]],
        (1.0 + np.sqrt(2.0)) * np.array([[9, 6], [6, 4]]),
    ),
    *(_one_strong_mode(e) for e in (1.0, 1e-3, 1e-6)),
    *(_loose_chain(e) for e in (1.0, 1e-6, 1e6)),
    *(_small_weight(e) for e in (1.0, 1e-3, 1e-7)),
    *(_spread(e) for e in (1.0, 1e3, 1e6)),
    *(_scalar(*numbers) for numbers in ((0, 1, 1, 1), (3, 2, 0, 5), (-1, 1e-3, 1e6, 1e-2), (1e-6, 1, 1e-12, 1))),
)
