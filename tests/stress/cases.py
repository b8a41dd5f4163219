"""What several files of these tests share: amounts, measures of an error, and small systems."""

import linecache
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import boomctl
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel

_PACKAGE = Path(boomctl.__file__).parent
EPS = float(np.finfo(float).eps)
SCALES = (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)  # by which units are changed
RATES = (1.0, 1e-6, 1e-3, 1e3, 1e6)  # rad/s, of a plant


def over(name, first, *others):
    """Return the decorator that tries a test over some values of a parameter; in quick runs the first alone."""
    return pytest.mark.parametrize(name, [first, *(pytest.param(value, marks=pytest.mark.slow) for value in others)])


def over_each(*rows):
    """Return the decorator that tries a test over functions, each with some values; in quick runs the first value alone."""
    slow = pytest.mark.slow
    cases = [pytest.param(row[0], value, marks=slow if k else ()) for row in rows for k, value in enumerate(row[1:])]
    return pytest.mark.parametrize(("make", "value"), cases)


def raised_by_boomctl(error):
    """Return whether an error was raised by a statement of this package, for its user: not one of an inner library.

    A library's error has its innermost line elsewhere, or, where the library is compiled, at a line of ours that calls it
    and raises nothing.
    """
    if not isinstance(error, (ValueError, TypeError, RuntimeError, OSError, ArithmeticError)) or not str(error).strip():
        return False
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return False
    file = trace.tb_frame.f_code.co_filename
    raised = linecache.getline(file, trace.tb_lineno).strip()
    return Path(file).is_relative_to(_PACKAGE) and raised.startswith("raise ")


def relative(found, true):
    """Return the largest difference of two arrays over the largest true value; infinite if their shapes differ."""
    a, b = np.asarray(found, dtype=complex), np.asarray(true, dtype=complex)
    if a.shape != b.shape or not np.isfinite(a).all():
        return float("inf")
    scale = float(np.abs(b).max(initial=0.0))
    return float(np.abs(a - b).max(initial=0.0)) / (scale or 1.0)


def each_relative(found, true):
    """Return the largest relative difference of two arrays, value by value."""
    a, b = np.asarray(found, dtype=complex), np.asarray(true, dtype=complex)
    if a.shape != b.shape or not np.isfinite(a).all():
        return float("inf")
    size = np.abs(b)
    return float((np.abs(a - b) / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


def named(A, B, C, D=None, dt=0.0):
    """Return a system of matrices, of inputs ``u0``, ``u1``, ..., outputs ``y0``, ... and states ``x0``, ..."""
    A, B, C = (np.asarray(X, dtype=float) for X in (A, B, C))
    D = np.zeros((len(C), B.shape[1])) if D is None else np.asarray(D, dtype=float)
    counts = (("u", D.shape[1]), ("y", len(D)), ("x", len(A)))
    return Lti(A, B, C, D, *(tuple(f"{letter}{i}" for i in range(n)) for letter, n in counts), dt=dt)


def oscillator(zeta, omega=1.0):
    """Return ``y'' + 2 z w y' + w^2 y = w^2 u``; the states are ``y`` and ``y'/w``."""
    return named([[0.0, omega], [-omega, -2.0 * zeta * omega]], [[0.0], [omega]], [[1.0, 0.0]])


def mass_on_spring(zeta):
    """Return the same for 1 rad/s as a model of a mass, ``u0`` the force on it and ``y0`` its place."""
    return SecondOrderModel([[1.0]], [[2.0 * zeta]], [[1.0]], {"u0": [1.0]}, {"y0": [1.0]})


def repeated_pole(count, rate=1.0):
    """Return ``1/(s/rate + 1)^count``."""
    A = rate * (-np.eye(count) + np.diag(np.ones(count - 1), 1))
    return named(A, rate * np.eye(count)[:, -1:], np.eye(count)[:1])


def static(gain, dt=0.0):
    """Return the controller ``u0 = gain y0``."""
    return Lti(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]]), ("y0",), ("u0",), dt=dt)


def in_other_units(p, powers, unit, scale):
    """Return parameters where a unit of "length", "force" or "time" is ``scale`` times smaller.

    ``powers`` are those of length, force and time in the unit of each parameter.
    """
    k = ("length", "force", "time").index(unit)
    return replace(p, **{name: getattr(p, name) * scale ** float(exponents[k]) for name, exponents in powers.items()})
