"""C code of any names, numbers and measurements: compiled with every warning an error, and run."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exceptions import WindupWarning
from boomctl.exchange.c_code import RunningController, c_files
from boomctl.lti.system import of
from boomctl.simulation.conditioning import correction
from tests.exchange.cases import CC, compiled, ran
from tests.profiles import examples
from tests.strategies import seeds

# what ends a comment or a line, names a word to be filled in, or is not seen
MARKS = ["*/", "/*", "??/", "??=", "\\", "\\\n", "\n", "\r", "\u2028", "\x85", "\0", "\u202e", "\u2066", "\ud800", "@FOO@",
         "@NAME@", "#error no", "//", '"', "'", "%s", "é", "µ", "\U0001d518", "int x;", "[m/s^2]"]  # fmt: skip
pytestmark = pytest.mark.skipif(CC is None, reason="no C compiler")

pieces = st.one_of(st.sampled_from(MARKS), st.characters(exclude_characters="."), st.sampled_from("abc_*/?\\@"))
words = st.lists(pieces, min_size=1, max_size=8).map("".join)


@given(names=st.lists(words, min_size=12, max_size=12, unique=True), units=st.lists(words, min_size=12, max_size=12))
@examples(60)
def test_names_and_units_stay_within_their_comment(tmp_path_factory, names, units):
    folder = tmp_path_factory.mktemp("c")
    K = control.ss([[0.5]], np.ones((1, 9)), np.ones((3, 1)), 0.0, 0.01, inputs=names[:9], outputs=names[9:])
    bc.write_controller(K, folder / "loop.c", units=dict(zip(names, units, strict=True)), control_limit=1.0)
    header = (folder / "loop.h").read_bytes().decode()
    listed = header.split(" * Measurements:\n")[1].split(" *\n")[0].split("\n")
    assert [line.split(":")[0] for line in listed] == [
        *(f" *   {i}" for i in range(9)), " * Controls", *(f" *   {i}" for i in range(3)), "",
    ]  # fmt: skip
    assert all(letter.isprintable() or letter == "\n" for letter in header)
    assert ran(folder).returncode == 0


def _random_controller(rng):
    n, p, m = int(rng.integers(0, 5)), int(rng.integers(1, 4)), int(rng.integers(1, 4))
    A = rng.standard_normal((n, n))
    if n:
        A *= (
            10.0 ** rng.choice([rng.uniform(-1.0, 0.0), 0.0, rng.uniform(0.0, 4.0)])
            / np.abs(np.linalg.eigvals(A)).max()
        )
    others = [rng.standard_normal(shape) for shape in ((n, p), (m, n), (m, p))]
    B, C, D = (10.0 ** (rng.choice([0.0, 0.0, rng.uniform(-99.0, 99.0)])) * each for each in others)
    K = control.ss(A, B, C, D, 0.01, inputs=[f"y{i}" for i in range(p)], outputs=[f"u{i}" for i in range(m)])
    limits = {
        f"{kind}_limit": {f"u{i}": float(10.0 ** rng.uniform(-3.0, 3.0)) for i in range(m) if rng.random() < 0.5}
        for kind in ("force", "rate")
    }
    return K, limits


@pytest.mark.parametrize(("gain", "compiles"), [(3e38, True), (4e38, False), (-4e38, False)])
def test_c_code_gain_beyond_single_precision_does_not_compile(tmp_path, gain, compiles):
    bc.write_controller(control.ss([], [], [], [[gain]], 0.01, inputs="y", outputs="u"), tmp_path / "loop.c")
    made = compiled(tmp_path, "-DLOOP_SINGLE")
    assert (made.returncode == 0) == compiles
    assert compiles or "loop: numbers exceed the range of single precision" in made.stderr


_DRIVER = """
#include "loop.h"
#include <math.h>
#include <stdio.h>
static const double MEASURED[][LOOP_MEASUREMENTS] = {%s};
int main(void)
{
    loop_controller controller;
    int k, i;
    loop_reset(&controller);
    for (k = 0; k < (int)(sizeof MEASURED / sizeof MEASURED[0]); k++) {
        loop_real y[LOOP_MEASUREMENTS], u[LOOP_CONTROLS];
        for (i = 0; i < LOOP_MEASUREMENTS; i++) y[i] = (loop_real)MEASURED[k][i];
        printf("%%d", loop_step(&controller, y, u));
        for (i = 0; i < LOOP_CONTROLS; i++) printf(" %%a", (double)u[i]);
        printf("\\n");
    }
    return 0;
}
"""


@given(seed=seeds)
@examples(60)
def test_c_code_any_measurements_give_finite_controls(tmp_path_factory, seed):
    """Those of Python's own sums, bit by bit; where one is no number, the last ones, and a return value that says so."""
    folder, rng = tmp_path_factory.mktemp("c"), np.random.default_rng(seed)
    K, limits = _random_controller(rng)
    own = of(K, any_time=True)
    p, m = len(own.input_labels), len(own.output_labels)
    force, rate = (
        np.array([limits[f"{kind}_limit"].get(f"u{i}", np.inf) for i in range(m)]) for kind in ("force", "rate")
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", WindupWarning)
        try:
            L = correction((own,), force, 0.01 * rate)[0]
        except ValueError:
            L = np.zeros((len(own.A), m))
    running = RunningController(own, L, force, 0.01 * rate)
    for name, text in c_files("loop", running, {}).items():
        (folder / name).write_text(text)
    size = 10.0 ** np.where(rng.random((40, 1)) < 0.5, 0.0, rng.uniform(-300.0, 308.0, (40, 1)))
    y = np.clip(rng.standard_normal((40, p)) * size, -1.7e308, 1.7e308)
    y[[20, 30], 0] = np.nan, -np.inf
    words = {"nan": "NAN", "-inf": "-INFINITY"}
    rows = ", ".join("{" + ", ".join(words.get(v.hex(), v.hex()) for v in row) + "}" for row in y.tolist())
    (folder / "driver.c").write_text(_DRIVER % rows)
    wanted = running.run(y)
    assert np.isfinite(wanted).all()
    lines = [line.split() for line in ran(folder, test="driver.c").stdout.splitlines()]
    np.testing.assert_array_equal([[float.fromhex(x) for x in line[1:]] for line in lines], wanted)
    for k, (said, *_) in enumerate(lines):
        assert said == "0" or not k or (wanted[k] == wanted[k - 1]).all()
    assert lines[20][0] == lines[30][0] == "1"
