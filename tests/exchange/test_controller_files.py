"""Controllers to files and back: JSON and MATLAB to the last bit, C by compiling it, Octave by running it."""

import json
import shutil
import subprocess

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exchange.c_code import RunningController, c_files
from boomctl.lti.system import of
from tests.profiles import examples

CC = shutil.which("cc")
OCTAVE = shutil.which("octave-cli")
SYMMETRIC = {"inputs": "stroke_sym", "outputs": "suspension_sym"}
STRICT = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]


def controller(seed=0, states=5, inputs=2, outputs=2, dt=0.0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    A = 0.3 * A / max(np.abs(np.linalg.eigvals(A)).max(), 1.0) if states else A
    if dt == 0.0:
        A = A - 2.0 * np.eye(states)
    return control.ss(
        A, rng.standard_normal((states, inputs)), rng.standard_normal((outputs, states)),
        rng.standard_normal((outputs, inputs)), dt,
        inputs=[f"stroke_{i}" for i in range(inputs)], outputs=[f"suspension_{i}" for i in range(outputs)],
    )  # fmt: skip


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
    notes = bc.exchange.read_controller_notes(tmp_path / "lqg.json")
    assert notes.units == {"tip": "m", "torque": "N m"}
    assert notes.certificate["lower"] == pytest.approx(design.certificate.lower)
    assert notes.certificate["riccati"]["abscissa"] < 0.0
    assert notes.provenance["boomctl"] == bc.__version__
    assert notes.provenance["plant"] == "a mass"


def compiled(folder, name, *flags):
    sources = [f"{name}.c", f"{name}_test.c"]
    made = subprocess.run([CC, *STRICT, *flags, *sources, "-o", "run"], cwd=folder, capture_output=True, text=True)
    assert not made.returncode, made.stderr
    return subprocess.run([folder / "run"], capture_output=True, text=True)


LIMITS = {
    "none": {},
    "force": {"force_limit": 1.0},
    "rate": {"rate_limit": {"suspension_1": 20.0}},
    "both": {"force_limit": {"suspension_0": 2.0}, "rate_limit": 30.0},
    "no correction": {"force_limit": 1.0, "anti_windup": False},
}


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("states", [0, 7])
def test_c_code_same_bits_in_double_and_close_in_single(tmp_path, limits, states):
    K = controller(3, states, 3, 2, 0.01)
    bc.write_controller(K, tmp_path / "loop.c", **LIMITS[limits])
    double = compiled(tmp_path, "loop")
    assert double.returncode == 0
    assert double.stdout == "double precision: off by 0\n"
    single = compiled(tmp_path, "loop", "-DLOOP_SINGLE")
    assert single.returncode == 0, single.stdout
    off, largest = (float(part.split()[-1]) for part in single.stdout.split(","))
    assert 0.0 < off < 1e-5 * largest


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_comparison_fails_where_a_number_is_wrong(tmp_path):
    K = controller(3, 4, 2, 2, 0.01)
    bc.write_controller(K, tmp_path / "loop.c", force_limit=1.0)
    code = (tmp_path / "loop.c").read_text()
    first = float(K.C[0, 0]).hex()
    assert first in code
    (tmp_path / "loop.c").write_text(code.replace(first, float(np.nextafter(K.C[0, 0], 9.0)).hex(), 1))
    assert compiled(tmp_path, "loop").returncode == 1
    (tmp_path / "loop.c").write_text(code.replace(first, float(K.C[0, 0] * 1e3).hex(), 1))
    assert compiled(tmp_path, "loop", "-DLOOP_SINGLE").returncode == 1


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_a_measurement_that_is_no_number_holds_the_control(tmp_path):
    bc.write_controller(controller(1, 3, 1, 1, 0.01), tmp_path / "loop.c")
    (tmp_path / "loop_test.c").write_text(
        "#include <math.h>\n"
        '#include "loop.h"\n'
        "int main(void)\n{\n"
        "    loop_controller c;\n    double y = 1.0, u = 0.0, held, next;\n"
        "    loop_reset(&c);\n"
        "    if (loop_step(&c, &y, &u) != 0) return 1;\n"
        "    held = u;\n    y = NAN;\n"
        "    if (loop_step(&c, &y, &u) != 1 || u != held) return 2;\n"
        "    y = INFINITY;\n"
        "    if (loop_step(&c, &y, &u) != 1 || u != held) return 3;\n"
        "    y = 0.5;\n    if (loop_step(&c, &y, &next) != 0 || !(next == next)) return 4;\n"
        "    return 0;\n}\n"
    )
    assert compiled(tmp_path, "loop").returncode == 0


def test_the_running_controller_is_that_of_simulate_loop():
    """In a loop with limits both give the same controls to the same measurements, but for the order of sums."""
    plant = control.ss([[0.0, 1.0], [-9.0, -0.1]], [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0]], 0.0,
                       inputs=["suspension_0", "push"], outputs="stroke_0")  # fmt: skip
    K = controller(5, 3, 1, 1, 0.01)
    t = np.arange(0.0, 2.0, 0.01)
    run = bc.simulate_loop(
        plant, K, {"push": 30.0 * np.sin(9.0 * t)}, t, sample_time=0.01, force_limit=0.6, rate_limit=20.0
    )
    assert run.saturation_share["suspension_0"] > 0.05
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


