"""Mode shapes: vibration of a machine in its undamped modes, drawn with the interpolation of its elements."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, whole
from boomctl.printing import listed
from boomctl.structure.matrices import Structure
from boomctl.structure.response.modes import undamped_modes

_KINDS = {1: "jolt", -1: "yaw", 0: ""}  # of symmetric and antisymmetric motion, and of others


@dataclass(frozen=True)
class BodyShape:
    """Motion of a body in each mode.

    Attributes
    ----------
    name : str
        Name of the body.
    is_beam : bool
        True for a beam.
    points : (k, 2) ndarray
        Positions of its points at rest [m].
    displacement : (modes, k, 2) ndarray
        Displacements of the points in each mass-normalized mode [m].

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.spray_boom().mode_shapes(3)["boom"]
    BodyShape: beam 'boom', 61 points, 3 modes
    """

    name: str
    is_beam: bool
    points: Array
    displacement: Array

    def __repr__(self) -> str:
        kind = "beam" if self.is_beam else "rigid body"
        return f"BodyShape: {kind} {self.name!r}, {len(self.points)} points, {len(self.displacement)} modes"


@dataclass(frozen=True)
class ModeShapes:
    """Undamped modes of a structure and their shapes.

    Attributes
    ----------
    eigenfrequencies_hz : (k,) ndarray
        Undamped natural frequencies, ascending [Hz]; 0 for rigid-body motions.
    shapes : (n, k) ndarray
        Mass-normalized shapes over the coordinates, one column per mode: ``shapes.T @ M @ shapes`` is the unit matrix.
    coordinates : tuple of str
        Names of the coordinates.
    kinds : tuple of str
        Kind: "jolt" (symmetric) or "yaw" (antisymmetric) of a symmetric machine, "bending" or "axial" of a hub-beam,
        otherwise "".
    bodies : tuple of BodyShape
        The bodies; empty for a model defined by matrices.

    Examples
    --------
    >>> import boomctl as bc
    >>> shapes = bc.spray_boom().mode_shapes(3)
    >>> shapes
    ModeShapes: 1: yaw, 0.245 Hz, 2: jolt, 0.5825 Hz, 3: jolt, 0.9588 Hz
      undamped, of platform, cradle, boom, stiff_middle
    >>> shapes["boom"].displacement.shape  # modes, points, x and y
    (3, 61, 2)
    """

    eigenfrequencies_hz: Array
    shapes: Array = field(repr=False)
    coordinates: tuple[str, ...] = field(repr=False)
    kinds: tuple[str, ...]
    bodies: tuple[BodyShape, ...] = field(repr=False)

    def __repr__(self) -> str:
        bodies = listed([line.name for line in self.bodies]) if self.bodies else "coordinates without places"
        return f"ModeShapes: {listed(self.names, 84)}\n  undamped, of {bodies}"

    def __getitem__(self, body: str) -> BodyShape:
        """Return how a body moves, by its name."""
        names = [line.name for line in self.bodies]
        return self.bodies[names.index(known("body", body, names))]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return [line.name for line in self.bodies]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the modes: number, kind and frequency; rigid-body motions have no number."""
        return tuple(
            f"{number or 'rigid'}: {f'{kind}, ' if kind else ''}{frequency:.4g} Hz"
            for number, kind, frequency in zip(self.numbers, self.kinds, self.eigenfrequencies_hz, strict=True)
        )

    @property
    def numbers(self) -> tuple[int, ...]:
        """Number of each mode, from 1, as in ``eigenfrequencies_hz``; 0 for rigid-body motions, which come first."""
        rigid = int((self.eigenfrequencies_hz == 0.0).sum())
        return tuple(max(0, k + 1 - rigid) for k in range(len(self.kinds)))

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw each mode: displaced bodies, each plot to a separate scale; without positions, the coordinates as bars.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            One axes per mode.  If None, a new figure is created.
        **style
            Line properties of the beams, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.mode_shapes").plot_mode_shapes(self, ax, **style)


def mode_shapes(structure: Structure, count: int) -> ModeShapes:
    """Return the lowest undamped modes; of a symmetric structure by subsystem, so that modes of equal frequency do not mix.

    Raises
    ------
    TypeError, ValueError
        If ``count`` is not a whole number up to that of the coordinates, or if the matrices have no real modes.
    """
    wanted = whole("count", count, most=structure.n)
    parity = 0 if structure.outline is None else structure.outline.parity
    subsystems = {parity: (np.eye(structure.n), structure)} if structure.mirror is None else structure.halves
    modes = [undamped_modes(half, min(wanted, half.n)) for _, half in subsystems.values()]
    frequencies = np.concatenate([part[0] for part in modes])
    shapes = np.hstack([P @ part[1] for (P, _), part in zip(subsystems.values(), modes, strict=True)])
    kinds = [_KINDS[parity] for parity, part in zip(subsystems, modes, strict=True) for _ in part[0]]
    order = np.argsort(frequencies, kind="stable")[:wanted]
    shapes = signed(shapes[:, order])
    lines = () if structure.outline is None else structure.outline.moved(shapes)
    return ModeShapes(
        frequencies[order] / (2.0 * np.pi),
        shapes,
        structure.coordinates,
        tuple(kinds[k] for k in order),
        tuple(BodyShape(line.name, line.is_beam, line.points, moved) for line, moved in lines),
    )


def signed(shapes: Array) -> Array:
    """Return shapes whose largest entry is positive: the sign of a mode is arbitrary, but reproducible."""
    largest = np.take_along_axis(shapes, np.abs(shapes).argmax(axis=0)[None], axis=0)
    return shapes * np.where(largest < 0.0, -1.0, 1.0)
