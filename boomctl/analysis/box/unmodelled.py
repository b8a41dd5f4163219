"""Loops around what a family does not model: stable dynamics beside it, bounded over frequency (small gain).

The plants are ``G + D`` with ``G`` of the family and a stable ``D``, each entry below that of a bound, ``|D_ij| <= |W_ij|``
at all frequencies.  The loop ``u = K y`` is stable for all of them if it is stable without ``D``, and the gain from what each
entry adds to an output, weighed by ``W_ij``, to the control that drives the entry, is below one (Zhou & Doyle, Essentials of
Robust Control, ch. 8).  Entries are scaled so that their units do not count.  With one entry the condition is necessary, too.

Of a sampled loop ``D`` is met through the hold and at the samples: all its aliases are below the sum of those of ``W``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.box.points import pattern_search
from boomctl.analysis.box.prove import BoxProof, Statement, prove_box
from boomctl.analysis.box.worst_case import driven_parts, hindrance
from boomctl.analysis.loops import injected, joined
from boomctl.analysis.norm import matrices_norm
from boomctl.arrays import Array, balance
from boomctl.checks import known
from boomctl.lti.bilinear import discrete_image, omega_of_image
from boomctl.lti.overbound import MOST, overbound
from boomctl.lti.rounding import CANCELLED
from boomctl.lti.system import Lti, of, series
from boomctl.progress import tell
from boomctl.structure.families import Family, PolynomialFamily, Slope
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control

_POINTS = 2000  # of a sum of aliases, so dense that between two of them it is straight to 1e-3 but near resonances
_STEP = (
    0.1  # of the hyperbolic angle of a distance to a resonance, in half-widths: there it is straight to its square / 8
)
_BETWEEN = 1.01  # times that it is taken to be, for what is between the points
_FROM, _TO = 1e-3, 1e3  # of the slowest pole, of the sampling rate: magnitudes are flat outside (a choice)
_ALIASES = (
    100  # to either side at least (a choice: of a bound that falls as 1/omega they leave 0.2 % of one at that rate)
)
_BEYOND = 10.0  # times the fastest pole that they reach at least; above, a bound falls as it will (a choice)


def small_gain(
    family: Family, K: Lti, unmodelled: control.StateSpace, delay: float, limit: int
) -> tuple[float, Array, BoxProof, str]:
    """Prove that the gain around what a family does not model is below one over the box; ``u = K y`` is stable there.

    Returned are the largest gain met, where, the proof that none reaches one, and why it was given up.

    Raises
    ------
    TypeError, ValueError
        Bounds of another kind, not stable or not of all that the controller reads and drives; of a sampled loop bounds that
        do not fall.
    """
    bounds = _bounds(K, unmodelled)
    unit = np.ones((len(K.input_labels), len(K.output_labels)))
    if unit.size > 1:
        wide, driven, points = _joined(family, K, bounds, unit)
        loop = joined(wide.nominal, driven, delay if K.dt else None).closed(points)
        gains = np.array(
            [[matrices_norm(loop.select(d, u)).lower_bound for d in map(injected, points)] for u in K.output_labels]
        )
        # an entry sees the control that drives it
        item = np.tile(np.eye(len(K.output_labels)), len(K.input_labels)).T @ gains
        unit = balance(item)[1].reshape(unit.shape)
    wide, driven, points = _joined(family, K, bounds, unit)
    inputs = [*map(injected, points)]
    late = delay if K.dt else None

    def loop_at(delta: Array) -> Lti:
        return joined(wide.at(delta), driven, late).closed(points).select(inputs, K.output_labels)

    seen = {}

    def at(delta: Array):
        key = delta.tobytes()
        if key not in seen:
            seen[key] = matrices_norm(loop_at(delta).balanced())
        return seen[key]

    tell("points of the box, with what is not modeled")
    worst, gain, _ = pattern_search(lambda delta: at(delta).lower_bound, family.nparameters, 1.0)
    if gain >= 1.0:
        return gain, worst, BoxProof(False), ""
    tell("loop over the box, with what is not modeled")
    parts, reason = driven_parts(wide, driven, loop_at(np.zeros(family.nparameters)), delay)
    reason = reason or hindrance(parts, at, worst)
    if reason:
        return gain, worst, BoxProof(False), reason

    def met(found: float, point: Array) -> None:
        nonlocal worst, gain
        if found > gain:
            gain, worst = found, point

    def holds(point: Array) -> bool:
        met(at(point).lower_bound, point)
        return at(point).lower_bound < 1.0

    level = Statement(lambda: 1.0 if gain < 1.0 else inf, met, holds, lambda: False)
    result = prove_box(parts, level, limit)
    return gain, worst, result, ""


def _bounds(K: Lti, unmodelled: control.StateSpace) -> list[list[Lti]]:
    """Return the bound of each entry, from what the controller drives to what it reads, as the loop meets it."""
    W = of(unmodelled, "additive_uncertainty", "StateSpace")
    for what, wanted, there in (
        ("input", K.output_labels, W.input_labels),
        ("output", K.input_labels, W.output_labels),
    ):
        for name in wanted:
            known(f"{what} of unmodelled (the controller has it)", name, there)
    if (W.poles.real >= 0.0).any():
        raise ValueError(
            f"additive_uncertainty: expected a stable bound, got a pole with real part {W.poles.real.max():.4g} rad/s"
        )

    def entry(u: str, y: str) -> Lti:
        alone = _without_hidden(W.select(u, y))
        return alone if K.dt == 0.0 else _folded(alone, K.dt, f"from {u} to {y}")

    return [[entry(u, y) for u in K.output_labels] for y in K.input_labels]


def _without_hidden(W: Lti) -> Lti:
    """Return a system without the states that its inputs do not reach or its outputs do not see by any chain of entries."""
    reached, seen = W.B.any(axis=1), W.C.any(axis=0)
    chain = W.A != 0.0
    for _ in range(len(W.A)):
        reached, seen = reached | (chain @ reached), seen | (seen @ chain)
    kept = reached & seen
    return Lti(W.A[np.ix_(kept, kept)], W.B[kept], W.C[:, kept], W.D, dt=W.dt)


def _folded(W: Lti, dt: float, which: str) -> Lti:
    """Return a discrete bound of all that a hold and samples make of anything below a continuous one."""
    if W.D.any():
        raise ValueError(
            f"additive_uncertainty: expected a bound {which} that falls with frequency, got {abs(W.D[0, 0]):.4g} at "
            "infinite frequency,"
            " of which samples fold back more than any bound"
        )
    if not len(W.A):
        return replace(W, dt=dt)
    rates, sampling = np.abs(W.poles), 2.0 * np.pi / dt
    v = np.geomspace(_FROM * min(rates.min(), sampling), _TO * sampling, _POINTS)
    omega = np.unique(np.r_[omega_of_image(v, dt), *(_near(pole, sampling) for pole in W.poles if pole.imag > 0.0)])
    v = 2.0 / dt * np.tan(0.5 * dt * omega)
    aliases = max(_ALIASES, int(np.ceil(_BEYOND * rates.max() / sampling)))
    total = np.zeros(len(omega))
    for k in range(-aliases, aliases + 1):
        there = np.abs(omega + k * sampling)
        total += np.abs(W.response(there)[0, 0]) / (0.5 * dt * there)
    last = (aliases - 0.5) * sampling
    falling = max(last * abs(W.response(np.array([last]))[0, 0, 0]), abs((W.C @ W.B)[0, 0]))  # omega |W| from there on
    total += 2.0 * falling * dt / (np.pi**2 * (aliases - 0.5))  # the sum of 1/k^2 from there on, either side, twice
    size = _BETWEEN * np.abs(np.sin(0.5 * dt * omega)) * total
    return discrete_image(overbound(v, size, min(len(W.A), MOST), 0), dt)


def _near(pole: complex, sampling: float) -> Array:
    """Return frequencies around a resonance as samples see them, denser the nearer [rad/s]."""
    width = -pole.real
    reach = float(np.arcsinh(0.5 * sampling / width))
    around = pole.imag + width * np.sinh(np.linspace(-reach, reach, 2 * int(np.ceil(reach / _STEP)) + 1))
    seen = np.abs((around + 0.5 * sampling) % sampling - 0.5 * sampling)
    return seen[(seen > 0.0) & (seen < 0.5 * sampling * (1.0 - CANCELLED))]


def _joined(
    family: Family, K: Lti, bounds: Sequence[Sequence[Lti]], unit: Array
) -> tuple[Family, Lti, tuple[str, ...]]:
    """Return family, controller and its injection points: one for each entry, whose signal has size one within the bound.

    The injection points are outputs of the family that are zero; the controller weighs what is injected there.  ``unit`` are
    the units of the entries, (p, m); controls are in units in which their size is that of all entries which they drive.
    """
    p, m = unit.shape
    size = np.sqrt(np.square(1.0 / unit).sum(axis=0))
    center, ports = family.nominal, family.nominal.ports
    points = tuple(f"unmodelled {k + 1}" for k in range(p * m))
    share = np.ones(len(ports.inputs))
    share[[ports.inputs.index(name) for name in K.output_labels]] = 1.0 / size

    def wider(X: Array) -> Array:
        return np.pad(X, [(0, 0)] * (X.ndim - 2) + [(0, p * m), (0, 0)]) if X.ndim else X

    wide = replace(
        ports,
        outputs=ports.outputs + points,
        B=ports.B * share,
        L=wider(ports.L),
        E=wider(ports.E * share),
        bandwidths=ports.bandwidths + (None,) * (p * m),
        strains=None if ports.strains is None else ports.strains * share,
        tensions=None if ports.tensions is None else wider(ports.tensions),
    )
    changes = tuple((power, Slope(x.M, x.C, x.K, x.B * share, wider(x.L))) for power, x in family._terms)
    structure = SecondOrderModel.of(center.structure, wide)
    free = tuple(center.coordinates[i] for i in family._unfelt)
    entries = [entry for row in bounds for entry in row]
    rows = np.kron(np.eye(p), np.ones(m)) * unit.ravel()  # which output an entry adds to, in its unit
    A, B, C, D = (linalg.block_diag(*(getattr(entry, x) for entry in entries)) for x in "ABCD")
    none = np.zeros((len(A), p))
    before = Lti(
        A,
        np.hstack([none, B]),
        rows @ C,
        np.hstack([np.eye(p), rows @ D]),
        (*K.input_labels, *points),
        K.input_labels,
        dt=K.dt,
    )
    driven = series(before, replace(K, state_labels=()))
    driven = replace(driven, C=size[:, None] * driven.C, D=size[:, None] * driven.D)
    return PolynomialFamily(family.names, family.low, family.high, structure, changes, free), driven, points
