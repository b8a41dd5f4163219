"""Controllers of two halves act on the machine as each does on its half."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.synthesis import join_symmetric

MODEL = bc.spray_boom(elements=6, accelerometer_bandwidth_hz=20.0)


def half_controller(side: str, seed: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((3, 3)) - 5.0 * np.eye(3)
    measured = [f"tip_acceleration_{side}", f"stroke_{side}"]
    return control.ss(
        A,
        rng.standard_normal((3, 2)),
        rng.standard_normal((1, 3)),
        0.0,
        inputs=measured,
        outputs=[f"suspension_{side}"],
    )


def at(system: control.StateSpace, omega: float, inputs: list[str], outputs: list[str]) -> np.ndarray:
    value = system(1j * omega, squeeze=False)
    rows = [system.output_labels.index(name) for name in outputs]
    return value[np.ix_(rows, [system.input_labels.index(name) for name in inputs])]


@pytest.mark.parametrize(("side", "parity"), [("sym", 1.0), ("anti", -1.0)])
def test_the_machine_sees_each_half_s_controller(side, parity):
    halves = {"sym": half_controller("sym", 1), "anti": half_controller("anti", 2)}
    joined = join_symmetric(MODEL, halves["sym"], halves["anti"])
    assert joined.nstates == 6
    forces = ["suspension_right", "suspension_left"]
    mode = np.array([1.0, parity]) / np.sqrt(2.0)
    for stem, names in (
        ("stroke", ["stroke_right", "stroke_left"]),
        ("tip_acceleration", ["tip_right_acceleration", "tip_left_acceleration"]),
    ):
        half_name = f"{stem}_{side}"
        whole = at(joined, 1.7, names, forces) @ mode
        part = at(halves[side], 1.7, [half_name], [f"suspension_{side}"])[0, 0]
        assert np.allclose(whole, part * mode, rtol=1e-12)


def test_a_signal_of_no_half_is_refused():
    wrong = control.ss([], [], [], [[1.0]], inputs=["stroke_anti"], outputs=["suspension_sym"])
    right = control.ss([], [], [], [[1.0]], inputs=["stroke_anti"], outputs=["suspension_anti"])
    with pytest.raises(ValueError, match="'stroke_anti' of the symmetric controller"):
        join_symmetric(MODEL, wrong, right)


def test_a_machine_without_mirror_is_refused():
    lopsided = bc.spray_boom(elements=[-6.0, -2.0, 1.0, 6.0])
    gain = half_controller("sym", 0)
    with pytest.raises(ValueError, match="mirror symmetry"):
        join_symmetric(lopsided, gain, gain)


def test_what_is_no_machine_or_controller_is_refused():
    sym, anti = half_controller("sym", 1), half_controller("anti", 2)
    with pytest.raises(TypeError, match="model: expected SecondOrderModel, got StateSpace"):
        join_symmetric(sym, sym, anti)
    with pytest.raises(TypeError, match=r"^symmetric: expected control.StateSpace, got NoneType"):
        join_symmetric(MODEL, None, anti)
    with pytest.raises(TypeError, match=r"antisymmetric: expected control.StateSpace, got float"):
        join_symmetric(MODEL, sym, 1.0)
    anti.C[0, 0] = np.nan
    with pytest.raises(ValueError, match="C of the antisymmetric controller: expected finite numbers"):
        join_symmetric(MODEL, sym, anti)
