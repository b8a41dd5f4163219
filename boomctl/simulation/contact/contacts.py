"""Contacts in a plant, and the effect of contact forces over a step."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, positive
from boomctl.lti.rounding import ROOT
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.simulation.plant import ModalPlant, Step

StrokeLimit = float | Mapping[str, "float | tuple[float, str]"] | None

_COARSE = 0.5  # Least velocity at the end of a step by a force, over the one without stiffness, to resolve friction.
_MOST_STOPS = 6  # The cases of touched stops grow as 5 to their number: 15,625 with six.


@dataclass(frozen=True)
class Contact:
    """A relative displacement and the force input that does work on it.

    Attributes
    ----------
    output : str
    position, velocity : (n,) ndarray
        Rows that read displacement and velocity from the states.
    through : (2, inputs) ndarray
        Direct effect of each input on displacement and velocity; its rate adds the first row to the velocity.
    column : (n,) ndarray
        Column of the force in the state equation.
    held : (n,) ndarray
        Effect of a unit force over a full step on the states.
    gain : float
        Effect of a unit force over a full step on the velocity at its end.
    """

    output: str
    position: Array
    velocity: Array
    through: Array
    column: Array
    held: Array
    gain: float

    def offsets(self, W: Array, h: float, per_point: int = 1) -> tuple[Array, Array]:
        """Return the direct effect of disturbances ``W`` (inputs, steps + 1) on displacement and velocity at each step.

        A prescribed displacement must have a continuous rate, or friction could not stick: between the requested times
        (every ``per_point`` steps) it is a cubic, whose rates at the times are the mean of the rates on both sides.
        """
        used = np.flatnonzero(self.through[0])
        if not len(used):
            return self.through[0] @ W, self.through[1] @ W
        values, rates = _smooth(W[used], h, per_point)
        return (
            self.through[0] @ W + self.through[0][used] @ (values - W[used]),
            self.through[1] @ W + self.through[0][used] @ rates,
        )


def _smooth(W: Array, h: float, per_point: int) -> tuple[Array, Array]:
    """Return signals (k, steps + 1) and their rates along cubics between every ``per_point``-th step."""
    H, points = h * per_point, W[:, ::per_point]
    means = np.diff(points, axis=1) / H
    rates = np.hstack([means[:, :1], 0.5 * (means[:, 1:] + means[:, :-1]), means[:, -1:]])
    s, start, end, slope = np.arange(per_point) / per_point, rates[:, :-1, None], rates[:, 1:, None], means[:, :, None]
    bent = H * (slope * (3.0 * s**2 - 2.0 * s**3) + start * (s - 2.0 * s**2 + s**3) + end * (s**3 - s**2))
    value = points[:, :-1, None] + bent
    rate = slope * 6.0 * (s - s**2) + start * (1.0 - 4.0 * s + 3.0 * s**2) + end * (3.0 * s**2 - 2.0 * s)
    return (
        np.hstack([value.reshape(len(W), -1), points[:, -1:]]),
        np.hstack([rate.reshape(len(W), -1), rates[:, -1:]]),
    )


@dataclass(frozen=True)
class Contacts:
    """Friction (law and contact) and stops (contacts and allowed strokes, m)."""

    law: CoulombFriction | None
    slip: Contact | None
    stops: tuple[Contact, ...]
    limits: Array


def contact_at(
    plant: ModalPlant, maps: Step, output: str, force: str, *, driven: tuple[str, ...] = (), least: float = 0.0
) -> Contact:
    """Return the contact of a displacement output with a force input.

    ``least`` is the least velocity at the end of a step by a force, relative to the velocity without stiffness.

    Raises
    ------
    ValueError
        If a name is unknown; the force changes the displacement or its velocity directly (no inertia between them), or not
        at all, or in the opposite direction; a control changes the displacement directly; or the steps are too long for the
        motion.
    """
    o = plant.output_labels.index(known("output of a contact", output, plant.output_labels))
    i = plant.input_labels.index(known("input of a contact", force, plant.input_labels))
    row, column = plant.C[o], plant.B[:, i]
    velocity = row @ plant.A
    through = np.vstack([plant.D[o], row @ plant.B])
    sizes = np.vstack([np.abs(plant.D[o]), np.abs(row) @ np.abs(plant.B)])
    through[np.abs(through) <= ROOT * sizes] = 0.0
    gain, at_once = float(velocity @ maps.held[:, i]), float(velocity @ column)
    if not through[:, i].any() and at_once > 0.0 and gain <= least * at_once * maps.h:
        raise ValueError(
            f"contact at output {output!r} through input {force!r}: the motion there is too fast for steps of {maps.h:g} s"
            " (what a force adds to the velocity is gone before their end); expected finer timepts or more steps"
        )
    if through[:, i].any() or gain <= 0.0:
        why = "there is no inertia between them" if through[:, i].any() else f"a unit force adds {gain:.3g} m/s to it"
        raise ValueError(
            f"contact at output {output!r} through input {force!r}: expected a displacement on which that force does "
            f"work; {why}"
        )
    for name in driven:
        if through[0, plant.input_labels.index(name)]:
            raise ValueError(f"contact at output {output!r}: the control {name!r} moves it at once, in jumps")
    return Contact(
        output=output,
        position=row,
        velocity=velocity,
        through=through,
        column=column,
        held=maps.held[:, i],
        gain=gain,
    )


def parse_stops(limit: StrokeLimit, plant: ModalPlant) -> list[tuple[str, str, float]]:
    """Return output, force input and allowed stroke [m] of each end stop.

    A number applies to all outputs ``stroke_*`` that have an input ``suspension_*`` of the same suffix.
    """
    if limit is None:
        return []
    result: list[tuple[str, str, float]] = []
    if isinstance(limit, Mapping):
        for name, value in limit.items():
            output = known("output of end_stop", name, plant.output_labels)
            pair = value if isinstance(value, tuple) else (value, output.replace("stroke_", "suspension_", 1))
            if len(pair) != 2:
                raise ValueError(f"end_stop[{output!r}] = {value!r}: expected a number or (number, input)")
            size, force = pair
            known(f"input at the stop of {output!r}", force, plant.input_labels)
            result.append((output, force, positive(f"end_stop[{output!r}]", size)))
    else:
        size = positive("end_stop", limit)
        pairs = [(o, o.replace("stroke_", "suspension_", 1)) for o in plant.output_labels if o.startswith("stroke_")]
        result = [(o, i, size) for o, i in pairs if i in plant.input_labels]
    if not result:
        raise ValueError(
            f"end_stop: the plant has no outputs stroke_* with inputs suspension_* of the same suffix (outputs: "
            f"{', '.join(plant.output_labels)}; inputs: {', '.join(plant.input_labels)})"
        )
    if len(result) > _MOST_STOPS:
        raise ValueError(f"end_stop: {len(result)} end stops; expected at most {_MOST_STOPS}")
    return result


def contacts_of(
    plant: ModalPlant,
    maps: Step,
    friction: CoulombFriction | None,
    parsed: list[tuple[str, str, float]],
    driven: tuple[str, ...],
) -> Contacts | None:
    """Return all contacts, ``None`` if there are none."""
    slip = (
        None
        if friction is None
        else contact_at(plant, maps, friction.slip_output, friction.force_input, driven=driven, least=_COARSE)
    )
    stops = tuple(contact_at(plant, maps, output, force, driven=driven) for output, force, _ in parsed)
    if slip is None and not stops:
        return None
    return Contacts(friction, slip, stops, np.array([size for _, _, size in parsed]))
