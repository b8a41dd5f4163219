"""The notebooks: stored as their scripts say, light, without errors, with numbers that the code prints; run from clean."""

import re

import pytest

from tests.notebooks import FOLDER, SCRIPTS, executed, script_cells, stored, stored_cells

pytestmark = pytest.mark.early

MOST_BYTES = 400_000  # of a stored notebook, pictures included: light enough to be read on the web
NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?"
EACH = pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)


def _code(path):
    return "\n".join(cell.source for cell in script_cells(path) if cell.kind == "code")


def _outputs(path):
    return [output for cell in stored(path)["cells"] if cell["cell_type"] == "code" for output in cell["outputs"]]


def _text(output):
    return "".join(output.get("text", output.get("data", {}).get("text/plain", "")))


def test_there_are_eight_and_each_is_stored():
    assert [path.stem[:2] for path in SCRIPTS] == [f"{k}_" for k in range(1, 9)]
    assert sorted(path.stem for path in FOLDER.glob("*.ipynb")) == [path.stem for path in SCRIPTS]


@EACH
def test_script_and_notebook_hold_the_same_source(path):
    assert stored_cells(path) == script_cells(path)


@EACH
def test_outputs_are_stored_complete_and_light(path):
    cells = [cell for cell in stored(path)["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1)), "run from top to bottom, once"
    kinds = {output["output_type"] for output in _outputs(path)}
    assert kinds <= {"stream", "display_data", "execute_result"}
    assert all(output.get("name") != "stderr" for output in _outputs(path)), "warnings"
    assert sum("image/png" in output.get("data", {}) for output in _outputs(path)) >= 2
    # a figure or axes that is only told of in words was not shown
    assert not [
        _text(output)
        for output in _outputs(path)
        if output["output_type"] == "execute_result" and "Axes" in _text(output)
    ]
    assert path.with_suffix(".ipynb").stat().st_size < MOST_BYTES


@EACH
def test_the_numbers_in_the_text_are_those_that_the_code_prints(path):
    """Each number with a decimal point in the prose rounds one that was printed, or stands in the code."""
    known = "\n".join([_code(path), *(_text(output) for output in _outputs(path))])
    values = [float(number) for number in re.findall(NUMBER, known)]
    prose = "\n".join(cell.source for cell in script_cells(path) if cell.kind == "markdown")
    prose = re.sub(r"```.*?```|`[^`]*`|\$[^$]*\$|\([^()]*(?:19|20)\d\d\)", "", prose, flags=re.DOTALL)
    stray = []
    for number in re.findall(r"(?<![\w.])\d+\.\d+(?:e[+-]?\d+)?(?![\w.]*\w\.)", prose):
        digits = len(number.partition(".")[2].partition("e")[0])
        step = 0.5 * 10.0**-digits * (10.0 ** float(number.partition("e")[2]) if "e" in number else 1.0)
        if not any(abs(value - float(number)) <= 1.001 * step for value in values):
            stray.append(number)
    assert not stray


@pytest.mark.slow
@EACH
def test_it_runs_from_clean(path):
    """Every cell runs, with what it asserts; what is printed has the form of what is stored."""
    pytest.importorskip("nbclient")
    pytest.importorskip("jupytext")
    pytest.importorskip("ipykernel")
    fresh = executed(path)
    now = [cell for cell in fresh.cells if cell.cell_type == "code"]
    then = [cell for cell in stored(path)["cells"] if cell["cell_type"] == "code"]
    for new, old in zip(now, then, strict=True):
        assert [each.output_type for each in new.outputs] == [each["output_type"] for each in old["outputs"]]
        words = [
            re.sub(r"[-+]?(?:\d[\d.e+-]*|inf)|\s", "", "".join(_text(each) for each in outputs))
            for outputs in (new.outputs, old["outputs"])
        ]
        assert words[0] == words[1]
