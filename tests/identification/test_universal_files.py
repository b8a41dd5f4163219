"""Universal files of every form, written here by the format's own words: read back whole, and never read when damaged."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from tests.profiles import examples
from tests.refusals import assert_refused, refusals
from tests.strategies import seeds

pytest.importorskip("pyuff", reason="universal files come with the extra uff")

MARK = "    -1"


def numbers(values, widths, a_line):
    """Return numbers as FORTRAN writes them, each of its width, some on a line."""
    words = [f"{x:{w}.{5 if w == 13 else 12}E}" for x, w in zip(values, widths, strict=True)]
    return ["".join(words[i : i + a_line]) for i in range(0, len(words), a_line)]


def units(length="1.0"):
    """Return the lines of a data set 164: by what lengths of SI are multiplied."""
    factors = f"{length:>25s}{1.0:25.16E}{1.0:25.16E}"
    return [MARK, f"{164:6d}", f"{1:10d}{'unknown':20s}{2:10d}", factors, f"{0.0:25.16E}", MARK]


def data_set(out, into, values, freq, *, double=True, even=False, unit="NONE", hertz="Hz", function=4):
    """Return the lines of a data set 58: response at a node along y to a force at a node along -z."""
    real = np.isrealobj(values)
    step = freq[1] - freq[0] if even else 0.0
    lines = [MARK, f"{58:6d}", *["NONE"] * 5]
    lines.append(f"{function:5d}{0:10d}{0:5d}{0:10d} {'tip':10s}{out:10d}{2:4d} {'shaker':10s}{into:10d}{-3:4d}")
    kind, first = (4 if real else 6) - (not double), freq[0] if even else 0.0
    lines.append(f"{kind:10d}{len(freq):10d}{int(even):10d}{first:13.5E}{step:13.5E}{0.0:13.5E}")
    for kind, word in ((18, hertz), (8, unit), (13, "N"), (0, "NONE")):
        lines.append(f"{kind:10d}{0:5d}{0:5d}{0:5d} {'axis':20s} {word:20s}")
    parts = values[:, None] if real else np.column_stack([values.real, values.imag])
    if even:
        width, a_line = (20, 4) if double else (13, 6)
        lines += numbers(parts.ravel(), [width] * parts.size, a_line)
    else:
        width = 20 if double else 13
        widths = [13, *([width] * parts.shape[1])]
        lines += numbers(np.column_stack([freq, parts]).ravel(), widths * len(freq), 3 if double else 6)
    return [*lines, MARK]


def drawn(rng):
    """Return frequencies, a response and the lines of a universal file that holds it, other data sets between."""
    double, even = rng.random(2) < 0.5
    count = int(rng.integers(2, 30))
    nodes = [np.sort(rng.choice(np.arange(1, 10**6), k, replace=False)) for k in rng.integers(1, 4, 2)]
    steps = np.full(count, 10.0 ** rng.uniform(-2, 1)) if even else rng.uniform(0.01, 3.0, count)
    freq = np.array([float(f"{x:.5E}") for x in np.cumsum([float(f"{x:.3e}") for x in steps])])
    response = rng.standard_normal((len(nodes[0]), len(nodes[1]), count, 2)) @ [1.0, 1j] * 10.0 ** rng.uniform(-9, 3)
    response[rng.random(response.shape) < 0.05] = 0.0
    places = [(o, i) for o in range(len(nodes[0])) for i in range(len(nodes[1]))]
    rng.shuffle(places)
    sets = []
    for o, i in places:
        sets.append(data_set(nodes[0][o], nodes[1][i], response[o, i], freq, double=double, even=even))
        if rng.random() < 0.3:
            sets.append([MARK, f"{151:6d}", "a header", "another", MARK])
    return freq, response, nodes, sets


def written(path, sets, end="\n"):
    path.write_bytes("".join(line + end for each in sets for line in each).encode())
    return path


@given(seeds, st.sampled_from(["\n", "\r\n"]))
@examples(100)
def test_a_universal_file_is_read_back_whole(tmp_path_factory, seed, end):
    freq, response, nodes, sets = drawn(np.random.default_rng(seed))
    curve = bc.read_frequency_response(written(tmp_path_factory.mktemp("uff") / "shaker.uff", sets, end))
    assert curve.output_labels == tuple(f"{k}+y" for k in nodes[0])
    assert curve.input_labels == tuple(f"{k}-z" for k in nodes[1])
    assert curve.frequency_hz == pytest.approx(freq, rel=1e-5)
    assert np.abs(np.asarray(curve.response.frdata) - response).max() <= 1e-5 * np.abs(response).max()


@given(seeds)
@examples(200)
def test_a_universal_file_that_lost_or_gained_lines_is_not_read(tmp_path_factory, seed):
    """Wherever in a data set 58 it was cut, or lines are gone or there twice, and where a unit's factor is no number."""
    rng = np.random.default_rng(seed)
    _, _, _, sets = drawn(rng)
    hit = int(rng.choice([k for k, each in enumerate(sets) if each[1].strip() == "58"]))
    damaged, way = [list(each) for each in sets], int(rng.integers(4))
    lines = damaged[hit]
    at = int(rng.integers(13, len(lines) - 1))
    if way == 0:
        damaged = [*damaged[:hit], lines[:at]]  # cut off
    elif way == 1:
        del lines[at]
    elif way == 2:
        lines.insert(at, lines[at])
    else:
        damaged.insert(0, units("NaN"))
    with pytest.raises(ValueError, match=r"shaker\.uff"):
        bc.read_frequency_response(written(tmp_path_factory.mktemp("uff") / "shaker.uff", damaged))


