"""Whatever is handed in, the answer is one, or a refusal of this package that names what is wrong: never a traceback of
another library, never NaN, never a hang.
"""

import inspect
import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl
import boomctl.structure
import boomctl.studies
import boomctl.tunable
from tests import fuzz
from tests.profiles import examples

# tried in a file of their own share: a call takes a hundred times as long as that of others
SLOW = ("optimal_slew", "h_infinity", "tune", "analysis.structured_margin", "boom.yaw_family")
QUICK = [name for name in (*fuzz.CALLS, *fuzz.METHODS) if name not in SLOW]
# raised, handed out, or (the last) records that are looked at where they are used, and what takes seconds
NOT_CALLED = {"SlewError", "SynthesisError", "__version__", "structure.GROUND"}
NOT_CALLED |= {"structure.ModeShapes", "structure.ShapeLine"}
NOT_CALLED |= {
    "Progress",
    "ScaledStateSpace",
    "studies.SuspensionDesign",
    "studies.SlewDesign",
    "studies.performance",
}


@pytest.fixture(autouse=True, scope="module")
def elsewhere(tmp_path_factory):
    """Run in a folder of its own: a path that is handed in may be any word."""
    before = os.getcwd()
    os.chdir(tmp_path_factory.mktemp("fuzz"))
    yield
    os.chdir(before)


def test_every_public_function_is_tried():
    parts = [*(f"structure.{name}" for name in boomctl.structure.__all__)]
    parts += [f"tunable.{name}" for name in boomctl.tunable.__all__]
    parts += [f"studies.{name}" for name in boomctl.studies.__all__]
    public = {*boomctl.__all__, *parts}
    assert public - set(fuzz.CALLS) == NOT_CALLED


def test_all_arguments_are_those_of_the_functions():
    for name, made in fuzz.CALLS.items():
        known = inspect.signature(fuzz.function_of(name)).parameters
        assert set(made()) - {"*"} <= set(known), name


@pytest.mark.slow
@pytest.mark.parametrize("part", range(3))
def test_what_is_started_from_works(part):
    """A call whose arguments are all as they should be answers; files that are not there are the exception."""
    for name in QUICK[part::3]:
        arguments = dict(fuzz.METHODS[name][1]() if name in fuzz.METHODS else fuzz.CALLS[name]())
        given_in_order = arguments.pop("*", ())
        if "path" in arguments or name in ("synthesis.split_controller", "analysis.exact_loop_stability"):
            continue
        assert fuzz.function_of(name)(*given_in_order, **arguments) is not None, name


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_every_argument_may_be_every_wrong_thing(name):
    """One at a time, all of them: what random draws of two may miss."""
    wrong = [f"{key} = {value!r:.80}: {fault}" for key, value, fault in fuzz.faults(name)]
    assert not wrong, "\n".join(wrong)


@examples(3000)
@given(fuzz.calls(QUICK))
def test_any_arguments_are_answered_or_refused_by_name(call):
    name, arguments = call
    shown = {key: repr(value)[:80] for key, value in arguments.items()}
    assert not (wrong := fuzz.fault(name, arguments)), f"{name}({shown}): {wrong}"


@pytest.mark.slow
@examples(400)
@given(fuzz.calls(SLOW))
def test_any_arguments_of_what_takes_long_are_answered_or_refused_by_name(call):
    name, arguments = call
    shown = {key: repr(value)[:80] for key, value in arguments.items()}
    assert not (wrong := fuzz.fault(name, arguments)), f"{name}({shown}): {wrong}"


WORDS = [
    "sigma",
    "parameters",
    "design",
    "benchmark",
    "reproduce",
    "identify",
    "--version",
    "--help",
    "",
    "sigmas",
]
OPTIONS = [
    *(
        "--json",
        "--help",
        "--quick",
        "--elements",
        "--discretization",
        "--parameters",
        "--measured",
        "--out",
    ),
    *(
        "--inputs",
        "--band",
        "--modes",
        "--quantity",
        "--speed",
        "--seed",
    ),
    *("--road", "--workers", "--nothing", "-h", "--"),
]
VALUES = [
    *("0", "-1", "1", "3", "1e300", "1e-300", "nan", "inf", "-inf", "x", "", "finite", "exact", "exac", "high-order"),
    *(
        "discrete-hermite",
        "nowhere.toml",
        "nowhere.csv",
        ".",
        "nowhere/x.png",
        "x.svg",
        "time",
        "effort",
        "tlam",
        "cfoam",
    ),
    *("\u03c9", "9" * 400, "1_0", "0x1", "1j", "passive_tunin", "hub-bea", "\x00", "--", "None", "True", "[1]"),
]
BAD = [*VALUES, *OPTIONS]


@st.composite
def lines(draw):
    """Return the words of a command that has a mistake in it, or asks for what is soon there."""
    command = draw(st.sampled_from(WORDS))
    words = draw(st.lists(st.sampled_from(BAD), max_size=4))
    if command in ("design", "benchmark", "reproduce"):  # what they do well takes seconds: they shall not
        words.append(draw(st.sampled_from(["--nothing", "--out", "--json=x", "--quick=x"])))
    return [command, *words]


@examples(1700)
@given(lines())
def test_any_words_on_the_command_line_end_in_an_answer_or_one_line(tmp_path_factory, words):
    from tests.command import boomctl as command

    with fuzz.in_time():
        done = command(*words, cwd=tmp_path_factory.getbasetemp())
    assert done.returncode in (0, 1, 2), (words, done)
    if done.returncode:
        assert done.stdout == "" or words[0] == "" or "usage" in done.stdout, (words, done)
        assert len(done.stderr.splitlines()) <= 2, (words, done)
        assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("sigma", "--elements", "0"),
        ("sigma", "--elements", "\u03c9"),
        ("sigma", "--parameters", "nowhere.toml"),
        ("design", "passive_tunin"),
        ("identify", "nowhere.csv"),
        ("parameters", "extra"),
        ("sigma",),
        ("design", "--help"),
    ],
    ids=" ".join,
)
def test_commands_work_as_processes_on_a_terminal_without_greek_letters(words, tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "boomctl.cli", *words]
    done = subprocess.run(command, capture_output=True, env=environment, cwd=tmp_path, check=False, timeout=60)
    assert done.returncode in (0, 1, 2)
    assert (done.stdout + done.stderr).isascii()
    assert len(done.stderr.splitlines()) == (done.returncode > 0), done.stderr
    assert b"Traceback" not in done.stderr