def test_what_cannot_be_written_is_refused_and_nothing_is_left(tmp_path):
    K = controller()
    refused = [
        (ValueError, "unknown suffix '.txt'", lambda: bc.write_controller(K, tmp_path / "k.txt")),
        (ValueError, "expected sample_time", lambda: bc.write_controller(K, tmp_path / "k.c")),
        (ValueError, "no name in C", lambda: bc.write_controller(K, tmp_path / "2k.c", sample_time=0.01)),
        (ValueError, "no name of a MATLAB function", lambda: bc.write_controller(K, tmp_path / "k-2.mat")),
        (ValueError, "are written to C files alone", lambda: bc.write_controller(K, tmp_path / "k.json", rate_limit=1)),
        (ValueError, "unknown signal 'tip'", lambda: bc.write_controller(K, tmp_path / "k.json", units={"tip": "m"})),
        (TypeError, "controller: expected StateSpace", lambda: bc.write_controller(1.0, tmp_path / "k.json")),
        (TypeError, "certificate: expected", lambda: bc.write_controller(K, tmp_path / "k.json", certificate=3)),
        (ValueError, "the controller's own is 0.1 s",
         lambda: bc.write_controller(controller(dt=0.1), tmp_path / "k.c", sample_time=0.2)),
    ]  # fmt: skip
    for kind, message, write in refused:
        with pytest.raises(kind, match=message):
            write()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda held: held.pop("A"), "is not complete there: KeyError"),
        (lambda held: held.update(A=[[1.0]]), "is not complete there: ValueError"),
        (lambda held: held.update(format="other"), "expected a file of write_controller"),
        (lambda held: held.update(version=9), "its version is 9; expected 1"),
        (lambda held: held["D"][0].__setitem__(0, "NaN"), "expected finite numbers in D"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, change, message):
    path = tmp_path / "k.json"
    bc.write_controller(controller(), path)
    held = json.loads(path.read_text())
    change(held)
    path.write_text(json.dumps(held))
    with pytest.raises(ValueError, match=message):
        bc.read_controller(path)
    path.write_text("no json")
    with pytest.raises(ValueError, match="not a JSON file"):
        bc.read_controller(path)
    (tmp_path / "k.mat").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="not a MATLAB file"):
        bc.read_controller(tmp_path / "k.mat")


def test_c_needs_signals():
    own = of(control.ss([], [], [], np.zeros((1, 1)), 0.1), any_time=True).between([], [0])
    with pytest.raises(ValueError, match="at least one input and one output"):
        c_files("none", RunningController(own, np.zeros((0, 1)), np.array([np.inf]), np.array([np.inf])), {})


@pytest.mark.parametrize("suffix", [".json", ".mat", ".c"])
def test_the_controller_of_a_half_is_refused_unless_a_half_is_meant(tmp_path, suffix):
    signals = {"inputs": "stroke_anti", "outputs": "suspension_anti"}
    K, path = control.ss([], [], [], [[-100.0]], 0.01, **signals), tmp_path / f"yaw{suffix}"
    with pytest.raises(ValueError, match=r"'stroke_anti' is a signal of a half.*join_symmetric"):
        bc.write_controller(K, path)
    written = bc.write_controller(K, path, half=True)
    if suffix == ".json":
        notes = bc.exchange.read_controller_notes(path)
        assert notes.units["suspension_anti"] == "N (orthonormal, root of two times half the difference)"
    else:
        assert path in written
    whole = bc.join_symmetric(bc.spray_boom(), control.ss([], [], [], [[-1.0]], 0.01, **SYMMETRIC), K)
    assert bc.write_controller(whole, tmp_path / f"boom{suffix}")
