"""Mode shapes by their laws: orthogonality, symmetry, nodes of a free beam, and no corners."""

import re
import warnings
from math import pi

import numpy as np
import pytest

import boomctl as bc

s = bc.structure


def beam(joint, elements=8, angle=0.0):
    """Return a uniform beam of 2 m on the ground."""
    section = s.BeamSegment(length=2.0, mass_per_length=3.0, bending_stiffness=5e3)
    body = s.Beam("beam", s.GROUND.at(0.0), joint, (0.0, 0.0), (section,), s.FiniteElements(elements), angle=angle)
    return s.Assembly((body,)).assemble()


def test_mode_shapes_symmetry():
    m = bc.spray_boom()
    found = m.mode_shapes(8)
    boom = found["boom"]
    assert boom.points[:, 0] == pytest.approx(-boom.points[::-1, 0], abs=1e-12)
    for kind, motion in zip(found.kinds, boom.displacement[:, :, 1], strict=True):
        sign = {"jolt": 1.0, "yaw": -1.0}[kind]
        assert motion == pytest.approx(sign * motion[::-1], abs=1e-9 * np.abs(motion).max())
    for half, kind in zip(bc.split_symmetric(m), ("jolt", "yaw"), strict=True):
        own = half.mode_shapes(2)
        assert own.kinds == (kind, kind)
        first = found.kinds.index(kind)
        assert own.eigenfrequencies_hz[0] == pytest.approx(found.eigenfrequencies_hz[first], rel=1e-12)
        ours, theirs = own["boom"].displacement[0, :, 1], boom.displacement[first, :, 1]
        assert min(np.abs(ours - theirs).max(), np.abs(ours + theirs).max()) < 1e-9


def test_outputs_read_what_the_picture_shows():
    m = bc.spray_boom(elements=10)
    found = m.mode_shapes(5)
    ends = found["boom"].displacement[:, [0, -1], 1]
    rows = np.array([m.ports.L[0][m.output_labels.index(name)] for name in ("tip_left", "tip_right")])
    assert pytest.approx(rows @ found.shapes, abs=1e-12) == ends.T


def test_mode_shapes_free_beam_nodes():
    """Nodes of the first two bending modes at 0.22416 and 0.13211 of the length (Young & Felgar 1949)."""
    found = beam(s.planar("y", "theta")).mode_shapes(4)
    assert found.eigenfrequencies_hz[:2] == pytest.approx(0.0, abs=1e-5)
    assert found.numbers == (0, 0, 1, 2)
    line = found["beam"]
    x = line.points[:, 0] / 2.0
    for mode, nodes, parity in ((2, [0.22416, 0.77584], 1.0), (3, [0.13211, 0.5, 0.86789], -1.0)):
        w = line.displacement[mode, :, 1]
        k = np.flatnonzero(np.sign(w[:-1]) * np.sign(w[1:]) < 0.0)
        crossed = x[k] - w[k] * (x[k + 1] - x[k]) / (w[k + 1] - w[k])
        if parity < 0.0 and len(crossed) == 2:  # the node in the middle is a point of the picture
            crossed = np.sort(np.append(crossed, 0.5))
        assert crossed == pytest.approx(nodes, abs=5e-4)
        assert w == pytest.approx(parity * w[::-1], abs=1e-6 * np.abs(w).max())


def test_mode_shape_plot_is_curved():
    """Cubic interpolation misses a curve by ``h^4/384`` of its fourth derivative, which is ``z^4`` of the tip at most."""
    found = beam(s.fixed(), elements=2).mode_shapes(1)
    line = found["beam"]
    z, x = 1.8751040687, line.points[:, 0] / 2.0
    ratio = (np.cosh(z) + np.cos(z)) / (np.sinh(z) + np.sin(z))
    exact = np.cosh(z * x) - np.cos(z * x) - ratio * (np.sinh(z * x) - np.sin(z * x))
    w = line.displacement[0, :, 1]
    assert w / w[-1] == pytest.approx(exact / exact[-1], abs=0.5**4 / 384.0 * z**4)
    assert len(line.points) > 50


