"""Controllers to files and back: JSON and MATLAB to the last bit, C by compiling it, Octave by running it."""

import json
import re
import shutil
import subprocess

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exchange.c_code import RunningController, c_files
from boomctl.exchange.controller_files import controller_contents
from boomctl.lti.system import of
from tests.exchange.cases import CC, controller, ran
from tests.profiles import examples

OCTAVE = shutil.which("octave-cli")
SYMMETRIC = {"inputs": "stroke_sym", "outputs": "suspension_sym"}


def same(found, given):
    """Return whether two systems are alike to the last bit; python-control gives a gain no time of its own."""
    matrices = all(np.array_equal(getattr(found, letter), getattr(given, letter)) for letter in "ABCD")
    kinds = ("input_labels", "output_labels", "state_labels")
    return matrices and (found.dt or 0.0) == given.dt and all(getattr(found, k) == getattr(given, k) for k in kinds)


@pytest.mark.parametrize("suffix", [".json", ".mat"])
@given(
    seed=st.integers(0, 1000),
    states=st.integers(0, 6),
    inputs=st.integers(1, 3),
    outputs=st.integers(1, 3),
    dt=st.sampled_from([0.0, 0.01, True]),
)
@examples(30)
def test_what_is_written_is_read_to_the_last_bit(tmp_path_factory, suffix, seed, states, inputs, outputs, dt):
    K = controller(seed, states, inputs, outputs, dt)
    path = tmp_path_factory.mktemp("files") / f"k{suffix}"
    bc.write_controller(K, path)
    assert same(bc.read_controller(path), K)


