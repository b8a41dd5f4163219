"""Beams, machines and the boom: elements, lengths, constraints, frequencies, units, numbers next to zero."""

from dataclasses import fields, replace

import numpy as np
import pytest

from boomctl.boom.exact import exact_eigenfrequencies_hz
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    CutJoint,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SpringDamper,
    fixed,
    planar,
    prescribe_displacement,
    revolute,
)
from boomctl.structure.model import SecondOrderModel
from tests.stress.cases import EPS, RATES, SCALES, each_relative, in_other_units, over, over_each, relative
from tests.stress.references import (
    cantilever_frequencies,
    cantilever_response,
    dense_response,
    pinned_mesh_frequency,
)

P = BoomParameters()


def response(model, omega, inputs=ACTUATORS, outputs=TIPS):
    return np.asarray(model.frequency_response(omega, inputs, outputs).frdata)


@over("count", 10, 1, 100, 190)
def test_pinned_beam_frequency_equals_closed_form(check_error, count):
    """Equal elements; relative error against the mesh's own closed form."""
    part = Beam("beam", GROUND.at(0.0), revolute(), (0.0, 0.0), (BeamSegment(1.0, 1.0, 1.0),), FiniteElements(count))
    model = Assembly((part,), (), (), (), (CutJoint(part.at(1.0), GROUND.at(1.0), ("y",)),)).assemble()
    held = prescribe_displacement(model, hold=list(model.input_labels))
    found = lambda: 2 * np.pi * held.eigenfrequencies_hz(1)  # noqa: E731
    check_error(lambda: each_relative(found(), [pinned_mesh_frequency(count)]), 1e-12 if count <= 100 else 1e-9)


@over("ratio", 1e4, 1.0, 1e2, 1e6)
def test_cantilever_of_unlike_elements_equals_sixty_digits(check_error, ratio):
    """Lengths of neighbors 1 : ratio; relative error of frequencies and responses against sixty digits."""
    nodes = tuple(np.cumsum([0.0, 1.0, 1.0 / ratio, 1.0, 1.0, 1.0 / ratio]).tolist())
    section, omega = BeamSegment(nodes[-1], 1.0, 1.0), [0.0, 0.1, 1.0, 10.0]
    part = Beam("beam", GROUND.at(0.0), fixed(), (0.0, 0.0), (section,), FiniteElements(nodes))
    tip = part.at(nodes[-1])
    model = Assembly((part,), (), (Force("f", tip),), (Output("y", tip),)).assemble()

    def error():
        found = 2 * np.pi * model.eigenfrequencies_hz(3), response(model, omega, ["f"], ["y"])[0, 0]
        true = cantilever_frequencies(nodes)[:3], cantilever_response(nodes, omega)
        return max(map(each_relative, found, true))

    check_error(error, 1e-9, may_refuse=ratio > 1e4)


@over("gap", 1e-3, 1.0, 1e-6, 1e-9, 1e-12, 1e-15)
def test_bar_held_and_moved_near_the_same_place_is_a_lever(check_error, gap):
    """A mass hangs on the bar's end by a spring; relative error against the lever's law."""
    bar = RigidBody("bar", GROUND.at(0.0), planar("y", "theta"), 1.0, 1.0, (0.5, 0.0))
    mass = RigidBody("mass", GROUND.at(1.0), planar("y"), 1.0)
    spring = SpringDamper(bar.at(1.0), mass.at(1.0), "y", 4.0, 0.1)
    forces = (Force("hold", bar.at(0.0)), Force("push", bar.at(gap)))
    model = Assembly((bar, mass), (spring,), forces, (Output("tip", mass.at(1.0)),)).assemble()

    def error():
        moved = prescribe_displacement(model, ["push"], hold=["hold"])
        return relative(response(moved, [1.0], ["push"], ["tip"]), [[[(4.0 + 0.1j) / (3.0 + 0.1j) / gap]]])

    check_error(error, max(1e-12, 8 * EPS / gap), may_refuse=gap < 1e-6)


@over("gap", 1e-3, 1e-8, 1e-12, 1e-14, 0.0)
def test_bar_on_two_hinges_does_not_turn(check_error, gap):
    """Angle under a moment [rad], none; where the hinges fall together, that of the first one alone."""
    bar = RigidBody("bar", GROUND.at(0.0), revolute(), 1.0, 1.0, (0.5, 0.0))
    cut = CutJoint(bar.at(gap), GROUND.at(gap), ("y",))
    ends = (Force("moment", bar.at(0.0), "theta"),), (Output("angle", bar.at(0.0), "theta"),)
    spring = SpringDamper(bar.at(0.0), GROUND.at(0.0), "theta", 1.0, 0.1)

    def error():
        model = Assembly((bar,), (spring,), *ends, (cut,)).assemble()
        held = prescribe_displacement(model, hold=[name for name in model.input_labels if name != "moment"])
        if not held.ncoordinates:
            return 0.0
        found = response(held, [1.0], ["moment"], ["angle"])[0, 0, 0]
        alone = 1.0 / (1.0 + 0.1j - 1.25)  # inertia 1 about the middle, mass 1 half a length from the hinge
        return abs(found - alone) if gap <= 1e-12 else abs(found)

    check_error(error, 1e-9, may_refuse=True)


