"""The command line: what it prints, what it writes, how it refuses."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io

import boomctl as bc
from boomctl.cli import _write
from boomctl.report import Report
from boomctl.structure import SecondOrderModel
from boomctl.studies.measurement import identified_file
from tests.command import boomctl


@pytest.mark.slow  # a process of its own
def test_package_runs_as_a_module():
    done = subprocess.run([sys.executable, "-m", "boomctl", "parameters"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == boomctl("parameters").stdout


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


_REFUSED = [
    ("nothing", "nothing"),
    ("identfy", "did you mean 'identify'"),
    ("reproduce bom", "did you mean 'boom'"),
    ("reproduce hub-beam --parameters boom.toml", "leave them out"),
    ("sigma --discretization exac", "did you mean 'exact'"),
    ("sigma --discretization exact --elements 6", "--elements 6: leave it out"),
    ("sigma --elements 0", "elements = 0"),
    ("sigma --parameters none.toml", "none.toml: there is no such file"),
    ("sigma --parameters boom.toml", "boom.toml: unknown key 'spring_stifness'; did you mean 'spring_stiffness'"),
    ("sigma --parameters light.toml", "light.toml: "),
    ("sigma --parameters long.toml", "long.toml: "),
    ("sigma --measured .", ".: expected a file, got a folder"),
    ("sigma --out folder.svg", "folder.svg: expected a file, got a folder"),
    ("sigma --out sigma.doc", ".png or .svg"),
    ("sigma --out", "expected one argument"),
    ("design min_time_slews", "did you mean 'min_time_slew'"),
    ("design none/mine.py", "design 'none/mine.py': there is no such file"),
    ("design folder.py", "'folder.py': expected a file, got a folder"),
    ("design passive_tuning --speed 0", "speed = 0"),
]
_FILES = {
    "boom.toml": "spring_stifness = 900.0\n",
    "light.toml": "youngs_modulus = 1e-300",
    "long.toml": "length = 1e6\nboom_mass = 1e15\nboom_inertia = 1e15",
}


@pytest.mark.parametrize(("words", "message"), _REFUSED)
def test_cli_wrong_words_end_in_one_line(words, message, tmp_path):
    for name in ("folder.py", "folder.svg"):
        (tmp_path / name).mkdir()
    for name, text in _FILES.items():
        (tmp_path / name).write_text(text)
    done = boomctl(*words.split(), cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert len(done.stderr.splitlines()) <= 2
    assert {path.name for path in tmp_path.iterdir()} == {"folder.py", "folder.svg", *_FILES}


@pytest.mark.parametrize(
    ("raised", "code", "message"),
    [
        ("KeyError('own')", 2, "mine.py, line 1: KeyError: 'own'"),
        ("ExceptionGroup('own', [KeyError(1)])", 2, "mine.py, line 1: ExceptionGroup: own (1 sub-exception)"),
        ("FileNotFoundError('own')", 2, "own"),
        ("RuntimeError('own')", 1, "own"),
        ("KeyboardInterrupt", 1, "interrupted"),
    ],
)
def test_cli_design_error_of_file_is_one_line(raised, code, message, tmp_path):
    (tmp_path / "mine.py").write_text(f"def design(): raise {raised}\n")
    done = boomctl("design", "mine.py", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", f"boomctl: {message}\n")


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
    assert json.loads(done.stdout) == json.loads((tmp_path / "results" / "results.json").read_text()) == {"x": 1}
    assert done.stderr.split() == ["read", "run", "made", "judged", "reported"]
    assert "judged" in boomctl("design", "mine.py", cwd=tmp_path).stdout
    refused = boomctl("design", "mine.py", "--speed", "2", cwd=tmp_path)
    assert refused.returncode == 2
    assert "of suspensions only" in refused.stderr


@pytest.mark.slow
def test_cli_design_on_ascii_terminal_is_shown(tmp_path):
    (tmp_path / "mine.py").write_text(OWN, encoding="utf-8")
    command = [sys.executable, "-m", "boomctl.cli", "design", "mine.py"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "end missed by 3 " in done.stdout
    assert (tmp_path / "results" / "report.html").is_file()


def test_an_infinite_peak_is_given_its_reason_and_no_bound(tmp_path):
    (tmp_path / "boom.toml").write_text("cradle_damping = 0\nhinge_damping = 0\nstiffness_damping = 0\n")
    done = boomctl("sigma", "--parameters", "boom.toml", cwd=tmp_path)
    assert done.stdout.startswith("peak inf at ")
    assert done.stdout.endswith(", a pole on the imaginary axis\n")


def test_unwritable_output_folder_fails_early(tmp_path):
    (tmp_path / "file").write_text("in the way")
    done = boomctl("reproduce", "boom", "--out", str(tmp_path / "file" / "results"))
    assert done.returncode == 1
    assert "cannot be written to" in done.stderr
    done = boomctl("reproduce", "boom", "--out", str(tmp_path / "file"))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.endswith("cannot be written to (a file has that name)\n")
    assert (tmp_path / "file").read_text() == "in the way"


def test_help_says_what_the_exit_codes_mean():
    shown = boomctl("--help")
    assert shown.returncode == 0
    assert "Exit codes: 0 success, 1 failure" in shown.stdout
    listed = "".join(boomctl("design", "--help").stdout.split()).replace("│", "")
    assert all(name in listed for name in bc.studies.design_names())


def test_cli_quiet_command_prints_nothing():
    silent = boomctl("sigma", "--quiet")
    assert (silent.returncode, silent.stdout, silent.stderr) == (0, "", "")


def test_cli_output_into_closed_pipe_is_no_error():
    command = f"{shlex.quote(sys.executable)} -m boomctl.cli parameters | head -n 1"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, shell=True, capture_output=True, text=True, env=environment, check=True)
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


def test_report_beside_files_of_an_earlier_run_names_them(tmp_path, capsys):
    """Files that a report replaces are not named, nor are folders."""
    for name in ("old.txt", "replaced.txt"):
        (tmp_path / name).write_text("earlier")
    (tmp_path / "folder").mkdir()
    _write(Report("A run", (), (), {}, {"replaced.txt": "now", "new.txt": "now"}), tmp_path)
    assert capsys.readouterr().err == f"boomctl: {tmp_path}: also has files that are not of this run: old.txt\n"
    (tmp_path / "old.txt").unlink()
    _write(Report("A run", (), (), {}, {"new.txt": "now"}), tmp_path)
    assert capsys.readouterr().err == f"boomctl: {tmp_path}: also has files that are not of this run: replaced.txt\n"


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """Return a folder with a record of a mass on a spring, 3.18 Hz and 2 %, as CSV and as MAT file."""
    force, mass = np.random.default_rng(0).standard_normal(4000), [[1.0]]
    model = SecondOrderModel(mass, [[0.8]], [[400.0]], {"force": [1.0]}, {"place": [1.0]})
    time = 0.02 * np.arange(len(force))
    place = bc.forced_response(model, time, {"force": force})["place"]
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
    assert abs(mode["damping_ratio"] - 0.02) < 0.002
    assert json.loads((record / "here" / "model.json").read_text())["inputs"] == ["force"]
    assert {each.name for each in (record / "here").iterdir()} >= {"report.html", "identification.png", "response.png"}
    words = ("--inputs", "force", "--sample-time", "0.02", "--band", "0.5", "8", "--out", "there", "--json")
    again = json.loads(boomctl("identify", "record.mat", *words, cwd=record).stdout)
    assert abs(again["modes"][0]["frequency_hz"] / mode["frequency_hz"] - 1.0) < 1e-6


@pytest.mark.slow
def test_cli_warning_is_one_line_and_absent_if_quiet(record):
    words = ("identify", "record.csv", "--inputs", "force", "--band", "0.5", "8", "--intersample", "zoh")
    shown = boomctl(*words, cwd=record).stderr
    assert shown.startswith("boomctl: warning: intersample = 'zoh': ")
    assert shown.count("\n") == 1
    assert boomctl(*words, "--quiet", cwd=record).stderr == ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("record.csv",), "expected the names of inputs, --inputs; the file has force, place"),
        (("record.csv", "--inputs", "forse"), "unknown signal 'forse'; did you mean 'force'"),
        (("record.mat", "--inputs", "force"), "expected a column named 'time' [s], or --sample-time"),
        (("record.csv", "--inputs", "force,place"), "expected outputs in addition to the inputs, got none"),
        (("uneven.csv", "--inputs", "force"), "expected times at even steps"),
    ],
)
def test_identify_says_in_one_line_what_it_misses(record, words, message, monkeypatch):
    monkeypatch.chdir(record)
    path, *others = words
    inputs = others[1].split(",") if others else []
    with pytest.raises(ValueError, match=re.escape(message)):
        identified_file(Path(path), inputs, [], None)
