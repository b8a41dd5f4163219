"""Families: what is bent inside the box is refused, and what is proved over it holds where loops are closed anew."""

from itertools import product

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.structure import SecondOrderModel
from boomctl.structure.families import AffineFamily, PolynomialFamily
from tests.profiles import examples

BENT = {
    "zero at ends, middle and corners": lambda d: d - d**3,
    "a wave": lambda d: np.sin(2.0 * np.pi * d),
    "a kink inside": lambda d: max(abs(d) - 0.5, 0.0) * (1.0 - abs(d)),
    "a square": lambda d: d**2,
    "a hundredth of it": lambda d: 0.01 * (d - d**3),
}


def chain(stiffness, damping=0.1, stiff=1.0):
    K = np.array([[stiffness + stiff, -stiff], [-stiff, stiff]])
    return SecondOrderModel(np.eye(2), damping * np.eye(2), K, {"u": [1.0, 0.0]}, {"y": [0.0, 1.0]})


@pytest.mark.parametrize("bent", BENT)
@pytest.mark.parametrize("others", [0, 2])
def test_a_family_that_is_bent_inside_the_box_is_refused(bent, others):
    ranges = {"d": (-1.0, 1.0), **{f"p{k}": (0.9, 1.1) for k in range(others)}}

    def make(v):
        return chain(1.0 - 3.0 * BENT[bent](v["d"]) + sum(v[name] for name in v if name != "d"))

    with pytest.raises(ValueError, match=r"K is not affine in d.*d = "):
        AffineFamily.from_function(ranges, make)


def test_a_soft_part_is_not_lost_beside_a_stiff_one():
    """The bend is a hundred-billionth of the largest entry, and a tenth of its own."""

    def make(v):
        K = np.diag([1.0 + 0.1 * (v["d"] - v["d"] ** 3), 1e10])
        return SecondOrderModel(np.eye(2), np.eye(2), K, {"u": [1.0, 0.0]}, {"y": [0.0, 1.0]})

    with pytest.raises(ValueError, match="K is not affine in d"):
        AffineFamily.from_function({"d": (-1.0, 1.0)}, make)


def test_family_input_columns_must_be_affine():
    def make(bend):
        return lambda v: SecondOrderModel(
            np.eye(1), np.eye(1), [[1.0]], {"u": [1.0 + v["d"] + bend * (v["d"] - v["d"] ** 3)]}, {"y": [1.0]}
        )

    with pytest.raises(ValueError, match="B0 is not affine in d"):
        AffineFamily.from_function({"d": (-1.0, 1.0)}, make(0.3))
    family = AffineFamily.from_function({"d": (-1.0, 1.0)}, make(0.0))
    assert family.at([0.4]).ports.B[0] == pytest.approx(1.4)


def test_a_family_without_parameters_is_its_center():
    family, controller = AffineFamily((), [], [], chain(1.0), ()), control.ss([], [], [], [[-0.1]], 0.1)
    controller.update_names(inputs=["y"], outputs=["u"])
    assert (family.at([]).K == chain(1.0).K).all()
    assert bc.robust_stability(family, controller).destabilizing_values is None


@pytest.mark.parametrize("stiff", [1.0, 1e6, 1e12])
def test_rounding_of_an_assembly_is_no_bend(stiff):
    family = AffineFamily.from_function({"k": (0.5, 1.7), "c": (0.1, 0.3)}, lambda v: chain(v["k"], v["c"], stiff))
    assert family.nparameters == 2


@pytest.mark.parametrize("step", [0.0, pytest.param(0.02, marks=pytest.mark.slow)])
@given(st.integers(0, 10_000))
@examples(40)
def test_proof_with_parameter_dependent_signals(step, seed):
    """Loops closed anew on a grid of the box; that of both at once, a product of the two changes, at the corners most."""
    rng = np.random.default_rng(seed)
    C, K, softer = np.diag(rng.uniform(0.05, 1.5, 2)), np.diag(rng.uniform(5.0, 200.0, 2)), rng.uniform(0.1, 0.6)
    b, l, db, dl = rng.standard_normal((4, 2))

    def make(values):
        x, y = values["x"], values["y"]
        forces, outputs = {"f": b + 0.5 * y * db}, {"q": l + 0.7 * x * dl + 0.5 * y * db}
        return SecondOrderModel(np.eye(2), C, K * (1.0 + softer * x), forces, outputs)

    family = PolynomialFamily.from_function({"x": (-1.0, 1.0), "y": (-1.0, 1.0)}, make)
    slow = control.ss([[-20.0]], [[20.0]], [[-rng.uniform(0.2, 12.0)]], 0.0, inputs="q", outputs="f")
    controller, late = (bc.discretize(slow, step), {"delay": 0.5 * step}) if step else (slow, {})
    proved, grid = bc.robust_stability(family, controller, **late).proved, np.linspace(-1.0, 1.0, 5)
    for x, y in product(grid, grid):
        model = make({"x": x, "y": y})
        plant = bc.analysis.sample_plant(model, step, **late) if step else model
        poles = bc.feedback_loop(plant, controller, injection_points=["f"]).poles()
        assert not proved or ((np.abs(poles) < 1.0).all() if step else (poles.real < 0.0).all())