FREQ, ONE = np.array([1.0, 2.0]), data_set(1, 2, np.array([1.0, 1j]), np.array([1.0, 2.0]))


def entry(out=1, into=2, freq=FREQ, values=(1.0, 1j), **labels):
    return data_set(out, into, np.array(values), freq, **labels)


WITHOUT_RESPONSE = r"""
[entry(unit="mm/s2")] -> data set 1: expected SI units and frequencies in Hz, got the unit 'mm/s2'
[entry(unit="in/lbf")] -> got the unit 'in/lbf'
[entry(hertz="rad/s")] -> got the unit 'rad/s'
[units("1000.0"), ONE] -> unit of length is 1/1000 of that \(data set 164\)
[ONE, entry(3, 4)] -> response of 1\+y to 4-z is missing
[ONE, ONE] -> data set 2: .* is there twice
[ONE, entry(3, freq=3.0 * FREQ)] -> data set 2: .*freq
[entry(values=(1.0, 2.0))] -> complex frequency response, got real
[entry(function=1)] -> with frequency responses, got data sets 58
[entry(freq=FREQ[::-1])] -> ascending
[["freq_hz,upper", "1,2"]] -> shaker\.uff
[[MARK, "    58", "rubbish", MARK]] -> shaker\.uff: not a universal file
"""


@refusals(WITHOUT_RESPONSE)
def test_universal_file_without_response_is_refused(tmp_path, call, words):
    assert_refused(f"bc.read_frequency_response(written(tmp_path / 'shaker.uff', {call}))", words, globals() | locals())


@pytest.mark.parametrize(
    "labels", [{"unit": "m/s^2"}, {"unit": "(m/s2)/N"}, {"unit": "kg m"}, {"unit": ""}, {"hertz": "HERTZ"}]
)
def test_numbers_in_si_units_are_read(tmp_path, labels):
    coherence = entry(values=(1.0, 1.0), function=6)  # what is no response is left out
    curve = bc.read_frequency_response(written(tmp_path / "shaker.unv", [coherence, entry(**labels)]))
    assert curve.frequency_hz.tolist() == [1.0, 2.0]
    assert curve.frdata.ravel().tolist() == [1.0, 1j]


def test_binary_universal_file_is_the_text_one(tmp_path):
    """The head of a data set 58b is text, its numbers are doubles; these are written here, not by the reader's package."""
    values, freq = np.array([1.0 - 2.0j, np.pi + 1j, 1e-9j, -3.0]), 0.5 * np.arange(1, 5)
    lines = "".join(f"{line}\n" for line in data_set(1, 1, values, freq, even=True)).encode().splitlines(keepends=True)
    head = b"    58b     1     2          11%12d     0     0           0           0\n" % (16 * len(values))
    path = tmp_path / "binary.uff"
    path.write_bytes(b"".join([lines[0], head, *lines[2:13], values.astype("<c16").tobytes(), b"\n    -1\n"]))
    curve = bc.read_frequency_response(path)
    assert curve.frequency_hz.tolist() == freq.tolist()
    assert curve.frdata.ravel().tolist() == values.tolist()


def test_universal_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(OSError, match=r"shaker\.uff"):
        bc.read_frequency_response(tmp_path / "shaker.uff")
