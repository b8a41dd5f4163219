"""Measured curves and responses from CSV and universal files, good and malformed."""

import pickle
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from tests.profiles import examples


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


_NO_MAGNITUDES = {
    "phase": "a phase",
    "deg": "a phase",
    "phi": "a phase",
    "dB": "decibels",
    "magdb": "decibels",
    "real": "a part of complex numbers",
    "im": "a part of complex numbers",
    "coherence": "a coherence",
}
_STEMS = st.sampled_from(["upper", "tip", "mag", "sigma1", "yaw angle", "1", "redback", "degas", "reach", "imbalance"])


def _spelled(draw, word):
    return draw(st.sampled_from([word, word.upper(), word.capitalize()]))


@given(st.data(), st.sampled_from(sorted(_NO_MAGNITUDES)), _STEMS, st.sampled_from(["_", " ", "(", "[", "-", "/"]))
@examples(300)
def test_columns_that_are_no_magnitudes_are_refused(tmp_path_factory, data, word, stem, mark):
    """However they are spelled and wherever the word stands; words that begin alike are names as any."""
    named = _spelled(data.draw, word)
    name = data.draw(st.sampled_from([f"{stem}{mark}{named}", f"{named}{mark}{stem}", named]))
    path = tmp_path_factory.mktemp("curve") / "curve.csv"
    columns = data.draw(st.permutations(["lower", name]))
    path.write_text(f"freq_hz;{';'.join(columns)}\n0.1;8;1\n0.2;9;1\n")
    with pytest.raises(ValueError, match=rf"line 1: .*(the name of {_NO_MAGNITUDES[word]};|re_OUT_IN and im_OUT_IN)"):
        bc.read_measured_curve(path)
    path.write_text(f"freq_hz;lower;{stem}\n0.1;8;1\n0.2;9;1\n")
    assert bc.read_measured_curve(path).labels == ("lower", stem)
    path.write_text(f"freq_hz;{stem};lower;{stem}\n0.1;8;1;2\n")
    with pytest.raises(ValueError, match=r"line 1: column .* is there twice"):
        bc.read_measured_curve(path)


def test_a_file_that_is_not_there_is_said_so(tmp_path):
    with pytest.raises(OSError, match=r"none\.csv"):
        bc.read_measured_curve(tmp_path / "none.csv")


# -- complex responses, dialects, universal files -----------------------------------------------------------------------

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
def test_a_complex_response_comes_back_to_the_last_bit_from_each_dialect(tmp_path, separator, decimal, head):
    if "sep" in head and separator.isspace() and separator != "\t":
        head = ""  # spreadsheets name no blanks
    text = head.format(separator) + complex_table(shaken(), separator, decimal)
    curve = bc.read_measured_curve(written(tmp_path, text))
    assert curve.response is not None
    assert np.array_equal(curve.response.frdata, shaken())
    assert np.asarray(curve.response.omega) == pytest.approx(OMEGA, rel=1e-15)
    assert (curve.response.ninputs, curve.response.noutputs) == (2, 2)
    assert curve.magnitude == pytest.approx(bc.sigma(curve.response).sigma, rel=1e-12)


