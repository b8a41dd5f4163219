"""Universal files of every form, written here by the format's own words: read back whole, and never read when damaged."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from tests.profiles import examples
from tests.strategies import seeds

pytest.importorskip("pyuff", reason="universal files come with the extra uff")

MARK = "    -1"


def numbers(values, widths, a_line):
    """Return numbers as FORTRAN writes them, each of its width, some on a line."""
    words = [f"{x:{w}.{5 if w == 13 else 12}E}" for x, w in zip(values, widths, strict=True)]
    return ["".join(words[i : i + a_line]) for i in range(0, len(words), a_line)]


def data_set(out, into, values, freq, *, double, even, unit="NONE", hertz="Hz"):
    """Return the lines of a data set 58: response at a node along y to a force at a node along -z."""
    step = freq[1] - freq[0] if even else 0.0
    lines = [MARK, f"{58:6d}", *["NONE"] * 5]
    lines.append(f"{4:5d}{0:10d}{0:5d}{0:10d} {'tip':10s}{out:10d}{2:4d} {'shaker':10s}{into:10d}{-3:4d}")
    lines.append(
        f"{6 if double else 5:10d}{len(freq):10d}{int(even):10d}{freq[0] if even else 0.0:13.5E}{step:13.5E}{0.0:13.5E}"
    )
    for kind, word in ((18, hertz), (8, unit), (13, "N"), (0, "NONE")):
        lines.append(f"{kind:10d}{0:5d}{0:5d}{0:5d} {'axis':20s} {word:20s}")
    parts = np.column_stack([values.real, values.imag])
    if even:
        width, a_line = (20, 4) if double else (13, 6)
        lines += numbers(parts.ravel(), [width] * parts.size, a_line)
    else:
        width = 20 if double else 13
        lines += numbers(np.column_stack([freq, parts]).ravel(), [13, width, width] * len(freq), 3 if double else 6)
    return [*lines, MARK]


def drawn(rng):
    """Return frequencies, a response and the lines of a universal file that holds it, other data sets between."""
    double, even = rng.random(2) < 0.5
    count, nodes = (
        int(rng.integers(2, 30)),
        [rng.choice(np.arange(1, 10**6), k, replace=False) for k in rng.integers(1, 4, 2)],
    )
    nodes = [np.sort(each) for each in nodes]
    step = float(f"{10.0 ** rng.uniform(-2, 1):.3e}")
    freq = (
        step * np.arange(1, count + 1)
        if even
        else np.cumsum([float(f"{x:.2e}") for x in rng.uniform(0.01, 3.0, count)])
    )
    freq = np.array([float(f"{x:.5E}") for x in freq]) if not even else freq
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
    curve = bc.read_measured_curve(written(tmp_path_factory.mktemp("uff") / "shaker.uff", sets, end))
    assert curve.outputs == tuple(f"{k}+y" for k in nodes[0])
    assert curve.inputs == tuple(f"{k}-z" for k in nodes[1])
    assert curve.freq_hz == pytest.approx(freq, rel=1e-5)
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
        units = [
            MARK,
            f"{164:6d}",
            f"{1:10d}{'unknown':20s}{2:10d}",
            f"{'NaN':>25s}{1.0:25.16E}{1.0:25.16E}",
            f"{0.0:25.16E}",
            MARK,
        ]
        damaged.insert(0, units)
    with pytest.raises(ValueError, match=r"shaker\.uff"):
        bc.read_measured_curve(written(tmp_path_factory.mktemp("uff") / "shaker.uff", damaged))


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        ({"unit": "g"}, "'g'"),
        ({"unit": "mm/s2"}, "'mm/s2'"),
        ({"unit": "in/lbf"}, "'in/lbf'"),
        ({"hertz": "kHz"}, "'kHz'"),
        ({"hertz": "rad/s"}, "'rad/s'"),
    ],
)
def test_numbers_in_other_units_are_refused(tmp_path, labels, said):
    one = data_set(1, 2, np.array([1.0, 1j]), np.array([1.0, 2.0]), double=True, even=False, **labels)
    with pytest.raises(ValueError, match=f"data set 1: expected SI units and frequencies in Hz, got the unit {said}"):
        bc.read_measured_curve(written(tmp_path / "shaker.uff", [one]))


@pytest.mark.parametrize(
    "labels", [{"unit": "m/s^2"}, {"unit": "(m/s2)/N"}, {"unit": "kg m"}, {"unit": ""}, {"hertz": "HERTZ"}]
)
def test_numbers_in_si_units_are_read(tmp_path, labels):
    one = data_set(1, 2, np.array([1.0, 1j]), np.array([1.0, 2.0]), double=True, even=False, **labels)
    assert bc.read_measured_curve(written(tmp_path / "shaker.uff", [one])).freq_hz.tolist() == [1.0, 2.0]
