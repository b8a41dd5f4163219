"""The command line: what it prints, what it writes, how it refuses."""

import json
import os
import subprocess
import sys
import tempfile

import pytest

from boomctl.files import locked_folder
from boomctl.report import Picture, Report, Section
from tests.command import boomctl


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
        (("sigma", "--parameters", "none.toml"), 1, "none.toml"),
        (("sigma", "--out", "sigma.doc"), 2, ".png or .svg"),
        (("nothing",), 2, "nothing"),
        (("design", "min_time_slews"), 2, "did you mean 'min_time_slew'"),
        (("design", "min_time_slew", "--seed", "2", "--road", "C"), 2, "--road, --seed: of suspensions only"),
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


def test_a_speed_at_which_a_track_is_not_resolved_is_named(tmp_path):
    done = boomctl("design", "passive_tuning", "--speed", "300", cwd=tmp_path)
    assert done.returncode == 2
    assert "at speed = 300, or a speed of at most" in done.stderr


@pytest.mark.parametrize(
    "words", [("reproduce", "boom"), ("design", "passive_tuning"), ("slew",), ("design", "mine.py")]
)
def test_a_folder_that_another_run_writes_to_is_refused_before_any_work(words, tmp_path):
    (tmp_path / "mine.py").write_text("def slew(): raise AssertionError('begun')\n")
    with locked_folder(tmp_path / "out"):
        done = boomctl(*words, "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert "output folder out: another run writes to it" in done.stderr
    assert not list((tmp_path / "out").iterdir())


def test_a_folder_is_free_again_when_a_run_has_failed_or_died(tmp_path):
    held = (
        "import time\nfrom boomctl.files import locked_folder\n"
        "with locked_folder('.'):\n print(flush=True)\n time.sleep(60)"
    )
    other = subprocess.Popen([sys.executable, "-c", held], cwd=tmp_path, stdout=subprocess.PIPE)
    assert other.stdout is not None
    other.stdout.readline()
    with pytest.raises(OSError, match="another run"), locked_folder(tmp_path):
        pass
    other.kill()
    other.communicate()
    with pytest.raises(ArithmeticError), locked_folder(tmp_path):
        raise ArithmeticError
    with locked_folder(tmp_path) as folder:
        assert not list(folder.iterdir())


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


OWN = """
from pathlib import Path
from boomctl.report import Report
from boomctl.studies.catalogue import KINDS

print("read")


class Mine(KINDS["slew"].design_class):
    def __init__(self): print("made")
    def evaluate(self, scene=None): print("judged"); return self
    def report(self, tell): print("reported"); return Report("Mine", (), (), {"x": 1})
    def __str__(self): return "end missed by 3 µm, ⅓"


def slew(): print("run"); return Mine()
"""


def test_what_a_design_prints_does_not_spoil_its_results(tmp_path):
    (tmp_path / "mine.py").write_text(OWN, encoding="utf-8")
    done = boomctl("design", "mine.py", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"x": 1}
    assert done.stderr.split() == ["read", "run", "made", "judged", "reported"]
    assert "judged" in boomctl("design", "mine.py", cwd=tmp_path).stdout


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8"])
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


@pytest.mark.parametrize(("angle", "turns"), [("90", "14.3"), ("-180", "28.6"), ("6.4", "1.02")])
def test_an_angle_of_more_than_a_turn_is_said_to_be_in_radians(tmp_path, angle, turns):
    with locked_folder(tmp_path):  # which ends it before any work
        done = boomctl("slew", "--angle", angle, "--out", str(tmp_path))
    assert f"--angle {angle}: {turns} turns; angles are in radians ({angle} degrees are" in done.stderr


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


def slew():
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
    for name in ("slew.png", "comparison.png", "tracking.png", "switching.png", "slew.gif"):
        assert (tmp_path / "out" / name).stat().st_size > 5000


def test_a_slew_that_cannot_be_done_ends_with_one(tmp_path):
    (tmp_path / "mine.py").write_text(SLEW.replace("WHAT", '"effort", 0.5'))
    done = boomctl("design", "mine.py", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1
    assert "too short" in done.stderr
    assert "Traceback" not in done.stderr