def test_magnitudes_of_a_spreadsheet_are_those_of_the_file_with_points(tmp_path):
    curve = bc.read_measured_curve(written(tmp_path, "sep=;\nfreq_hz;upper;lower\n0,1;8;1,25\n0,2;9,5;1e-1\n"))
    assert curve.magnitude.tolist() == [[8.0, 9.5], [1.25, 0.1]]
    assert curve.response is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "freq_hz;upper\n0,1;1\n0.2;1\n",
            "decimal commas or decimal points, got a comma in line 2 and a point in line 3",
        ),
        ("freq_hz;upper\n0,1;1.000,5\n", "decimal commas or decimal points"),
        ("freq_hz,upper\n0,1,8,5\n", "expected 2 values, got 4; decimal commas need semicolons"),
        ("freq_hz upper\n0,1 1.5\n", "decimal commas or decimal points, got a comma in line 2 and a point in line 2"),
        ("freq_hz upper\n0,1 1,5 2\n", "expected 2 values, got 3"),
        ("freq_hz;upper\n0,1;1,2,3\n", "line 2: expected a number in 'upper', got '1.2.3'"),
        ("freq_hz,re_1_1,im_1_1,re_1_1\n1,1,1,1\n", "line 1: column 're_1_1' is there twice"),
        ("freq_hz,re_1_1,im_1_1,re_999999_999999\n1,1,1,1\n", "re_1_2 is missing"),
    ],
)
def test_a_malformed_dialect_is_refused_with_its_place(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        bc.read_measured_curve(written(tmp_path, text))


def universal(tmp_path, sets, name="shaker.uff"):
    pyuff = pytest.importorskip("pyuff", reason="universal files come with the extra uff")
    path = tmp_path / name
    for number, each in enumerate(sets):
        pyuff.UFF(str(path)).write_sets(each, "overwrite" if number == 0 else "add")
    return path


def data_set(out, into, values, freq=None, **other):
    """Return data set 58 of one entry: response at a node along y, excitation at a node along y."""
    freq = OMEGA / (2 * np.pi) if freq is None else freq
    given = {
        "type": 58,
        "binary": 0,
        "func_type": 4,
        "rsp_node": out,
        "rsp_dir": 2,
        "ref_node": into,
        "ref_dir": -2,
        "data": values,
        "x": freq,
        "id1": "measured",
        "rsp_ent_name": "tip",
        "ref_ent_name": "shaker",
        "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 8,
        "orddenom_spec_data_type": 8,
        "abscissa_spacing": 0,
        "abscissa_min": 0.0,
        "abscissa_inc": 0.0,
        "z_axis_value": 0.0,
        "ver_num": 0,
        "id2": "",
        "id3": "",
        "id4": "",
        "id5": "",
        "load_case_id": 0,
        "ord_data_type": 6,
        "num_pts": len(freq),
    }
    for axis in ("abscissa", "ordinate", "orddenom", "z_axis"):
        given |= {f"{axis}_{unit}_unit_exp": 0 for unit in ("len", "force", "temp")}
        given |= {f"{axis}_axis_lab": "", f"{axis}_axis_units_lab": ""}
    return {"z_axis_spec_data_type": 0, **given, **other}


def test_a_universal_file_keeps_the_phase_and_the_places(tmp_path):
    response = shaken()
    sets = [data_set(3 - o, 7 - i, response[o, i]) for o in (0, 1) for i in (0, 1)]
    curve = bc.read_measured_curve(universal(tmp_path, sets))
    assert curve.outputs == ("2+y", "3+y")  # by node: the second output of the response is node 2
    assert curve.inputs == ("6-y", "7-y")
    digits = 1e-6  # of a frequency, which data sets 58 hold in single precision
    assert curve.freq_hz == pytest.approx(OMEGA / (2 * np.pi), rel=digits)
    assert np.asarray(curve.response.frdata) == pytest.approx(response[::-1, ::-1], rel=digits)
    assert curve.magnitude == pytest.approx(bc.sigma(curve.response).sigma, rel=1e-12)


def test_a_binary_universal_file_is_the_text_one(tmp_path):
    """The head of a data set 58b is text, its numbers are doubles; these are written here, not by the reader's package."""
    one = shaken()[0, 0]
    even = {"abscissa_spacing": 1, "abscissa_min": 0.5, "abscissa_inc": 0.5}
    text = universal(tmp_path, [data_set(1, 1, one, freq=0.5 * np.arange(1, 5), **even)])
    lines = text.read_bytes().splitlines(keepends=True)
    size = b"%12d" % (16 * len(one))
    head = b"    58b     1     2          11" + size + b"     0     0           0           0\n"
    numbers = np.ascontiguousarray(one).astype("<c16").tobytes()
    path = tmp_path / "binary.uff"
    path.write_bytes(b"".join([lines[0], head, *lines[2:13], numbers, b"\n    -1\n"]))
    curve = bc.read_measured_curve(path)
    assert curve.freq_hz.tolist() == [0.5, 1.0, 1.5, 2.0]
    assert np.array_equal(np.asarray(curve.response.frdata)[0, 0], one)


def test_what_stands_beside_responses_in_a_universal_file_is_left_out(tmp_path):
    one = shaken()[0, 0]
    sets = [data_set(1, 1, np.abs(one), func_type=6, ord_data_type=4), data_set(1, 1, one)]
    curve = bc.read_measured_curve(universal(tmp_path, sets, "shaker.unv"))
    assert curve.magnitude[0] == pytest.approx(np.abs(one), rel=1e-6)


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (lambda g: [data_set(1, 1, g[0, 0]), data_set(2, 2, g[1, 1])], r"response of 1\+y to 2-y is missing"),
        (lambda g: [data_set(1, 1, g[0, 0]), data_set(1, 1, g[0, 1])], "data set 2: .* is there twice"),
        (
            lambda g: [data_set(1, 1, g[0, 0]), data_set(2, 1, g[0, 1][:2], freq=np.array([1.0, 2.0]))],
            "data set 2: .*freq",
        ),
        (lambda g: [data_set(1, 1, np.abs(g[0, 0]), ord_data_type=4)], "complex frequency response, got real"),
        (lambda g: [data_set(1, 1, g[0, 0], func_type=1)], "with frequency responses, got data sets 58"),
        (lambda g: [data_set(1, 1, g[0, 0], freq=np.array([1.0, 3.0, 2.0, 4.0]))], "ascending"),
        (lambda g: [_UNITS, data_set(1, 1, g[0, 0])], r"unit of length is 1/1000 of that \(data set 164\)"),
    ],
    ids=["hole", "twice", "other frequencies", "no phase", "no response", "not ascending", "millimetres"],
)
def test_a_universal_file_that_makes_no_response_is_refused(tmp_path, sets, message):
    with pytest.raises(ValueError, match=message):
        bc.read_measured_curve(universal(tmp_path, sets(shaken())))


