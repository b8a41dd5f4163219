"""The command line: what it prints, what it writes, how it refuses."""

import json
import subprocess
import sys

import pytest

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
