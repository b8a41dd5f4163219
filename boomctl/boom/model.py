"""The spray boom as a machine of rigid bodies, a beam, springs and dampers; compare Fig. 1 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import exactly, finite_array, known, positive, sequence, shown, up_to, whole
from boomctl.structure.assembly import Assembly
from boomctl.structure.beams.elements import MOST_ELEMENTS, DiscreteElements, FiniteElements
from boomctl.structure.displacement_input import prescribe_displacement
from boomctl.structure.layout import CACHE_SIZE
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.parts import (
    GROUND,
    Beam,
    BeamSegment,
    Discretization,
    Force,
    Output,
    RigidBody,
    SpringDamper,
    fixed,
    planar,
    prismatic,
    revolute,
)
from boomctl.structure.symmetry import Mirror, SignalPair, beam_reflection, mirror_of

ACTUATORS = ("actuator_left", "actuator_right")
TIPS = ("tip_left", "tip_right")
DISCRETIZATIONS = ("finite", "high-order", "discrete-hermite", "discrete-geometric")

_PAIRS = (
    *(SignalPair(stem, f"{stem}_right", f"{stem}_left") for stem in ("actuator", "suspension", "tip", "stroke")),
    SignalPair("tip_acceleration", "tip_right_acceleration", "tip_left_acceleration"),
    SignalPair("actuator_force", "actuator_right_force", "actuator_left_force"),
    SignalPair("cradle", "cradle"),
    SignalPair("cradle_slip", "cradle_slip"),
)


def boom_assembly(
    p: BoomParameters,
    discretization: Discretization,
    accelerometer_bandwidth_hz: float | None = None,
    nozzles: Sequence[float] = (),
) -> Assembly:
    """Return the boom as a description: platform, cradle, boom, springs, dampers, forces and outputs.

    Source: Anthonis & Ramon (2003), Fig. 1 and Table 2.
    """
    half, spring, actuator = p.length / 2, p.spring_distance / 2, p.actuator_distance / 2
    tube = BeamSegment(p.length, p.mass_per_length, p.bending_stiffness, p.stiffness_damping)

    platform = RigidBody("platform", GROUND.at(0), planar("y", "theta"), p.platform_mass, p.platform_inertia)
    on_platform = platform.at(0)
    cradle = RigidBody("cradle", on_platform, prismatic(), p.cradle_mass, p.cradle_inertia)
    on_cradle = cradle.at(0)
    boom = Beam("boom", on_cradle, revolute(), (-half, 0.0), (tube,), discretization)
    stiff_middle = RigidBody(
        "stiff_middle",
        boom.at_point(0),
        fixed(),
        max(p.boom_mass - p.tube_mass, 0.0),
        max(p.boom_inertia - p.tube_inertia, 0.0),
    )
    sides = (("left", -1.0), ("right", 1.0))
    tips = [("left", boom.start), ("right", boom.end)]
    springs = [(side, boom.at_point(sign * spring), platform.at(sign * spring)) for side, sign in sides]
    outputs = [Output(f"tip_{side}", tip) for side, tip in tips]
    outputs += [Output(f"stroke_{side}", end, relative_to=base) for side, end, base in springs]
    outputs.append(Output("cradle_slip", on_cradle, relative_to=on_platform))
    if accelerometer_bandwidth_hz is not None:
        band = positive("accelerometer_bandwidth_hz", accelerometer_bandwidth_hz)
        outputs += [Output(f"tip_{side}_acceleration", tip, derivative=2, bandwidth_hz=band) for side, tip in tips]
    outputs += [Output(nozzle_name(i), boom.at_point(x)) for i, x in enumerate(nozzles)]
    return Assembly(
        bodies=(platform, cradle, boom, stiff_middle),
        springs=(
            *(SpringDamper(end, base, "y", p.spring_stiffness) for _, end, base in springs),
            SpringDamper(on_cradle, on_platform, "y", damping=p.cradle_damping),
            SpringDamper(stiff_middle.parent, on_cradle, "theta", damping=p.hinge_damping),
        ),
        forces=(
            *(Force(f"actuator_{side}", platform.at(sign * actuator)) for side, sign in sides),
            *(Force(f"suspension_{side}", end, reaction_point=base) for side, end, base in springs),
            Force("cradle", on_cradle, reaction_point=on_platform),
        ),
        outputs=tuple(outputs),
    )


def boom_model(
    p: BoomParameters,
    mesh: Discretization,
    excitation: str = "displacement",
    *,
    accelerometer_bandwidth_hz: float | None = None,
    reactions: bool = False,
    nozzles: tuple[float, ...] = (),
) -> SecondOrderModel:
    """Return the boom with a beam of the given mesh, whose actuators impose the quantity ``excitation``."""
    model = boom_assembly(p, mesh, accelerometer_bandwidth_hz, nozzles).assemble()
    structure = model.structure.mirrored(boom_mirror(model.coordinates, nozzles))
    model = SecondOrderModel.of(structure, replace(model.ports, primary=(ACTUATORS, TIPS)))
    if excitation == "force":
        return model
    return prescribe_displacement(model, ACTUATORS, motion=excitation, reactions=reactions)


def boom_discretization(
    p: BoomParameters, discretization: str = "finite", elements: int | Sequence[float] | Array = 6, order: int = 12
) -> Discretization:
    """Return the named discretization of the boom; node positions are relative to the hinge."""
    known("discretization", discretization, DISCRETIZATIONS)
    stations: int | tuple[float, ...]
    if isinstance(elements, (int, np.integer)):
        stations = elements if discretization == "finite" else _attached_nodes(p, elements)
    else:
        x, half = _positions("elements", elements, 2), p.length / 2
        if max(abs(x[0] + half), abs(x[-1] - half)) > 1e-9 * half:
            raise ValueError(
                f"`elements` must be node positions from tip to tip, {exactly(-half)} to {exactly(half)} m, got"
                f" {exactly(x[0])} to {exactly(x[-1])} m."
            )
        stations = tuple(x + half)
    if discretization == "finite":
        return FiniteElements(stations)
    if discretization == "high-order":
        return FiniteElements(stations, order)
    return DiscreteElements(stations, "hermite" if discretization == "discrete-hermite" else "lumped")


def _positions(name: str, values: Sequence[float] | Array, least: int) -> Array:
    """Return at least so many ascending positions along the boom."""
    x = finite_array(name, sequence(name, values, "positions"), ndim=1)
    if len(x) < least or not (np.diff(x) > 0.0).all():
        raise ValueError(
            f"`{name}` must have at least {least} positions along the boom, ascending, got {shown(x.tolist())}."
        )
    return x


def _attached_nodes(p: BoomParameters, elements: int) -> tuple[float, ...]:
    """Return stations of ``elements`` elements with nodes at tips, springs and hinge."""
    if whole("elements", elements, most=MOST_ELEMENTS) < 4 or elements % 2:
        raise ValueError(f"elements = {elements}: expected an even number, at least 4, with nodes at springs and hinge")
    inner = 2 if elements < 20 else 4
    outer = (elements - inner) // 2
    half, spring = p.length / 2, p.spring_distance / 2
    left = [k * ((half - spring) / outer) - half for k in range(outer)]
    middle = [k * (2.0 * spring / inner) - spring for k in range(inner)]
    return tuple(x + half for x in (*left, *middle, spring, *(-x for x in reversed(left))))


def nozzle_name(index: int) -> str:
    """Return the output's name of a nozzle, counted from the left from zero."""
    return f"nozzle_{index + 1:02d}"


