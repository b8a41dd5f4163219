"""Each suspension of designs/ is worth what the README says, and better than the boom as it is."""

import dataclasses

import numpy as np
import pytest

import boomctl as bc
from boomctl.studies.catalogue import design_file, design_names
from boomctl.studies.suspension import FieldScene, SuspensionDesign, suspension_model

pytestmark = pytest.mark.early

SCENE = FieldScene(duration=30.0, run_in=20.0)
PEAKS = {
    "passive_tuning": 9.86,
    "lqr_suspension": 3.37,
    "lqg_suspension": 13.60,
    "h_infinity_split": 9.52,
    "h_infinity_full": 10.15,
}


QUICK = ("h_infinity_split", "lqr_suspension")
"""One with sensors, one without; the others take as long again, each."""


def load_design(name):
    return design_file(name, "suspension").made()


@pytest.fixture(
    scope="module",
    params=[name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in sorted(PEAKS)],
)
def result(request):
    return load_design(request.param).evaluate(SCENE)


def test_every_design_in_the_folder_is_known():
    assert set(design_names("suspension")) == set(PEAKS)


def test_the_certified_peak_is_the_one_of_the_readme(result):
    assert result.active.sigma.certified
    assert result.active.sigma.peak == pytest.approx(PEAKS[result.design.name], rel=5e-3)


def test_it_is_better_than_the_boom_as_it_is(result):
    assert result.better
    assert result.active.stroke < SCENE.stroke_limit
    assert not result.active.run.stops


def test_h_infinity_takes_the_yaw_down_by_forty_decibels(result):
    if result.design.name.startswith("h_infinity"):
        assert result.yaw_reduction_db > 40.0


def test_suspensions_with_sensors_are_proved_stable(result):
    """Over springs and mass, over the yaw's frequencies, and on the exact boom, whose curve is that of the mesh."""
    assured = result.assured
    assert (assured is None) == (result.design.name in ("passive_tuning", "lqr_suspension"))
    if assured is not None:
        assert assured.robust
        assert assured.exact_sigma.peak == pytest.approx(result.active.sigma.peak, rel=5e-3)
        assert max(half.worst.norm.lower for half in (assured.jolt, assured.yaw)) < 30.0
        assert assured.jolt.margins.controls.alpha > 0.4
        assert assured.yaw.margins.controls.alpha > 0.4


def test_the_halves_make_the_whole(result):
    """Of a symmetric loop the largest peak is the larger one of both halves."""
    halves = max(result.active.jolt.lower, result.active.yaw.lower)
    assert halves == pytest.approx(result.active.sigma.peak, rel=1e-4)


def test_the_controller_lies_beside_the_report_in_files(result, tmp_path):
    """None of a passive design; read again it is the same, and its C code has the limits of the field run."""
    files, K = result.controller_files(), result.design.controller
    if K is None:
        assert not files
        return
    assert {"controller.json", "controller.mat", "controller.m"} <= set(files)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    read = bc.read_controller(tmp_path / "controller.json")
    assert np.array_equal(read.A, K.A)
    assert (read.input_labels, read.output_labels) == (K.input_labels, K.output_labels)
    if "controller.c" in files:
        assert f"FORCE[2] = {{R({SCENE.force_limit.hex()}), R({SCENE.force_limit.hex()})}}" in files["controller.c"]


def test_a_design_may_come_from_a_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from boomctl.studies.suspension import SuspensionDesign\ndef design(): return SuspensionDesign('mine', 'as it is')\n"
    )
    assert load_design(str(path)) == SuspensionDesign("mine", "as it is")


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("x = 1\n", ValueError, r"expected a file with a function design\(\)"),
        ("def design(): return 3\n", TypeError, "returned int"),
    ],
)
def test_a_file_without_a_design_is_refused(tmp_path, text, error, message):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(error, match=message):
        load_design(str(path))


def test_an_unknown_design_is_refused():
    with pytest.raises(ValueError, match="did you mean 'lqg_suspension'"):
        load_design("lqg_suspensions")
    with pytest.raises(ValueError, match="no such file"):
        load_design("nowhere.py")


def test_a_scene_out_of_range_is_refused():
    for name, value in (("speed", 0.0), ("delay", -1.0), ("duration", np.nan), ("force_limit", -5.0)):
        with pytest.raises(ValueError, match=name):
            FieldScene(**{name: value})


def test_the_same_scene_gives_the_same_motion():
    one, other = FieldScene(duration=5.0, run_in=0.0).motion(), FieldScene(duration=5.0, run_in=0.0).motion()
    assert np.array_equal(one.left, other.left)
    faster = dataclasses.replace(SCENE, duration=5.0, run_in=0.0, seed=2).motion()
    assert not np.array_equal(one.left, faster.left)


def test_a_longer_drive_begins_with_the_shorter_one():
    """Twice as long, over twice the track: the same ground, so that the run before is the beginning of the run after."""
    one, longer = (FieldScene(duration=T, run_in=1.0).motion() for T in (5.0, 11.0))
    assert longer.left[: len(one.left)] == pytest.approx(one.left, abs=1e-9 * one.left.std())
    assert longer.yaw[: len(one.yaw)] == pytest.approx(one.yaw, abs=1e-9 * one.yaw.std())


def test_a_drive_farther_than_the_ground_is_refused():
    with pytest.raises(
        ValueError, match=r"run_in, duration = 60, 4000: expected at most 33\d\d\.\d+ s together at speed = 3"
    ):
        FieldScene(duration=4000.0).motion()


def test_the_sensors_follow_from_the_boom():
    """A tip accelerometer far below its bandwidth reads the second derivative of the tip."""
    model = suspension_model(elements=8)
    omega = np.array([0.5, 2.0])
    found = model.frequency_response(omega, ["actuator_left"], ["tip_left", "tip_left_acceleration"]).frdata[:, 0]
    assert np.allclose(found[1], -(omega**2) * found[0], rtol=3e-2)