def test_an_upright_beam_swings_sideways():
    found = beam(s.fixed(), angle=pi / 2).mode_shapes(2)["beam"]
    assert found.points[-1] == pytest.approx([0.0, 2.0], abs=1e-12)
    assert np.abs(found.displacement[:, :, 1]).max() < 1e-12
    assert np.abs(found.displacement[:, -1, 0]).min() > 0.1


def test_mode_shapes_of_matrices_and_families():
    m = s.SecondOrderModel(np.eye(2), np.zeros((2, 2)), np.diag([1.0, 4.0]), {"f": [1.0, 0.0]}, {"y": [1.0, 1.0]})
    found = m.mode_shapes(2)
    assert found.bodies == ()
    assert found.shapes == pytest.approx(np.eye(2))
    assert bc.boom.yaw_family().at([0.0] * bc.boom.yaw_family().nparameters).mode_shapes(1).bodies
    with pytest.raises(ValueError, match="count"):
        m.mode_shapes(3)
    with pytest.raises(ValueError, match="unknown body 'arm'"):
        bc.spray_boom().mode_shapes(1)["arm"]


def test_modes_are_numbered_as_eigenfrequencies_are():
    """Whatever floats: the actuators of this boom push, so that its platform is free."""
    for model in (bc.spray_boom(), bc.spray_boom(excitation="force")):
        shapes, frequencies = model.mode_shapes(6), model.eigenfrequencies_hz(4)
        for number, undamped, name in zip(shapes.numbers, shapes.eigenfrequencies_hz, shapes.names, strict=True):
            if number == 0:
                assert undamped == 0.0
                assert name.startswith("rigid: ")
            elif number <= 4:
                assert undamped == pytest.approx(frequencies[number - 1], rel=0.05)  # damping moves them by so much
                assert name.startswith(f"{number}: ")
    assert shapes.numbers == (0, 0, 1, 2, 3, 4)


def chain(stiffness, mass):
    """Return three masses on springs: modes at 0.07, 0.20 and 0.29 times the root of stiffness over mass [Hz]."""
    K = stiffness * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    return s.SecondOrderModel(mass * np.eye(3), np.zeros((3, 3)), K, {"f": [1.0, 0.0, 0.0]}, {"y": [1.0, 0.0, 0.0]})


def bar(length, modulus, area, second_moment):
    """Return a bar of steel, whatever its units are."""
    section = s.BeamSegment.from_cross_section(length, s.CrossSection(area, second_moment), modulus, 7850.0)
    body = s.Beam("beam", s.GROUND.at(0), s.fixed(), (0.0, 0.0), (section,), s.FiniteElements(6))
    return s.Assembly((body,), outputs=(s.Output("tip", body.at(length)),)).assemble()


@pytest.mark.parametrize(
    ("model", "warned"),
    [
        (chain(1e-9, 1.0), True),
        (chain(1e15, 1.0), True),
        (bar(2000.0, 210.0, 400.0, 13333.0), True),  # counts in millimeters and gigapascals
        (chain(1.0, 1.0), False),
        (chain(1e9, 1e-2), False),
        (bar(2.0, 2.1e11, 4e-4, 1.3333e-8), False),
        (bc.spray_boom(excitation="force"), False),
    ],
)
def test_frequencies_of_no_machine_warn_of_units(model, warned):
    for asked in (model.eigenfrequencies_hz, model.mode_shapes):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            asked(3)
        assert [one.filename for one in caught] == [__file__] * warned
        for one in caught:
            assert re.search(r"lowest eigenfrequency is .* Hz; expected SI units: lengths in m", str(one.message))


def test_soft_spring_in_stiff_machine_is_not_warned_of():
    soft = s.SecondOrderModel(np.eye(2), np.zeros((2, 2)), np.diag([1e-9, 1e3]), {"f": [1.0, 0.0]}, {"y": [1.0, 0.0]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        soft.eigenfrequencies_hz(2)
        bc.hub_beam(modes=1).eigenfrequencies_hz()