def checked_nozzles(p: BoomParameters, nozzles: Sequence[float] | Array) -> tuple[float, ...]:
    """Return checked positions of nozzles on the boom."""
    x, half = _positions("nozzles", nozzles, 1), p.length / 2
    if max(-x[0], x[-1]) > half:
        raise ValueError(
            f"`nozzles` must be within {up_to(half)} m of the hinge, got {exactly(x[0])} to {exactly(x[-1])} m."
        )
    return tuple(x.tolist())


def _nozzle_pairs(positions: Sequence[float]) -> tuple[SignalPair, ...]:
    """Return the pairs of nozzles that are mirror images; empty if they are not placed symmetrically."""
    count, x = len(positions), np.asarray(positions)
    if count and np.abs(x + x[::-1]).max() > 1e-9 * np.abs(x).max():
        return ()
    pairs = [SignalPair(nozzle_name(i), nozzle_name(count - 1 - i), nozzle_name(i)) for i in range(count // 2)]
    return (*pairs, SignalPair(nozzle_name(count // 2), nozzle_name(count // 2))) if count % 2 else tuple(pairs)


@lru_cache(maxsize=CACHE_SIZE)
def boom_mirror(coordinates: tuple[str, ...], nozzles: tuple[float, ...] = ()) -> Mirror | None:
    """Return the reflection about the hinge; None where the mesh has no mirror image."""
    images = {
        "platform.y": ("platform.y", 1),
        "platform.theta": ("platform.theta", -1),
        "cradle.slide": ("cradle.slide", 1),
    }
    local = [name.removeprefix("boom.") for name in coordinates if name.startswith("boom.")]
    nodes = 1 + max(int(name[1:]) for name in local if name.startswith("w"))
    reflected = beam_reflection(local, nodes)
    images.update({f"boom.{name}": (f"boom.{image}", sign) for name, (image, sign) in reflected.items()})
    return mirror_of(coordinates, images, (*_PAIRS, *_nozzle_pairs(nozzles)))