def test_a_result_is_written_with_its_certificate(tmp_path):
    plant = control.ss([[0.0, 1.0], [-4.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="torque", outputs="tip")
    design = bc.lqg(plant, np.eye(2), 1.0, np.eye(2), 0.1)
    bc.write_controller(design, tmp_path / "lqg.json", provenance={"plant": "a mass"})
    assert same(bc.read_controller(tmp_path / "lqg.json"), design.controller)
    notes = bc.exchange.read_controller_metadata(tmp_path / "lqg.json")
    assert notes.units == {"tip": "m", "torque": "N m"}
    assert notes.certificate["lower_bound"] == pytest.approx(design.certificate.lower_bound)
    assert notes.certificate["regulator_riccati"]["abscissa"] < 0.0
    assert notes.provenance["boomctl"] == bc.__version__
    assert notes.provenance["plant"] == "a mass"


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("states", [0, 7])
def test_c_code_in_single_precision_is_close(tmp_path, states):
    limits = {"control_limit": {"suspension_0": 2.0}, "rate_limit": 30.0}
    bc.write_controller(controller(3, states, 3, 2, 0.01), tmp_path / "loop.c", **limits)
    single = ran(tmp_path, "-O2", "-DLOOP_SINGLE")
    assert single.returncode == 0, single.stdout
    off, largest = (float(part.split()[-1]) for part in single.stdout.split(","))
    assert 0.0 < off < 1e-5 * largest


def test_c_code_test_covers_limits():
    """Of what is measured in it: the first half asks for no more than each limit allows, the second for more of one."""
    own = of(controller(3, 4, 2, 2, 0.01), any_time=True)
    force, step, none = np.array([0.7, np.inf]), np.array([0.2, 0.4]), np.full(2, np.inf)
    text = c_files("loop", RunningController(own, np.zeros((4, 2)), force, step), {})["loop_test.c"]
    table = re.search(r"measured\[.*?= \{\n(.*?)\n\};", text, re.DOTALL | re.IGNORECASE)[1]
    measured = np.array([[float.fromhex(x) for x in re.findall(r"-?0x[\w.+-]+", row)] for row in table.splitlines()])
    free = RunningController(own, np.zeros((4, 2)), none, none).run(measured)
    within = (np.abs(free) <= force) & (np.abs(np.diff(free, axis=0, prepend=0.0)) <= step)
    assert within[: len(measured) // 2].all()
    assert not within[len(measured) // 2 :].all()


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_comparison_fails_where_a_number_is_wrong(tmp_path):
    K = controller(3, 4, 2, 2, 0.01)
    bc.write_controller(K, tmp_path / "loop.c", control_limit=1.0)
    code = (tmp_path / "loop.c").read_text()
    first = float(K.C[0, 0]).hex()
    assert first in code
    (tmp_path / "loop.c").write_text(code.replace(first, float(np.nextafter(K.C[0, 0], 9.0)).hex(), 1))
    assert ran(tmp_path).returncode == 1
    (tmp_path / "loop.c").write_text(code.replace(first, float(K.C[0, 0] * 1e3).hex(), 1))
    assert ran(tmp_path, "-DLOOP_SINGLE").returncode == 1


def test_the_running_controller_is_that_of_simulate_loop():
    """In a loop with limits both give the same controls to the same measurements, but for the order of sums."""
    plant = control.ss([[0.0, 1.0], [-9.0, -0.1]], [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0]], 0.0,
                       inputs=["suspension_0", "push"], outputs="stroke_0")  # fmt: skip
    K = controller(5, 3, 1, 1, 0.01)
    t = np.arange(0.0, 2.0, 0.01)
    run = bc.simulate_loop(
        plant, K, t, {"push": 30.0 * np.sin(9.0 * t)}, sample_time=0.01, control_limit=0.6, rate_limit=20.0
    )
    assert run.saturation_fraction["suspension_0"] > 0.05
    from tests.simulation.cases import conditioning_gain

    own = of(K, any_time=True)
    running = RunningController(own, conditioning_gain(own.A, own.B, own.C, own.D), np.array([0.6]), np.array([0.2]))
    found = running.run(run.outputs["stroke_0"][:, None])[:, 0]
    assert np.abs(found - run.controls["suspension_0"]).max() < 1e-12


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="no Octave")
@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_octave_rebuilds_the_controller_with_its_names(tmp_path, dt):
    K = controller(2, 4, 3, 2, dt)
    bc.write_controller(K, tmp_path / "kept.mat")
    at = 2.3j if dt == 0.0 else complex(np.exp(2.3j * dt))
    script = (
        f"K = kept (); s = {at.real!r} + {at.imag!r}i; G = K.c * inv (s * eye (4) - K.a) * K.b + K.d;"
        "printf ('%.17g %.17g\\n', [real(G(:))'; imag(G(:))']); u = K.inname; y = K.outname; x = K.stname; "
        "printf ('%s\\n', u{:}, y{:}, x{:});"
        "printf ('%.17g\\n', K.tsam);"
    )
    run = subprocess.run([OCTAVE, "--no-gui", "--eval", script], cwd=tmp_path, capture_output=True, text=True)
    lines = run.stdout.splitlines()
    assert len(lines) == 6 + 3 + 2 + 4 + 1, run.stderr
    found = np.array([complex(*map(float, line.split())) for line in lines[:6]]).reshape(3, 2).T
    assert np.abs(found - K(at)).max() < 1e-13
    assert lines[6:15] == [*K.input_labels, *K.output_labels, *K.state_labels]
    assert float(lines[15]) == dt


GAIN = np.ones((1, 2))
REFUSED = [
    ("k.txt", controller(), {}, "unknown suffix '.txt'"),
    ("k.c", controller(), {}, "expected sample_time"),
    ("2k.c", controller(), {"sample_time": 0.01}, "no name in C"),
    ("k-2.mat", controller(), {}, "no name of a MATLAB function"),
    ("k.json", controller(), {"rate_limit": 1.0}, "are written to C files alone"),
    ("k.json", controller(), {"units": {"tip": "m"}}, "unknown signal 'tip'"),
    ("a\ud800b.json", controller(), {}, "expected a path without null characters"),
    ("k.mat", controller(), {"units": {"stroke_0": "force\0"}}, "expected one without null characters and surrogates"),
    ("k.mat", controller(dt=0.1), {"sample_time": 0.2}, "the controller's own is 0.1 s"),
    ("k.mat", control.ss([], [], [], GAIN, inputs=["y", "y"], outputs="u"), {}, "each of 2 inputs, got 1: y"),
    ("k.mat", control.ss(-np.eye(2), GAIN.T, GAIN, 0.0, states=["x", "x"]), {}, "each of 2 states, got 1"),
    ("k.mat", control.ss([], [], [], GAIN[:, :1], inputs="force\0", outputs="u"), {}, "without null characters"),
]


@pytest.mark.parametrize(("name", "K", "options", "message"), REFUSED)
def test_write_controller_that_cannot_raises_and_writes_nothing(name, K, options, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        bc.write_controller(K, tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []


OTHER_FILES = [
    ("k.json", "nothing", "not a JSON file"),
    ("k.json", '{"format": "boomctl controller", "version": 9}', "its version is 9; expected 1"),
    ("k.mat", "nothing", "not a MATLAB file"),
]


@pytest.mark.parametrize(("name", "text", "message"), OTHER_FILES)
def test_read_controller_of_another_file_raises(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=message):
        bc.read_controller(tmp_path / name)


def test_units_of_rates_come_before_those_of_places():
    names = ["stroke_left", "tip_left_acceleration", "cradle_speed", "hub_angle", "hub_speed", "other"]
    K = control.ss([], [], [], np.ones((1, 6)), 0.01, inputs=names, outputs="torque")
    notes = json.loads(controller_contents(K, "k", ".json")["k.json"])["units"]
    assert [notes[name] for name in (*names, "torque")] == ["m", "m/s^2", "m/s", "rad", "rad/s", "", "N m"]


def test_c_needs_signals():
    own = of(control.ss([], [], [], np.zeros((1, 1)), 0.1), any_time=True).between([], [0])
    with pytest.raises(ValueError, match="at least one input and one output"):
        c_files("none", RunningController(own, np.zeros((0, 1)), np.array([np.inf]), np.array([np.inf])), {})


@pytest.mark.parametrize("suffix", [".json", ".mat", ".c"])
def test_write_subsystem_controller_raises(tmp_path, suffix):
    signals = {"inputs": "stroke_anti", "outputs": "suspension_anti"}
    K, path = control.ss([], [], [], [[-100.0]], 0.01, **signals), tmp_path / f"yaw{suffix}"
    with pytest.raises(
        ValueError, match=r"'stroke_anti' is a signal of a symmetric or antisymmetric subsystem.*join_symmetric"
    ):
        bc.write_controller(K, path)
    written = bc.write_controller(K, path, allow_subsystem=True)
    if suffix == ".json":
        notes = bc.exchange.read_controller_metadata(path)
        assert notes.units["suspension_anti"] == "N (sqrt(2) times half the difference)"
    else:
        assert path in written
    whole = bc.join_symmetric(bc.spray_boom(), control.ss([], [], [], [[-1.0]], 0.01, **SYMMETRIC), K)
    assert bc.write_controller(whole, tmp_path / f"boom{suffix}")
