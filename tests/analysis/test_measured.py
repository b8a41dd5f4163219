"""Measured curves from CSV files, good and malformed."""

import numpy as np
import pytest

import boomctl as bc


def written(tmp_path, text):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    return path


def test_magnitudes_are_read_as_they_stand(tmp_path):
    curve = bc.read_measured_curve(written(tmp_path, "# shaker\nfreq_hz,upper,lower\n0.1,8,1\n0.2,9,1.5\n"))
    assert curve.labels == ("upper", "lower")
    assert curve.freq_hz.tolist() == [0.1, 0.2]
    assert curve.magnitude.tolist() == [[8.0, 9.0], [1.0, 1.5]]


def test_a_complex_response_becomes_singular_values(tmp_path):
    omega = 2 * np.pi * np.array([0.3, 1.0, 2.0])
    response = bc.spray_boom().frequency_response(omega, ("actuator_left", "actuator_right"), ("tip_left", "tip_right"))
    heads = [f"{part}_{o}_{i}" for o in (1, 2) for i in (1, 2) for part in ("re", "im")]
    lines = ["freq_hz," + ",".join(heads)]
    for f, w in enumerate(omega):
        entries = [part(response.frdata[o, i, f]) for o in (0, 1) for i in (0, 1) for part in (np.real, np.imag)]
        lines.append(",".join(repr(float(value)) for value in (w / (2 * np.pi), *entries)))
    curve = bc.read_measured_curve(written(tmp_path, "\n".join(lines)))
    assert curve.magnitude == pytest.approx(bc.sigma(response).sigma, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a line of column names"),
        ("freq,upper\n1,2\n", "freq_hz"),
        ("freq_hz,upper\n1\n", "line 2: expected 2 values"),
        ("freq_hz,upper\n1,x\n", "line 2: expected a number in 'upper', got 'x'"),
        ("freq_hz,upper\n1,nan\n", "finite"),
        ("freq_hz,upper\n2,1\n1,1\n", "line 3: .*ascending"),
        ("freq_hz,upper\n-1,1\n", "not below zero"),
        ("freq_hz,upper\n1,-1\n", "magnitude not below zero"),
        ("freq_hz,re_1_1\n1,1\n", "im_1_1 is missing"),
        ("freq_hz,re_a_1\n1,1\n", "re_OUT_IN"),
    ],
)
def test_a_malformed_file_is_refused_with_its_place(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        bc.read_measured_curve(written(tmp_path, text))


def test_a_file_that_is_not_there_is_said_so(tmp_path):
    with pytest.raises(OSError, match=r"none\.csv"):
        bc.read_measured_curve(tmp_path / "none.csv")