_UNITS = {
    "type": 164,
    "units_code": 9,
    "units_description": "mm (milli-newton)",
    "temp_mode": 1,
    "length": 1000.0,
    "force": 1.0,
    "temp": 1.0,
    "temp_offset": 273.15,
}


def test_a_universal_file_that_is_none_or_not_there_is_said_so(tmp_path):
    pytest.importorskip("pyuff", reason="universal files come with the extra uff")
    path = tmp_path / "shaker.uff"
    with pytest.raises(OSError, match=r"shaker\.uff"):
        bc.read_measured_curve(path)
    path.write_text("freq_hz,upper\n1,2\n")
    with pytest.raises(ValueError, match=r"shaker\.uff"):
        bc.read_measured_curve(path)
    path.write_text("    -1\n    58\nrubbish\n    -1\n")
    with pytest.raises(ValueError, match=r"shaker\.uff: not a universal file"):
        bc.read_measured_curve(path)


def test_without_pyuff_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(ImportError, match=r"pip install 'boomctl\[uff\]'"):
        bc.read_measured_curve(tmp_path / "shaker.uff")


def test_a_curve_with_phase_pickles_and_prints(tmp_path):
    curve = bc.read_measured_curve(written(tmp_path, complex_table(shaken())))
    again = pickle.loads(pickle.dumps(curve))
    assert np.array_equal(again.response.frdata, curve.response.frdata)
    assert "with phase, 2 x 2" in repr(curve)


def test_names_may_stand_in_a_comment_as_numpy_writes_them(tmp_path):
    path = tmp_path / "saved.csv"
    table = np.column_stack([[0.5, 1.0], [3.0, 1.0], [0.5, 0.25]])
    np.savetxt(path, table, delimiter=";", header="shaken by hand\nfrequency_hz;re_1_1;im_1_1")
    curve = bc.read_measured_curve(path)
    np.testing.assert_array_equal(curve.freq_hz, table[:, 0])
    np.testing.assert_array_equal(curve.entries[0, 0], table[:, 1] + 1j * table[:, 2])
    np.savetxt(path, table)
    with pytest.raises(ValueError, match="line 1: expected a line of column names before the numbers"):
        bc.read_measured_curve(path)
