"""A symmetric structure is the sum of its halves, and an unsymmetric one has none."""

from dataclasses import replace

import numpy as np
import pytest

import boomctl as bc
from boomctl.structure import SecondOrderModel, split_symmetric

OMEGA = 2 * np.pi * np.array([0.1, 0.33, 0.9, 2.8, 7.0])
EXCITATIONS = ("displacement", "velocity", "acceleration", "force")
BASES = {"jolt": (1.0, "sym"), "yaw": (-1.0, "anti")}


def plain(model):
    """Return the same model without its mirror: what is not known to be symmetric is not split."""
    structure = replace(model.structure, layout=replace(model.structure.layout, mirror=None))
    return SecondOrderModel.of(structure, replace(model.ports, primary=None))


@pytest.mark.parametrize("discretization", ["finite", "high-order", "discrete-hermite", "discrete-geometric"])
def test_half_signals_are_orthonormal_sums_and_differences(discretization):
    """``sym = (right + left)/sqrt 2``, ``anti = (right - left)/sqrt 2``, for inputs and outputs alike."""
    model = bc.spray_boom(discretization=discretization)
    Y = plain(model).frequency_response(OMEGA).frdata
    row = {name: i for i, name in enumerate(model.output_labels)}
    column = {name: i for i, name in enumerate(model.input_labels)}
    for part, (sign, stem) in zip(split_symmetric(model), BASES.values(), strict=True):
        for y in ("tip", "stroke"):
            for u in ("actuator", "suspension"):
                blocks = [
                    a * b * Y[row[f"{y}_{o}"], column[f"{u}_{i}"]] / 2
                    for o, a in (("right", 1), ("left", sign))
                    for i, b in (("right", 1), ("left", sign))
                ]
                half = part.frequency_response(OMEGA, f"{u}_{stem}", f"{y}_{stem}").frdata[0, 0]
                assert np.abs(half - sum(blocks)).max() < 1e-11 * np.abs(Y).max()


@pytest.mark.parametrize(
    "model", [bc.spray_boom(), bc.boom_family(spring_factor=(0.7, 1.3), elements=20).at([1.0, 0.0])]
)
def test_halves_keep_the_coordinates_of_their_state_space(model):
    settled = SecondOrderModel.of(replace(model.structure, settled=True), model.ports)
    for half in split_symmetric(settled):
        assert np.array_equal(half.to_statespace().A, half.to_statespace(states="coordinates").A)


def test_the_signals_that_stand_on_the_axis_belong_to_the_jolt():
    jolt, yaw = split_symmetric(bc.spray_boom())
    assert jolt.input_labels == ("actuator_sym", "suspension_sym", "cradle")
    assert jolt.output_labels == ("tip_sym", "stroke_sym", "cradle_slip")
    assert yaw.input_labels == ("actuator_anti", "suspension_anti")
    assert yaw.output_labels == ("tip_anti", "stroke_anti")


@pytest.mark.parametrize("excitation", EXCITATIONS)
@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [
        (None, None),
        ("actuator_left", "tip_left"),
        ("actuator_right", None),
        (["actuator_left", "suspension_right"], "stroke_left"),
        ("cradle", ["tip_right", "tip_left"]),
        (["suspension_left", "suspension_right"], "cradle_slip"),
    ],
)
def test_subsystem_response_matches_full_model(inputs, outputs, excitation):
    """One of a pair of signals alone is no half of anything, and still comes out whole."""
    model = bc.spray_boom(excitation=excitation)
    found = model.frequency_response(OMEGA, inputs, outputs).frdata
    truth = plain(model).frequency_response(OMEGA, inputs, outputs).frdata
    assert np.abs(found - truth).max() < 1e-10 * np.abs(truth).max()


def test_units_say_what_a_signal_is():
    """Of a whole machine the plain ones, of the motion that is imposed; of a half that it carries a root of two."""
    names = ("tip_left", "tip_left_acceleration", "suspension_left", "actuator_left")
    for excitation, unit in zip(EXCITATIONS, ("m", "m/s", "m/s^2", "N"), strict=True):
        whole = bc.spray_boom(excitation=excitation, accelerometer_bandwidth_hz=20.0)
        assert [whole.units[name] for name in names] == ["m", "m/s^2", "N", unit]
    assert bc.spray_boom(reaction_forces=True).units["actuator_left_force"] == "N"
    jolt, yaw = split_symmetric(bc.spray_boom(excitation="force"))
    assert yaw.units["tip_anti"] == "m (sqrt(2) times half the difference)"
    assert jolt.units["actuator_sym"] == "N (sqrt(2) times the mean)"
    assert jolt.units["cradle"] == "N"  # its own image: no pair, no root
    assert SecondOrderModel([[1.0]], [[0.0]], [[4.0]], {"f": [1.0]}, {"y": [1.0]}).units == {"f": "", "y": ""}