@over("stiff", 1e8, 1.0, 1e4, 1e12, 1e16)
def test_springs_of_unlike_stiffness_equal_sixty_digits(check_error, stiff):
    """Response of three masses; relative error against sixty digits."""
    K = np.array([[1.0 + stiff, -stiff, 0.0], [-stiff, stiff + 1.0, -1.0], [0.0, -1.0, 1.0]])
    M, C, one, omega = np.eye(3), 0.01 * np.eye(3), np.array([0.0, 0.0, 1.0]), [0.0, 0.3, 1.0, 3.0]

    def error():
        found = response(SecondOrderModel(M, C, K, {"f": one}, {"y": one}), omega, ["f"], ["y"])
        return each_relative(found, dense_response(M, C, K, one[:, None], one[None], omega))

    # the matrix itself loses these digits of its softest spring; from 1e-4 on a warning is promised
    check_error(error, max(1e-9, min(1e-4, 10 * EPS * stiff)), may_refuse=stiff > 1e8)


# powers of length, force and time in the unit of each parameter; what is not listed is a length
FORCE_TIME = {
    **dict.fromkeys(("platform_mass", "cradle_mass", "boom_mass"), (-1, 1, 2)),
    **dict.fromkeys(("platform_inertia", "cradle_inertia", "boom_inertia"), (1, 1, 2)),
    "density": (-4, 1, 2),
    "youngs_modulus": (-2, 1, 0),
    "spring_stiffness": (-1, 1, 0),
    "cradle_damping": (-1, 1, 1),
    "hinge_damping": (1, 1, 1),
    "stiffness_damping": (0, 0, 1),
}


@pytest.mark.parametrize("unit", ["length", "force", "time"])
@over("scale", 1e3, *(scale for scale in SCALES if scale != 1e3))
def test_boom_in_other_units_scales(check_error, unit, scale):
    """Relative error of singular values against the law of scaling."""
    powers = {field.name: FORCE_TIME.get(field.name, (1, 0, 0)) for field in fields(P)}
    omega = np.array([0.1, 1.0, 1.5, 6.0, 30.0])

    def gains(p, slower=1.0):
        return np.linalg.svd(np.moveaxis(response(spray_boom(p), omega / slower), 2, 0), compute_uv=False)[:, 0]

    def error():
        return each_relative(gains(in_other_units(P, powers, unit, scale), scale if unit == "time" else 1.0), gains(P))

    check_error(error, 1e-9, may_refuse=True)


def some_boom(seed):
    rng = np.random.default_rng(seed)
    names = ["platform_mass", "cradle_mass", "spring_stiffness", "cradle_damping", "hinge_damping", "youngs_modulus"]
    drawn = {name: getattr(P, name) * 10.0 ** rng.uniform(-1.0, 1.0) for name in names}
    return replace(P, **drawn, spring_distance=P.spring_distance * rng.uniform(0.2, 2.0))


def with_other(field):
    return lambda factor: replace(P, **{field: factor * getattr(P, field)})


FACTORS = (1e3, 0.0, 1e-6, 1.0, 1e6)


@over_each(
    (some_boom, *range(24)),
    (with_other("stiffness_damping"), *FACTORS),
    (with_other("hinge_damping"), *FACTORS),
    (with_other("cradle_damping"), *FACTORS),
)
def test_boom_response_equals_sixty_digits(check_error, make, value):
    """Relative error at each frequency against the solution of the model's own matrices in sixty digits."""
    model = spray_boom(make(value), elements=12)
    ports, omega = model.select(["cradle"], list(TIPS)).ports, (*RATES, 0.1, 20.0, 300.0)

    def error():
        true = dense_response(model.M, model.C, model.K, ports.B[0], ports.L[0], omega)
        found = response(model, omega, ["cradle"], list(TIPS))
        return max(relative(found[:, :, k], true[:, :, k]) for k in range(len(omega)))

    check_error(error, 1e-7)


@over("tiny", 5e-324, 1e-310, 1e-300)
def test_parameters_next_to_zero_act_as_zero(check_error, tiny):
    """Boom, exact boom and mass on a spring; relative difference from a billionth of a billionth of the usual value."""
    tips = lambda **change: response(spray_boom(replace(P, **change)), [0.1, 1.0, 10.0])  # noqa: E731
    for name in ("spring_stiffness", "cradle_damping", "hinge_damping", "stiffness_damping", "platform_mass"):
        pair = {name: tiny}, {name: 1e-18 * getattr(P, name)}
        check_error(lambda pair=pair: relative(tips(**pair[0]), tips(**pair[1])), 1e-9, may_refuse=True)

    def exact_error():
        found, true = (
            exact_eigenfrequencies_hz(BoomParameters(spring_stiffness=k), 8, damped=False) for k in (tiny, 1e-20)
        )
        # springs next to nothing leave two motions next to rigid: listed with next to no frequency, or not
        return relative(found[found > 0.1][:5], true[true > 0.1][:5])

    check_error(exact_error, 1e-9, may_refuse=True)
    model = SecondOrderModel([[1.0]], [[0.1]], [[tiny]], {"f": [1.0]}, {"y": [1.0]})
    check_error(lambda: relative(response(model, [1.0], ["f"], ["y"])[0, 0], [1.0 / (0.1j - 1.0)]), 1e-9, True)
