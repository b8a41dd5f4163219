"""Loops with unmodeled dynamics: stable, additive, and bounded over frequency (small-gain theorem).

The plants are ``G + D`` with ``G`` of the family and a stable ``D``, each entry below that of a bound, ``|D_ij| <= |W_ij|``
at all frequencies.  The loop ``u = K y`` is stable for all of them if it is stable without ``D``, and the gain from the
contribution of each entry to an output, weighted by ``W_ij``, to the control that drives the entry, is below one (Zhou &
Doyle, Essentials of Robust Control, ch. 8): a worst case of the loop with the weights before its controller.  The entries
are scaled by powers of two: their units change the result by less than a factor of two.  With one entry the condition is also
necessary.

In a sampled loop ``D`` acts through the hold and the sampler: its response is a sum of aliases, ``sum_k D(j w_k) h_k``
with ``w_k = w + 2 pi k/dt``.  The squares of the hold's ``|h_k|`` add up to one, so that the response is below
``(sum_k |W(j w_k)|^2)^(1/2)`` (Cauchy & Schwarz): the spectrum at the samples of white noise filtered by ``W``.  This bound
is within a tenth of the least one if ``W`` falls below half the sampling rate; aliases from higher frequencies count fully.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from boomctl.analysis.box.worst_case import WorstCase, worst_case
from boomctl.analysis.loops import injected, joined
from boomctl.analysis.norm import matrices_norm
from boomctl.arrays import Array, balance
from boomctl.checks import known
from boomctl.lti.hold import zero_order_hold
from boomctl.lti.rounding import ALIKE, ROOT, SOLVED
from boomctl.lti.system import Lti, append, of, series
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control


def small_gain(family: Family, K: Any, uncertainty: control.StateSpace, delay: float, max_cells: int) -> WorstCase:
    """Return the largest gain around the unmodeled dynamics of a family, with an upper bound below one if it is proved.

    Raises
    ------
    TypeError, ValueError
        If the weight has an unsupported type, is unstable, or lacks a signal of the controller, or, for a sampled loop, if it
        is not strictly proper.
    """
    bounds = _bounds(K, uncertainty)
    unit = np.ones((len(K.input_labels), len(K.output_labels)))
    if unit.size > 1:
        loop = joined(family.nominal, K, delay if K.dt else None).closed(K.input_labels)
        added = [injected(y) for y in K.input_labels for _ in K.output_labels]
        gains = [
            [matrices_norm(series(W, loop.select(y, u))).lower_bound for y, W in zip(added, bounds, strict=True)]
            for u in K.output_labels
        ]
        # the input of an entry is the control that drives it
        unit = balance(np.tile(np.eye(len(K.output_labels)), len(K.input_labels)).T @ gains)[1].reshape(unit.shape)
    wide, weighed, points = _joined(family, K, bounds, unit)
    signals: Any = [*map(injected, points)], K.output_labels
    worst = partial(worst_case, wide, weighed, *signals, max_cells=max_cells, delay=delay, injection_points=points)
    result, passing = worst(rtol=None), _connected(weighed.select(points, K.output_labels))
    if not (passing.D.any() or len(passing.A)):  # the control does not depend on the dynamics
        return replace(result, upper_bound=0.0, message="")
    if result.lower_bound >= 1.0 - ROOT:
        return result
    # a level of one, or of twice the gain below one half
    return worst(rtol=(1.0 - ALIKE) / max(result.lower_bound, 0.5) - 1.0)


def _bounds(K: Lti, uncertainty: control.StateSpace) -> list[Lti]:
    """Return the bound of each entry from a control to a measurement, minimal, and discrete in a sampled loop."""
    W = of(uncertainty, "additive_uncertainty", "StateSpace")
    for name in K.output_labels:
        known("input of additive_uncertainty (the controller has it)", name, W.input_labels)
    for name in K.input_labels:
        known("output of additive_uncertainty (the controller has it)", name, W.output_labels)
    if (W.poles.real >= 0.0).any():
        raise ValueError(
            f"`additive_uncertainty` must be stable, got a pole with real part {W.poles.real.max():.4g} rad/s."
        )
    result = []
    for y, u in product(K.input_labels, K.output_labels):
        entry = W.select(u, y)
        if K.dt and entry.D.any():
            raise ValueError(
                f"`additive_uncertainty` must fall with frequency from {u} to {y}, got {abs(entry.D[0, 0]):.4g} at infinite"
                " frequency, of which samples fold back more than any bound. Multiply it by a low-pass filter."
            )
        entry = _connected(entry)
        result.append(_folded(entry, K.dt) if K.dt else entry)
    return result


def _connected(system: Lti) -> Lti:
    """Return a system without the states that no input reaches or no output depends on, by entries that are zero."""
    reachable, observable, chain = system.B.any(axis=1), system.C.any(axis=0), system.A != 0.0
    for _ in range(len(chain)):
        reachable, observable = reachable | (chain @ reachable), observable | (observable @ chain)
    own = np.flatnonzero(reachable & observable)
    return Lti(system.A[np.ix_(own, own)], system.B[own], system.C[:, own], system.D)


def _folded(W: Lti, dt: float) -> Lti:
    """Return a discrete bound of the sampled response, through a hold, of anything bounded by a strictly proper weight.

    It has one input for each state, whose squared gains add up: the noise that drives the states from sample to sample,
    with the covariance ``P - Phi P Phi^T``.
    """
    W = W.balanced()
    P = linalg.solve_continuous_lyapunov(W.A, -W.B @ W.B.T)
    size = np.sqrt(np.diag(P))
    Phi, _ = zero_order_hold(W.A, W.B, dt)
    Phi, P = Phi * size / size[:, None], P / np.outer(size, size)
    squares, V = np.linalg.eigh(P - Phi @ P @ Phi.T)
    B = V * np.sqrt(dt * (np.maximum(squares, 0.0) + SOLVED))  # rounding of unit variances
    return Lti(Phi, B, W.C * size, np.zeros((1, len(B))), dt=dt)


def _joined(family: Family, K: Lti, bounds: Sequence[Lti], unit: Array) -> tuple[Family, Lti, tuple[str, ...]]:
    """Return family, controller and injection points of the entries, whose signals have magnitude one within their bounds.

    The injection points are outputs of the family that are zero; the controller weights the signals injected there.  ``unit``
    are the units of the entries, (p, m); the magnitude of a control is that of all entries it drives.
    """
    (p, m), ports = unit.shape, family.nominal.ports
    size = np.sqrt(np.square(1.0 / unit).sum(axis=0))
    entries = append(*bounds)
    names = tuple(f"unmodeled {k + 1}" for k in range(entries.B.shape[1]))
    into, out_of = np.eye(len(ports.inputs)), np.eye(len(ports.outputs), len(ports.outputs) + len(names))
    for name, own in zip(K.output_labels, size, strict=True):
        into[:, ports.inputs.index(name)] /= own
    wide = ports.mixed(np.eye(len(ports.L[0].T)), (into, ports.inputs), (out_of, ports.outputs + names))
    wide = replace(wide, bandwidths=ports.bandwidths + (None,) * len(names))
    changes = tuple((power, replace(x, B=x.B @ into, L=out_of.T @ x.L)) for power, x in family.coefficients)
    plants = replace(family, nominal=SecondOrderModel.of(family.nominal.structure, wide), coefficients=changes)
    rows = np.kron(np.eye(p), np.ones(m)) * unit.ravel()  # which output an entry adds to, in its unit
    B, D = np.hstack([np.zeros((len(entries.A), p)), entries.B]), np.hstack([np.eye(p), rows @ entries.D])
    weights = Lti(entries.A, B, rows @ entries.C, D, (*K.input_labels, *names), K.input_labels, dt=K.dt)
    weighed = series(weights, replace(K, C=size[:, None] * K.C, D=size[:, None] * K.D, state_labels=()))
    return plants, weighed, names
