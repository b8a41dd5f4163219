"""Measured curves and responses from CSV and universal files, good and malformed."""

import sys

import numpy as np
import pytest

import boomctl as bc
from tests.refusals import assert_refused, refusals


def written(tmp_path, text):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    return path


def test_magnitudes_are_read_as_they_stand(tmp_path):
    curve = bc.read_frequency_response(written(tmp_path, "# shaker\nfreq_hz,upper,lower\n0.1,8,1\n0.2,9,1.5\n"))
    assert curve.labels == ("upper", "lower")
    assert curve.frequency_hz.tolist() == [0.1, 0.2]
    assert curve.magnitude.tolist() == [[8.0, 9.0], [1.0, 1.5]]
    assert curve.response is None


MALFORMED = r"""
"" -> expected a line of column names
"freq,upper\n1,2" -> freq_hz
"freq_hz,upper\n1" -> line 2: expected 2 values
"freq_hz,upper\n1,x" -> line 2: expected a number in 'upper', got 'x'
"freq_hz,upper\n1,nan" -> finite
"freq_hz,upper\n2,1\n1,1" -> line 3: .*ascending
"freq_hz,upper\n-1,1" -> not below zero
"freq_hz,upper\n1,-1" -> magnitude not below zero
"freq_hz,re_1_1\n1,1" -> im_1_1 is missing
"freq_hz,re_a_1\n1,1" -> re_OUT_IN
"freq_hz;upper\n0,1;1\n0.2;1" -> decimal points, got a comma in line 2 and a point in line 3
"freq_hz;upper\n0,1;1.000,5" -> decimal commas or decimal points
"freq_hz,upper\n0,1,8,5" -> expected 2 values, got 4; decimal commas need semicolons
"freq_hz;upper\n0,1;1,2,3" -> line 2: expected a number in 'upper', got '1.2.3'
"freq_hz,re_1_1,im_1_1,re_1_1\n1,1,1,1" -> line 1: column 're_1_1' is there twice
"freq_hz;upper;lower;upper\n0,1;8;1;2" -> line 1: column 'upper' is there twice
"freq_hz,re_1_1,im_1_1,re_999999_999999\n1,1,1,1" -> re_1_2 is missing
# columns that are no magnitudes, however they are spelled and wherever the word stands
"freq_hz;lower;upper_phase\n0.1;8;1" -> line 1: .*the name of a phase;
"freq_hz;lower;DEG\n0.1;8;1" -> line 1: .*the name of a phase;
"freq_hz;lower;Phi(tip\n0.1;8;1" -> line 1: .*the name of a phase;
"freq_hz;lower;yaw angle dB\n0.1;8;1" -> line 1: .*the name of decibels;
"freq_hz;lower;magdb-1\n0.1;8;1" -> line 1: .*the name of decibels;
"freq_hz;lower;Real[mag\n0.1;8;1" -> line 1: .*the name of a part of complex numbers;
"freq_hz;lower;sigma1/IM\n0.1;8;1" -> line 1: .*the name of a part of complex numbers;
"freq_hz;lower;coherence\n0.1;8;1" -> line 1: .*the name of a coherence;
"""


@refusals(MALFORMED)
def test_malformed_file_is_refused_with_its_place(tmp_path, call, words):
    assert_refused(f"bc.read_frequency_response(written(tmp_path, {call}))", words, globals() | locals())


def test_names_that_begin_like_no_magnitudes_are_read(tmp_path):
    names = ("redback", "degas", "reach", "imbalance", "1")
    curve = bc.read_frequency_response(written(tmp_path, f"freq_hz;{';'.join(names)}\n0.1;1;2;3;4;5\n0.2;1;2;3;4;5\n"))
    assert curve.labels == names


OMEGA = 2 * np.pi * np.array([0.3, 1.0, 2.0, 4.5])
PORTS = ("actuator_left", "actuator_right"), ("tip_left", "tip_right")


def shaken():
    return np.asarray(bc.spray_boom().frequency_response(OMEGA, *PORTS).frdata)


def complex_table(response, separator=",", decimal="."):
    """Return a response as a CSV file of one dialect, every digit written."""
    heads = [f"{part}_{o}_{i}" for o in (1, 2) for i in (1, 2) for part in ("re", "im")]
    lines = [separator.join(["freq_hz", *heads])]
    for f, w in enumerate(OMEGA):
        entries = [part(response[o, i, f]) for o in (0, 1) for i in (0, 1) for part in (np.real, np.imag)]
        numbers = (repr(float(value)).replace(".", decimal) for value in (w / (2 * np.pi), *entries))
        lines.append(separator.join(numbers))
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), ("  ", ",")]
)
@pytest.mark.parametrize(
    "head", ["", "\ufeff", "# shaker, run 3\n", "sep={}\n"], ids=["plain", "mark", "comment", "sep"]
)
def test_response_file_round_trip(tmp_path, separator, decimal, head):
    if "sep" in head and separator.isspace() and separator != "\t":
        head = ""  # spreadsheets name no blanks
    text = head.format(separator) + complex_table(shaken(), separator, decimal)
    curve = bc.read_frequency_response(written(tmp_path, text))
    assert curve.response is not None
    assert np.array_equal(curve.response.frdata, shaken())
    assert np.asarray(curve.response.omega) == pytest.approx(OMEGA, rel=1e-15)
    assert (curve.response.ninputs, curve.response.noutputs) == (2, 2)
    assert curve.magnitude == pytest.approx(bc.sigma(curve.response).sigma, rel=1e-12)
    assert "with phase, 2 x 2" in repr(curve)


def test_without_pyuff_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(ImportError, match=r"pip install 'boomctl\[uff\]'"):
        bc.read_frequency_response(tmp_path / "shaker.uff")


def test_names_may_stand_in_a_comment_as_numpy_writes_them(tmp_path):
    path = tmp_path / "saved.csv"
    table = np.column_stack([[0.5, 1.0], [3.0, 1.0], [0.5, 0.25]])
    np.savetxt(path, table, delimiter=";", header="shaken by hand\nfrequency_hz;re_1_1;im_1_1")
    curve = bc.read_frequency_response(path)
    np.testing.assert_array_equal(curve.frequency_hz, table[:, 0])
    np.testing.assert_array_equal(curve.frdata[0, 0], table[:, 1] + 1j * table[:, 2])
    np.savetxt(path, table)
    with pytest.raises(ValueError, match="line 1: expected a line of column names before the numbers"):
        bc.read_frequency_response(path)
