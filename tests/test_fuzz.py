"""Whatever is handed in, the answer is one, or a refusal of this package that names what is wrong: never a traceback of
another library, never NaN, never a hang.
"""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import fuzz
from tests.profiles import examples

# arguments that are stored, or not needed beside the others
NOT_LOOKED_AT = {"order", "notes", "sections", "listener"}
# tried in a file of their own share: a call takes a hundred times as long as that of others
SLOW = ("optimal_slew", "h_infinity", "tune", "analysis.robust_stability_margin")
QUICK = [name for name in (*fuzz.called(), *fuzz.METHODS) if name not in SLOW]


@pytest.fixture(autouse=True, scope="module")
def elsewhere(tmp_path_factory):
    """Run in a folder of its own: a path that is handed in may be any word."""
    before = os.getcwd()
    os.chdir(tmp_path_factory.mktemp("fuzz"))
    yield
    os.chdir(before)


@pytest.mark.parametrize("name", QUICK)
def test_call_with_arguments_of_example_answers(name):
    """But for files that are not there, and a loop whose phase cannot be followed so soon."""
    arguments = fuzz.arguments_of(name)
    in_order = arguments.pop("*", ())
    if "path" not in arguments and name != "analysis.nyquist_stability":
        assert fuzz.function_of(name)(*in_order, **arguments) is not None


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", QUICK)
def test_masked_array_in_any_argument_raises(name):
    """A conversion would drop the mask.  Arguments that are optional are tried with numbers too."""
    for key, value in fuzz.arguments_of(name).items():
        if key in NOT_LOOKED_AT:
            continue
        optional = value is None or (isinstance(value, tuple) and not value)
        array, numbers = fuzz.masked([1.0, 2.0] if optional else value)
        if numbers:
            words = "" if optional else "[Mm]asked"
            with pytest.raises((TypeError, ValueError), match=words):
                fuzz.function_of(name)(**fuzz.arguments_of(name) | {key: array})


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_call_each_argument_each_wrong_value_answers_or_raises(name):
    """One at a time, all of them: what random draws of two may miss."""
    wrong = [f"{key} = {value!r:.80}: {fault}" for key, value, fault in fuzz.faults(name)]
    assert not wrong, "\n".join(wrong)


@examples(3000)
@given(fuzz.calls(QUICK))
def test_call_any_arguments_answers_or_raises(call):
    name, arguments = call
    shown = {key: repr(value)[:80] for key, value in arguments.items()}
    assert not (wrong := fuzz.fault(name, arguments)), f"{name}({shown}): {wrong}"


@pytest.mark.slow
@examples(400)
@given(fuzz.calls(SLOW))
def test_call_any_arguments_of_slow_function_answers_or_raises(call):
    name, arguments = call
    shown = {key: repr(value)[:80] for key, value in arguments.items()}
    assert not (wrong := fuzz.fault(name, arguments)), f"{name}({shown}): {wrong}"


WORDS = ["sigma", "parameters", "design", "benchmark", "reproduce", "identify", "--version", "--help", "", "sigmas"]
OPTIONS = ["--json", "--help", "--quick", "--elements", "--discretization", "--parameters", "--measured"]
OPTIONS += ["--out", "--inputs", "--band", "--modes", "--quantity", "--speed", "--road", "--nothing", "-h", "--"]
VALUES = ["0", "-1", "1", "3", "1e300", "1e-300", "nan", "inf", "-inf", "9" * 400, "1_0", "0x1", "1j", "None", "[1]"]
VALUES += ["x", "", "finite", "exact", "exac", "time", "passive_tunin", "hub-bea", "\u03c9", "\x00", "x.svg"]
VALUES += ["nowhere.toml", "nowhere.csv", "nowhere/x.png", "."]


@st.composite
def lines(draw):
    """Return the words of a command that has a mistake in it, or asks for what is soon there."""
    command = draw(st.sampled_from(WORDS))
    words = draw(st.lists(st.sampled_from([*VALUES, *OPTIONS]), max_size=4))
    if command in ("design", "benchmark", "reproduce"):  # what they do well takes seconds: they shall not
        words.append(draw(st.sampled_from(["--nothing", "--out", "--json=x", "--quick=x"])))
    return [command, *words]


@examples(1700)
@given(lines())
def test_cli_any_words_answer_or_one_line(tmp_path_factory, words):
    from tests.command import boomctl as command

    with fuzz.in_time():
        done = command(*words, cwd=tmp_path_factory.getbasetemp())
    assert done.returncode in (0, 1, 2), (words, done)
    if done.returncode:
        assert done.stdout == "" or words[0] == "" or "usage" in done.stdout, (words, done)
        assert len(done.stderr.splitlines()) <= 2, (words, done)
        assert "Traceback" not in done.stderr
