"""Channels of a closed loop with objectives and constraints on their norms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from boomctl.analysis.norm import NAMES
from boomctl.checks import instance, known, positive, sequence
from boomctl.printing import listed
from boomctl.synthesis.plants.partition import GeneralizedPlant


@dataclass(frozen=True)
class Channel:
    """Channel of a closed loop, with the requirement on its norm.

    Attributes
    ----------
    inputs, outputs : tuple of str or None
        Disturbances and performance outputs of the generalized plant; if None, all.
    norm : str
        "hinf" or "h2".
    limit : float or None
        Limit of the norm; if None, it is minimized.
    """

    inputs: tuple[str, ...] | None
    outputs: tuple[str, ...] | None
    norm: str
    limit: float | None = None

    def __repr__(self) -> str:
        least = "as small as possible" if self.limit is None else f"at most {self.limit:.6g}"
        return f"Channel: {self.text} {least}"

    @property
    def text(self) -> str:
        """Description of the channel."""
        ends = [listed(signals, 30) if signals else "all" for signals in (self.inputs, self.outputs)]
        where = "" if self.inputs is None and self.outputs is None else f" from {ends[0]} to {ends[1]}"
        return f"{NAMES[self.norm]} norm{where}"


def listed_names(what: str, labels: object) -> tuple[str, ...]:
    """Return the labels of signals, at least one."""
    result = (labels,) if isinstance(labels, str) else sequence(f"{what}s", labels, "names")
    if not result:
        raise ValueError(f"`{what}s` must have at least one name, got none.")
    return tuple(instance(what, name, str) for name in result)


def objective(
    inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None, norm: str = "hinf"
) -> Channel:
    """Return a channel whose norm is minimized; of several channels, the largest norm.

    Parameters
    ----------
    inputs, outputs : str or sequence of str, optional
        Disturbances and performance signals of the generalized plant; by default all.
    norm : {"hinf", "h2"}
        Largest singular value over frequency, or RMS of the outputs to white noise.

    Returns
    -------
    Channel
        For ``bc.tune(..., channels=[...])``.

    Raises
    ------
    TypeError, ValueError
        If there are no names, or the norm is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.objective("w_track", ["z_tip", "z_stroke"])
    Channel: H-infinity norm from w_track to z_tip, z_stroke as small as possible
    """
    disturbed = None if inputs is None else listed_names("input", inputs)
    performance = None if outputs is None else listed_names("output", outputs)
    return Channel(disturbed, performance, known("norm", norm, NAMES))


def constraint(
    inputs: str | Sequence[str] | None, outputs: str | Sequence[str] | None, limit: float, norm: str = "hinf"
) -> Channel:
    """Return a channel whose norm is limited.

    Parameters
    ----------
    inputs, outputs : str or sequence of str, or None
        Disturbances and performance signals of the generalized plant; None: all.
    limit : float
        The largest norm allowed, in the signals' units.
    norm : {"hinf", "h2"}
        Largest singular value over frequency, or RMS of the outputs to white noise.

    Returns
    -------
    Channel
        For ``bc.tune(..., channels=[...])``.

    Raises
    ------
    TypeError, ValueError
        If there are no names, the limit is not positive, or the norm is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.constraint("w_track", "z_force", 12.0, norm="h2")
    Channel: H2 norm from w_track to z_force at most 12
    """
    return replace(objective(inputs, outputs, norm), limit=positive("limit", limit))


def channel_of(plant: GeneralizedPlant, channel: Channel) -> GeneralizedPlant:
    """Return a plant with the disturbances and performance signals of one channel."""
    columns, rows = signal_indices(plant, channel)
    (p, m), (z, w) = plant.system.D.shape, (plant.nz, plant.nw)
    return replace(plant, system=plant.system.between([*columns, *range(w, m)], [*rows, *range(z, p)]))


def signal_indices(plant: GeneralizedPlant, channel: Channel) -> tuple[list[int], list[int]]:
    """Return columns and rows of a channel among disturbances and performance signals."""
    columns = plant.disturbances if channel.inputs is None else channel.inputs
    rows = plant.performance if channel.outputs is None else channel.outputs
    return [plant.disturbances.index(name) for name in columns], [plant.performance.index(name) for name in rows]
