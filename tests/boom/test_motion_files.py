"""Motions of the platform: sweeps, files written and read, and files that are refused with file and line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import boomctl as bc
from tests.profiles import examples

NUMBERS = st.floats(-10.0, 10.0, allow_nan=False)


def written(folder, text, name="motion.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@given(
    arrays(float, (2, 9), elements=NUMBERS),
    st.floats(1e-4, 1.0),
    st.floats(-5.0, 100.0),
    st.floats(1e-3, 1e3),
    st.booleans(),
)
@examples(30)
def test_a_motion_written_is_the_motion_read(tmp_path_factory, moved, step, start, distance, given_again):
    path = tmp_path_factory.mktemp("motion") / "motion.csv"
    motion = bc.boom.PlatformMotion(start + step * np.arange(9), *moved, distance)
    bc.boom.write_motion(path, motion)
    found = bc.read_motion(path, distance) if given_again else bc.read_motion(path)
    assert found.actuator_distance == distance
    for name in ("time", "left", "right", "yaw"):
        assert (getattr(found, name) == getattr(motion, name)).all()


JOLT_YAW = "time_s,jolt_m,yaw_rad\n0,0,0.1\n1,0,0.2\n"


@pytest.mark.parametrize(
    ("comments", "expected"),
    [
        ("#actuator_distance_m=2.5", 2.5),
        ("#   Actuator_Distance_M = 2.5e0", 2.5),
        ("# distance of the actuators as in the drawing\n# distance 3", 1.78),
        ("# from the shaker", 1.78),
        *(
            (f"# shaker\n# actuator_distance_m = {wrong}", None)
            for wrong in ("0", "-1", "nan", "wide", "", "1_0", "2 m")
        ),
        ("# actuator_distance_m = 1\n# actuator_distance_m = 1", None),
        *(
            (f"# shaker\n# {other} 1780", None)
            for other in (
                "actuator distance_mm =",
                "Distance of the actuator:",
                "actuator-distance [m] =",
                "actuatordistance",
            )
        ),
    ],
)
def test_motion_file_actuator_distance(tmp_path, comments, expected):
    path = written(tmp_path, f"{comments}\n{JOLT_YAW}")
    if expected is None:
        with pytest.raises(ValueError, match=r"line 2: expected one '# actuator_distance_m = \.\.\.', above zero, got"):
            bc.read_motion(path)
        return
    motion = bc.read_motion(path)
    assert motion.actuator_distance == expected
    assert motion.right == pytest.approx([0.05 * expected, 0.1 * expected])


def test_motion_file_distance_beside_argument(tmp_path):
    stated, silent = (
        written(tmp_path, f"# actuator_distance_m = 2.5\n{JOLT_YAW}"),
        written(tmp_path, JOLT_YAW, "bare.csv"),
    )
    with pytest.raises(ValueError, match=r"actuator_distance = 2: expected 2\.5 m, as line 1 of .*motion\.csv says"):
        bc.read_motion(stated, 2.0)
    assert bc.read_motion(silent, 2.0).actuator_distance == 2.0


def test_jolt_and_yaw_are_left_and_right(tmp_path):
    path = written(tmp_path, "# field 3\nyaw_rad,time_s,jolt_m\n0.1,0,1\n\n0.2,0.5,2\n")
    motion = bc.read_motion(path, actuator_distance=2.0)
    assert motion.left == pytest.approx([0.9, 1.8])
    assert motion.right == pytest.approx([1.1, 2.2])
    assert motion.jolt == pytest.approx([1.0, 2.0])
    assert motion.yaw == pytest.approx([0.1, 0.2])
    assert motion.sample_time == pytest.approx(0.5)
    assert motion.symmetric == pytest.approx(np.sqrt(0.5) * (motion.right + motion.left))
    assert motion.antisymmetric == pytest.approx(np.sqrt(0.5) * (motion.right - motion.left))


def test_times_rounded_in_the_file_are_taken_as_equally_spaced(tmp_path):
    lines = [f"{k / 300:.4f},0,{k}" for k in range(900)]
    motion = bc.read_motion(written(tmp_path, "\n".join(["time_s,left_m,right_m", *lines])))
    assert motion.sample_time == pytest.approx(1 / 300, rel=1e-4)


HEAD = "time_s,left_m,right_m\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a line of column names"),
        (HEAD, "expected a line of column names and at least one line of numbers"),
        (HEAD + "0,0,0\n", "at least two samples"),
        ("time,left,right\n0,0,0\n1,0,0\n", "line 1: expected columns time_s, left_m, right_m or time_s, jolt_m"),
        ("time_s,left_m,left_m\n0,0,0\n1,0,0\n", "line 1: expected columns"),
        (HEAD + "0,0,0\n1,0\n", "line 3: expected 3 values, got 2"),
        (HEAD + "0,0,0\n1,,0\n", "line 3: expected a number in 'left_m', got ''"),
        (HEAD + "0,0,0\n1,0,nan\n", "line 3: expected a finite number in 'right_m', got 'nan'"),
        (HEAD + "0,0,0\n1,0,0\n0.5,0,0\n", r"line 4: time_s = 0\.5: expected times to ascend"),
        (HEAD + "0,0,0\n0,0,0\n1,0,0\n", "line 3: time_s = 0: expected times to ascend"),
        (HEAD + "0,0,0\n1,0,0\n2,0,0\n# lost\n5,0,0\n6,0,0\n", "line 6: time_s = 5: a gap"),
        (HEAD + "0,0,0\n1,0,0\n2.3,0,0\n3.3,0,0\n", "line . time_s = .*expected equal steps|expected equal steps"),
        (HEAD + "0,0,0\n1,1_0,0\n", "line 3: expected a number in 'left_m', got '1_0'"),
        (HEAD + '0,0,0\n1,"0,0\n', "line 3: expected comma-separated values"),
    ],
)
def test_a_file_that_is_no_motion_is_refused(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=message) as caught:
        bc.read_motion(path)
    assert str(path) in str(caught.value)


def test_a_file_that_is_not_text_is_refused(tmp_path):
    (tmp_path / "raw.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ValueError, match="expected text in UTF-8"):
        bc.read_motion(tmp_path / "raw.csv")


@given(st.booleans(), st.floats(0.2, 2.0), st.floats(0.2, 5.0))
@examples(20)
def test_a_sweep_runs_from_its_first_frequency_to_its_last(logarithmic, start, stop):
    """Zero crossings lie where the integral of the frequency is a multiple of a half."""
    motion = bc.sine_sweep(start, stop, 20.0, 0.02, logarithmic=logarithmic)
    t, y = motion.time, motion.jolt
    share = t / 20.0
    frequency = start * (stop / start) ** share if logarithmic else start + (stop - start) * share
    cycles = np.concatenate([[0.0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1]) * np.diff(t))])
    assert np.allclose(y, 0.02 * np.sin(2 * np.pi * cycles), rtol=0.0, atol=1e-5)
    assert np.abs(motion.yaw).max() == 0.0


def test_a_sweep_moves_what_it_says():
    for motion, left, right in (("jolt", 1, 1), ("yaw", -1, 1), ("left", 1, 0), ("right", 0, 1)):
        found = bc.sine_sweep(0.1, 2.0, 5.0, 0.02, motion)
        wave = bc.sine_sweep(0.1, 2.0, 5.0, 0.02).left
        assert np.allclose(found.left, left * wave, rtol=1e-6, atol=1e-12)
        assert np.allclose(found.right, right * wave, rtol=1e-6, atol=1e-12)


def test_a_quotation_mark_in_a_comment_swallows_no_samples(tmp_path):
    text = HEAD + '0,0,1\n# left cylinder,"bent\n1,0,2\n2,0,3\n# right one"\n3,0,4\n'
    assert bc.read_motion(written(tmp_path, text)).right == pytest.approx([1.0, 2.0, 3.0, 4.0])
    quoted = '"time_s","left_m","right_m"\n"0","0","1"\n  \n1,0,2\n'
    assert bc.read_motion(written(tmp_path, quoted)).right == pytest.approx([1.0, 2.0])
