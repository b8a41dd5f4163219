"""The command line: what it prints, what it writes, how it refuses."""

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import scipy.io

import boomctl as bc
from boomctl.cli import _write
from boomctl.files import write_whole
from boomctl.report import Picture, Report, Section
from boomctl.structure import SecondOrderModel
from boomctl.studies.measurement import identified_file
from tests.command import boomctl


@pytest.mark.slow
def test_the_command_is_a_program():
    words = ("sigma", "--elements", "0")
    done = subprocess.run([sys.executable, "-m", "boomctl.cli", *words], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", boomctl(*words).stderr)
    assert len(done.stderr.splitlines()) == 1


def test_sigma_says_its_certified_peak(tmp_path):
    done = boomctl("sigma", "--out", str(tmp_path / "sigma.svg"))
    assert done.returncode == 0
    assert "peak 2472.81" in done.stdout
    assert "certified" in done.stdout
    assert (tmp_path / "sigma.svg").read_text().startswith("<?xml")


def test_the_parameter_file_printed_is_read_again(tmp_path):
    (tmp_path / "boom.toml").write_text(boomctl("parameters").stdout)
    done = boomctl("sigma", "--json", "--parameters", str(tmp_path / "boom.toml"))
    assert json.loads(done.stdout)["peak"] == pytest.approx(2472.806, rel=1e-5)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("reproduce", "bom"), 2, "did you mean 'boom'"),
        (("reproduce", "hub-beam", "--parameters", "boom.toml"), 2, "leave them out"),
        (("sigma", "--discretization", "finit"), 2, "did you mean 'finite'"),
        (("sigma", "--elements", "0"), 2, "elements = 0"),
        (("sigma", "--elements", "many"), 2, "elements"),
        (("sigma", "--parameters", "none.toml"), 2, "none.toml: there is no such file"),
        (("sigma", "--measured", "none/curve.csv"), 2, "none/curve.csv: there is no such file"),
        (("reproduce", "boom", "--parameters", "none.toml"), 2, "none.toml: there is no such file"),
        (("design", "none/mine.py"), 2, "design 'none/mine.py': there is no such file"),
        (("sigma", "--out", "sigma.doc"), 2, ".png or .svg"),
        (("nothing",), 2, "nothing"),
        (("identfy",), 2, "did you mean 'identify'"),
        (("sigma", "--out"), 2, "expected one argument"),
        (("design", "min_time_slews"), 2, "did you mean 'min_time_slew'"),
        (("design", "passive_tuning", "--speed", "0"), 2, "speed = 0"),
        (("design", "nowhere.py"), 2, "no such file"),
    ],
)
def test_bad_use_ends_in_one_clear_line(words, code, message, tmp_path):
    done = boomctl(*words, cwd=tmp_path)
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_misspelt_key_names_file_and_key(tmp_path):
    (tmp_path / "boom.toml").write_text("spring_stifness = 900.0\n")
    done = boomctl("sigma", "--parameters", "boom.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "boom.toml" in done.stderr
    assert "did you mean 'spring_stiffness'" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("sigma", "--parameters", "."),
        ("sigma", "--measured", "."),
        ("reproduce", "boom", "--parameters", "."),
        ("reproduce", "boom", "--measured", "."),
    ],
)
def test_a_folder_in_place_of_a_file_is_bad_use(words, tmp_path):
    done = boomctl(*words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert ".: expected a file, got a folder" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", [("design", "folder.py"), ("sigma", "--out", "folder.svg")])
def test_a_folder_of_a_files_name_is_bad_use(words, tmp_path):
    (tmp_path / words[-1]).mkdir()
    done = boomctl(*words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith(": expected a file, got a folder\n")


_RAISED = {
    "type('Own', (Exception,), {})('own')": (2, "mine.py, line "),
    "ExceptionGroup('own', [KeyError(1)])": (2, "mine.py, line "),
    "SystemExit(3)": (2, "mine.py, line "),
    "RecursionError('own')": (2, "mine.py, line "),
    "KeyError('own')": (2, "mine.py, line "),
    "ArithmeticError('own')": (1, "own"),
    "FileNotFoundError('own')": (2, "own"),
    "KeyboardInterrupt": (1, "interrupted"),
}


@pytest.mark.parametrize("raised", _RAISED)
@pytest.mark.parametrize("where", ["{}\n", "def design():\n    {}\n", "import other\n"])
def test_cli_design_error_of_file_is_one_line(raised, where, tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "other", raising=False)
    (tmp_path / "mine.py").write_text(where.format(f"raise {raised}"))
    (tmp_path / "other.py").write_text(f"raise {raised}\n")
    done = boomctl("design", "mine.py", cwd=tmp_path)
    code, message = _RAISED[raised]
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith("boomctl: ")
    assert len(done.stderr.splitlines()) == 1
    assert message in done.stderr


@pytest.mark.slow
def test_a_speed_at_which_a_track_is_not_resolved_is_named(tmp_path):
    done = boomctl("design", "passive_tuning", "--speed", "80", cwd=tmp_path)
    assert done.returncode == 2
    assert "at speed = 80, or a speed of at most 50 m/s" in done.stderr


@pytest.mark.slow
def test_a_way_longer_than_the_ground_is_named(tmp_path):
    done = boomctl("design", "passive_tuning", "--speed", "300", cwd=tmp_path)
    assert done.returncode == 2
    assert "run_in, duration = 60, 60: expected at most" in done.stderr


def test_a_report_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    pictures = tuple(Picture(name, "", {"png": b"new"}) for name in ("a", "b"))
    report = Report("A title", (), (Section("One", pictures=pictures),), {"x": 1})
    (tmp_path / "a.png").write_bytes(b"old")
    made = tempfile.mkstemp

    def broken(**options):
        if len(list(tmp_path.iterdir())) > 2:
            raise OSError("disk full")
        return made(**options)

    with monkeypatch.context() as patch:
        patch.setattr("tempfile.mkstemp", broken)
        with pytest.raises(OSError, match="disk full"):
            report.write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert (tmp_path / "a.png").read_bytes() == b"old"
    assert {path.name for path in report.write(tmp_path)} == {"a.png", "b.png", "results.json", "report.html"}
    assert (tmp_path / "a.png").read_bytes() == b"new"


@pytest.mark.parametrize("taken", ["a.png", "b.png", "results.json", "report.html"])
def test_nothing_of_a_report_is_written_where_a_folder_has_the_name_of_a_part(taken, tmp_path):
    pictures = tuple(Picture(name, "", {"png": b"new"}) for name in ("a", "b"))
    (tmp_path / taken).mkdir()
    with pytest.raises(ValueError, match=f"{taken}: expected a file, got a folder"):
        Report("A title", (), (Section("One", pictures=pictures),), {"x": 1}).write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [taken]


@pytest.mark.parametrize(
    ("path", "why"), [("missing/a", "No such file"), ("file/a", "Not a directory"), ("a" * 300, "too long")]
)
def test_a_file_that_cannot_be_written_is_named_not_its_temporary_one(path, why, tmp_path):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OSError, match=why) as caught:
        write_whole(tmp_path / path, "text")
    assert caught.value.filename == str(tmp_path / path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.slow
def test_a_full_disk_is_one_line_without_a_number(tmp_path):
    limited = (
        "import resource, sys\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "from boomctl.cli import main\nsys.argv[1:] = ['sigma', '--out', 'deep/a.png']\nmain()"
    )
    done = subprocess.run([sys.executable, "-c", limited], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, "boomctl: deep/a.png: File too large\n")
    assert not list((tmp_path / "deep").iterdir())


OWN = """
from pathlib import Path
from boomctl.report import Report

print("read")


class Mine:
    def __init__(self): print("made")
    def evaluate(self): print("judged"); return self
    def report(self): print("reported"); return Report("Mine", (), (), {"x": 1})
    def __str__(self): return "end missed by 3 µm, ⅓"


def design(): print("run"); return Mine()
"""


def test_what_a_design_prints_does_not_spoil_its_results(tmp_path):
    (tmp_path / "mine.py").write_text(OWN, encoding="utf-8")
    done = boomctl("design", "mine.py", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"x": 1}
    assert done.stderr.split() == ["read", "run", "made", "judged", "reported"]
    assert "judged" in boomctl("design", "mine.py", cwd=tmp_path).stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    "encoding", ["ascii", *(pytest.param(name, marks=pytest.mark.slow) for name in ("latin-1", "cp1252", "utf-8"))]
)
def test_a_terminal_that_knows_few_letters_ends_no_design(tmp_path, encoding):
    (tmp_path / "mine.py").write_text(OWN, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "boomctl.cli", "design", "mine.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONIOENCODING": encoding},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert b"end missed by 3 " in done.stdout
    assert (tmp_path / "results" / "report.html").is_file()


@pytest.mark.parametrize("text", ["youngs_modulus = 1e-300", "length = 1e6\nboom_mass = 1e15\nboom_inertia = 1e15"])
def test_no_nonsense_is_certified(text, tmp_path):
    (tmp_path / "boom.toml").write_text(text)
    done = boomctl("sigma", "--parameters", "boom.toml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "boom.toml: " in done.stderr


def test_an_infinite_peak_is_given_its_reason_and_no_bound(tmp_path):
    (tmp_path / "boom.toml").write_text("cradle_damping = 0\nhinge_damping = 0\nstructural_damping = 0\n")
    done = boomctl("sigma", "--parameters", "boom.toml", cwd=tmp_path)
    assert done.stdout.startswith("peak inf at ")
    assert done.stdout.endswith(", a pole on the imaginary axis\n")


def test_an_output_folder_that_cannot_be_made_ends_before_any_work(tmp_path):
    (tmp_path / "file").write_text("in the way")
    done = boomctl("reproduce", "boom", "--out", str(tmp_path / "file" / "results"))
    assert done.returncode == 1
    assert "cannot be written to" in done.stderr
    done = boomctl("reproduce", "boom", "--out", str(tmp_path / "file"))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.endswith("cannot be written to (a file has that name)\n")
    assert (tmp_path / "file").read_text() == "in the way"


def test_help_lists_all_designs():
    from boomctl.studies.catalogue import design_names

    shown = "".join(boomctl("design", "--help").stdout.split())
    for name in design_names():
        assert name in shown.replace("│", "")


SLEW = """
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.studies.slew.design import SlewDesign
from boomctl.slew import optimal_slew


def design():
    beam = hub_beam(HubBeamParameters(), "sfoam", 1)
    return SlewDesign("mine", "A slew of mine", beam, {"fastest": optimal_slew(beam, 0.6, 120.0, WHAT)})
"""


@pytest.mark.slow
def test_a_slew_of_the_users_own_is_reported_with_all_its_files(tmp_path):
    (tmp_path / "mine.py").write_text(SLEW.replace(", WHAT", ""))
    done = boomctl("design", "mine.py", "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert printed == json.loads((tmp_path / "out" / "results.json").read_text())
    assert printed["comparison"][0]["name"] == "fastest"
    assert "A slew of mine" in (tmp_path / "out" / "report.html").read_text()
    for name in ("slew.png", "comparison.png", "switching.png", "slew.gif"):
        assert (tmp_path / "out" / name).stat().st_size > 5000


def test_a_slew_that_cannot_be_done_ends_with_one(tmp_path):
    (tmp_path / "mine.py").write_text(SLEW.replace("WHAT", '"effort", 0.5'))
    done = boomctl("design", "mine.py", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1
    assert "too short" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_discretization_that_is_none_is_told_all_there_are():
    done = boomctl("sigma", "--discretization", "exac")
    assert done.returncode == 2
    assert "did you mean 'exact'" in done.stderr
    assert "discrete-geometric, exact)" in done.stderr


@pytest.mark.parametrize("elements", ["0", "6"])
def test_the_exact_boom_has_no_elements(elements):
    done = boomctl("sigma", "--discretization", "exact", "--elements", elements)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"--elements {elements}: leave it out" in done.stderr


def program(*words, **options):
    """Run the command line as a process of its own."""
    command = [sys.executable, "-m", "boomctl.cli", *words]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **options.pop("environment", {})}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, **options)


def test_help_says_what_the_exit_codes_mean():
    shown = program("--help")
    assert shown.returncode == 0
    assert "Exit codes: 0 done; 1 could not be done" in shown.stdout
    assert program("sigma", "--elements", "no").returncode == 2


@pytest.mark.slow
def test_quiet_prints_nothing_but_what_json_asks_for():
    silent = program("sigma", "--quiet")
    assert (silent.returncode, silent.stdout, silent.stderr) == (0, "", "")
    assert json.loads(boomctl("sigma", "--quiet", "--json").stdout)["certified"]
    failed = boomctl("sigma", "--quiet", "--elements", "-1")
    assert failed.returncode == 2
    assert len(failed.stderr.splitlines()) == 1


@pytest.mark.slow
def test_output_that_goes_into_a_pipe_has_no_colours():
    shown = program("reproduce", "--help", environment={"TERM": "xterm-256color"})
    assert shown.returncode == 0
    assert "\x1b" not in shown.stdout + shown.stderr


def test_cli_output_into_closed_pipe_is_no_error():
    command = f"{shlex.quote(sys.executable)} -m boomctl.cli parameters"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        f"{command} | head -n 1", shell=True, capture_output=True, text=True, env=environment, check=True
    )
    assert done.stdout.count("\n") == 1
    assert done.stderr == ""


def test_notebooks_are_copied_whole_and_never_over_ones_own(tmp_path, monkeypatch):
    source = tmp_path / "shipped"
    source.mkdir()
    for name in ("1_first.ipynb", "1_first.py", "measured.csv", ".hidden"):
        (source / name).write_text(name)
    monkeypatch.setattr("boomctl.studies.catalogue.shipped", lambda name: source)
    out = tmp_path / "mine" / "notebooks"
    done = boomctl("notebooks", "--out", str(out))
    assert done.returncode == 0
    assert sorted(path.name for path in out.iterdir()) == ["1_first.ipynb", "1_first.py", "measured.csv"]
    assert done.stdout.split() == [str(out / name) for name in ("1_first.ipynb", "1_first.py", "measured.csv")]
    (out / "1_first.py").write_text("my own")
    again = boomctl("notebooks", "--out", str(out))
    assert again.returncode == 2
    assert "1_first.ipynb, 1_first.py, measured.csv already there" in again.stderr
    assert (out / "1_first.py").read_text() == "my own"
    forced = boomctl("notebooks", "--out", str(out), "--force", "--json")
    assert len(json.loads(forced.stdout)) == 3
    assert (out / "1_first.py").read_text() == "1_first.py"
    assert boomctl("notebooks", "--out", str(source), "--force").returncode == 2


def test_without_notebooks_it_is_said_that_there_are_none(tmp_path, monkeypatch):
    monkeypatch.setattr("boomctl.studies.catalogue.shipped", lambda name: tmp_path / "none")
    done = boomctl("notebooks", "--out", str(tmp_path / "out"))
    assert done.returncode == 1
    assert "there are no notebooks in" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("seed", range(20))
def test_files_of_an_earlier_run_beside_a_report_are_named(seed, tmp_path, capsys):
    """Files that a report replaces are not named, nor are folders."""
    drawn = np.random.default_rng(seed).permutation([f"{name}.txt" for name in "abcdefgh"])
    before, now = set(drawn[: seed % 6]), set(drawn[seed % 4 : 7])
    for name in before:
        (tmp_path / name).write_text("earlier")
    (tmp_path / "folder").mkdir()
    report = Report("A run", (), (), {"seed": seed}, dict.fromkeys(now, "now"))
    _write(report, tmp_path)
    said = capsys.readouterr().err
    left = sorted(before - now)
    assert said == (
        f"boomctl: {tmp_path}: also has files that are not of this run: {', '.join(left)}\n" if left else ""
    )


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """Return a folder with a record of a mass on a spring, 3.18 Hz and 2 %, as CSV and as MAT file."""
    force, mass = np.random.default_rng(0).standard_normal(4000), [[1.0]]
    model = SecondOrderModel(mass, [[0.8]], [[400.0]], {"force": [1.0]}, {"place": [1.0]})
    time = 0.02 * np.arange(len(force))
    place = bc.forced_response(model, {"force": force}, time)["place"]
    folder = tmp_path_factory.mktemp("record")
    table = np.column_stack([time, force, place])
    np.savetxt(folder / "record.csv", table, delimiter=",", header="time,force,place", comments="")
    scipy.io.savemat(folder / "record.mat", {"force": force, "place": place})
    np.savetxt(folder / "uneven.csv", np.delete(table, slice(50, 60), 0), delimiter=",", header="time,force,place")
    return folder


@pytest.mark.slow
def test_identify_reports_the_modes_of_a_record(record):
    done = boomctl("identify", "record.csv", "--inputs", "force", "--band", "0.5", "8", "--out", "here", cwd=record)
    assert done.returncode == 0, done.stderr
    assert "Report:" in done.stdout
    results = json.loads((record / "here" / "results.json").read_text())
    (mode,) = results["modes"]
    assert abs(mode["frequency_hz"] - 3.1825) < 0.01
    assert abs(mode["damping"] - 0.02) < 0.002
    assert json.loads((record / "here" / "model.json").read_text())["inputs"] == ["force"]
    assert {each.name for each in (record / "here").iterdir()} >= {"report.html", "identification.png", "response.png"}
    words = ("--inputs", "force", "--sample-time", "0.02", "--band", "0.5", "8", "--out", "there", "--json")
    again = json.loads(boomctl("identify", "record.mat", *words, cwd=record).stdout)
    assert abs(again["modes"][0]["frequency_hz"] / mode["frequency_hz"] - 1.0) < 1e-6


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("record.csv",), "expected the names of inputs, --inputs; the file has force, place"),
        (("record.csv", "--inputs", "forse"), "unknown signal 'forse'; did you mean 'force'"),
        (("record.mat", "--inputs", "force"), "expected a column named 'time' [s], or --sample-time"),
        (("record.csv", "--inputs", "force,place"), "expected outputs beside the inputs, got none"),
        (("uneven.csv", "--inputs", "force"), "expected times at even steps"),
    ],
)
def test_identify_says_in_one_line_what_it_misses(record, words, message, monkeypatch):
    monkeypatch.chdir(record)
    path, *others = words
    inputs = others[1].split(",") if others else []
    with pytest.raises(ValueError, match=re.escape(message)):
        identified_file(Path(path), inputs, [], None)
