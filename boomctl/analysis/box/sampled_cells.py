"""Proofs over cells of parameters for sampled loops: small gain, with the norm between samples.

In a cell what the parameters add to the equations of motion is a feedback ``w = d z``, ``|d| <= 1``, around the loop at the
middle of the cell: a change ``r L diag(s) L^T`` of the mass, damping or stiffness matrix, ``r`` half the width of the cell,
takes ``z = r s L^T q''`` (or ``q'``, or ``q``) and gives ``-L w``, in continuous time.  If the loop is stable at the middle
and its largest gain from all ``w`` to all ``z``, between samples included, is below one, it is stable for every ``d``.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from boomctl.analysis.box.loop_pencil import closed_pencil
from boomctl.analysis.box.zero_exclusion import Cell, CellProof
from boomctl.analysis.loops import joined
from boomctl.analysis.sampled_loops.sampled_norm import SampledLoop, Signals
from boomctl.arrays import Array
from boomctl.lti.modal import sides
from boomctl.lti.system import Lti, rates_of
from boomctl.structure.families import AffineFamily
from boomctl.structure.matrices import dense

_PARTS = 4  # of a sample, for gains that scale signals and choose what is halved next
_HIGH = 1e3  # a level far above the gains of any box, at which only the place of a peak is asked
_RANK = 1e-12  # share of the largest eigenvalue of a change below which one is rounding


@dataclass(frozen=True)
class SampledBox:
    """A family of structures under a sampled controller.

    Attributes
    ----------
    family : AffineFamily
        Between the controller's signals, all of them there.
    parts : tuple of (int, int, ndarray, ndarray)
        For each parameter and each of ``M, C, K`` that it changes: which, the derivative, ``L`` and signs ``s`` of
        ``L diag(s) L^T``.
    controller : Lti
    delay : float
        Between a sample and the moment its control acts [s].
    scale : (k,) ndarray
        By what the signals ``z`` of each parameter are divided, and its ``w`` multiplied.
    peaks : tuple of float
        Frequencies at which each parameter alone makes its largest gain [rad/s].
    """

    family: AffineFamily
    parts: tuple[tuple[int, int, Array, Array], ...]
    controller: Lti
    delay: float
    scale: Array
    peaks: tuple[float, ...] = ()

    @classmethod
    def of(cls, family: AffineFamily, controller: Lti, delay: float) -> "SampledBox":
        """Return the box of a family.

        Raises
        ------
        ValueError
            Controls whose columns change with a parameter.
        """
        parts = []
        controls = [family.centre.inputs.index(name) for name in controller.outputs]
        if any(slope.B[..., controls].any() for slope in family.slopes):
            raise ValueError("family: expected controls that act alike over the whole box under a sampled controller")
        for k, slope in enumerate(family.slopes):
            for derivative, matrix in ((2, slope.M), (1, slope.C), (0, slope.K)):
                values, vectors = linalg.eigh(dense(matrix))
                there = np.abs(values) > _RANK * np.abs(values).max(initial=0.0)
                if there.any():
                    L = vectors[:, there] * np.sqrt(np.abs(values[there]))
                    parts.append((k, derivative, L, np.sign(values[there])))
        return cls(family, tuple(parts), controller, delay, np.ones(family.size)).scaled()

    def rate(self, delta: Array) -> float:
        """Return the slowest rate of the loop at a point of the box [rad/s]; it is stable where this is below zero."""
        closed = joined(self.family.at(delta), self.controller, self.delay).system.balanced()
        return float(rates_of(closed.poles, closed.dt).real.max())

    def cells(self) -> list[Cell]:
        """Return the box as one cell."""
        return [Cell(np.zeros(self.family.size), np.ones(self.family.size))]

    def prove(self, cell: Cell) -> CellProof:
        """Return what is known of a cell; to be halved next is the parameter which alone makes the largest gain."""
        loop, owner = self.loop(cell)
        if (sides(loop.at_samples.poles, self.controller.dt) >= 0).any():
            return CellProof(stable=False, proved=False, axis=0)
        if loop.stays_below(1.0):
            return CellProof(stable=True, proved=True, axis=0)
        own = [np.flatnonzero(owner == k) for k in range(self.family.size)]
        alone = [max(loop.only(places, places).gain(omega, _PARTS) for omega in self.peaks) for places in own]
        return CellProof(stable=True, proved=False, axis=int(np.argmax(alone)))

    def scaled(self) -> "SampledBox":
        """Return the box with each parameter's signals so scaled that it moves others as much as they move it.

        At the peaks of each alone, in the middle of the box.
        """
        k = self.family.size
        loop, owner = self.loop(Cell(np.zeros(k), np.ones(k)))
        own = [np.flatnonzero(owner == i) for i in range(k)]
        peaks = tuple(loop.only(places, places).of_level(_HIGH).omega for places in own)
        log = np.zeros(k)
        for i in range(1, k):
            omega = peaks[i]
            there, back = (loop.only(a, b).gain(omega, _PARTS) for a, b in ((own[0], own[i]), (own[i], own[0])))
            if there > 0.0 and back > 0.0:
                log[i] = 0.5 * np.log(there / back)
        return replace(self, scale=np.exp(log), peaks=peaks)

    def loop(self, cell: Cell) -> tuple[SampledLoop, Array]:
        """Return the loop at the middle of a cell, from what its parameters add to what they act on, and whose each is."""
        K = self.controller
        m, p = len(K.C), K.B.shape[1]
        # of a controller that does nothing but show what it drives and reads
        probe = Lti(np.zeros((m + p, m + p)), np.eye(m + p, p, -m), np.eye(m, m + p), np.zeros((m, p)))
        model = self.family.at(cell.middle).select(K.outputs, K.inputs)
        pencil = closed_pencil(model, probe)
        n, q = len(pencil.E) - m - p, model.n
        if pencil.E[n:, :n].any():
            raise ValueError("family: expected outputs that read places or speeds, or accelerations behind a filter")
        side = np.sqrt(cell.reach) * self.scale  # of both sides of a parameter's signals alike, but for its scale
        enter = np.zeros((n, sum(L.shape[1] for _, _, L, _ in self.parts)))
        enter[q : 2 * q] = np.hstack([-side[k] * L for k, _, L, _ in self.parts])
        solved = np.linalg.solve(pencil.E[:n, :n], np.hstack([pencil.A[:n, :n], enter, pencil.A[:n, n : n + m]]))
        A, BD = solved[:, :n], solved[:, n:]
        rows, direct = [], []
        for k, derivative, L, signs in self.parts:
            read = cell.reach[k] / side[k] * signs[:, None] * L.T
            if derivative == 2:
                rows.append(read @ A[q : 2 * q])
                direct.append(read @ BD[q : 2 * q])
            else:
                row = np.zeros((len(read), n))
                row[:, derivative * q : derivative * q + q] = read
                rows.append(row)
                direct.append(np.zeros((len(read), BD.shape[1])))
        C, D = np.vstack([*rows, pencil.A[n + m :, :n]]), np.vstack([*direct, np.zeros((p, BD.shape[1]))])
        count = enter.shape[1]
        w, z = tuple(f"w{k}" for k in range(count)), tuple(f"z{k}" for k in range(count))
        plant = Lti(A, BD, C, D, (*w, *K.outputs), (*z, *K.inputs))
        signals = Signals(list(range(count)), list(range(count, count + m)), list(range(count, count + p)), z)
        owner = np.concatenate([np.full(L.shape[1], k) for k, _, L, _ in self.parts])
        return SampledLoop.of(plant, replace(K, states=()), signals, K.dt, self.delay), owner
