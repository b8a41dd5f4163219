"""What editors and type checkers know of the public names: the stub is in step, and no type is Any or Unknown."""

import ast
import doctest
import json
import re
import subprocess
import sys
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import get_type_hints

import control
import pytest

import boomctl
from boomctl import lazy
from boomctl.boom.parameters import BoomChanges
from boomctl.rotating_beam.parameters import HubBeamChanges
from tests.public import members, public

PACKAGE = Path(boomctl.__file__).parent
ROOT = Path(__file__).parents[1]


STUBS = sorted(PACKAGE.rglob("__init__.pyi"))


@pytest.mark.parametrize("stub", STUBS, ids=lambda path: path.parent.name)
def test_stub_exports_loaded_names(stub):
    package = import_module(".".join(stub.parent.relative_to(PACKAGE.parent).parts))
    tree = ast.parse(stub.read_text())
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    assert all(name.asname == name.name for node in imports for name in node.names)  # else editors take it for private
    homes = {name.name: node.module for node in imports if node.module for name in node.names}
    assert {*homes} == {*package.__all__} - {"__version__"}
    for name, home in homes.items():
        value = getattr(package, name)
        assert value is getattr(import_module(home), name)
        assert getattr(value, "__module__", home) == home
    assert set(package.__all__) <= set(dir(package))


def test_jedi_completes_public_names():
    """The completion of IPython and of many editors, which reads the stubs as they are."""
    jedi = pytest.importorskip("jedi")
    script = jedi.Script("import boomctl as bc\nbc.spr", project=jedi.Project(PACKAGE.parent))
    assert {found.name for found in script.complete()} == {"spray_boom", "spray_deposit", "spray_deposit_components"}


@pytest.mark.parametrize(
    ("package", "name", "hint"),
    [
        ("boomctl", "sgima", r"did you mean 'sigma'\? help\(boomctl\) lists the names"),
        ("boomctl.structure", "SecondOrdrModel", "'SecondOrderModel'"),
        ("boomctl", "c2d", "use boomctl.discretize"),
        ("boomctl", "dcgain", r"use control\.dcgain, with \.to_statespace\(\)"),
        ("boomctl", "qqqq", r"help\(boomctl\) lists the names"),
    ],
)
def test_an_unknown_name_is_told_the_nearest(package, name, hint):
    with pytest.raises(AttributeError, match=f"has no attribute '{name}'; .*{hint}") as refused:
        getattr(import_module(package), name)
    assert len(str(refused.value)) < 150


def test_words_of_others_are_translated_on_their_page():
    assert set(lazy.TRANSLATED.values()) <= set(boomctl.__all__)
    assert not set(lazy.TRANSLATED) & set(boomctl.__all__)
    assert all(hasattr(control, name) for name in lazy._THEIRS.split())
    page = (Path(__file__).parents[1] / "docs" / "reference" / "matlab_and_python_control.md").read_text(
        encoding="utf-8"
    )
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    table = {word: row.split("|")[2] for row in rows for word in re.findall(r"`(\w+)`", row.split("|")[1])}
    for word, ours in lazy.TRANSLATED.items():
        assert f"`{ours}`" in table[word]


def test_package_docstring_lists_each_name_once():
    listed = re.findall(r"\w+", (boomctl.__doc__ or "").partition("A spray boom\n")[2].partition("Names are loaded")[0])
    assert all(listed.count(name) == 1 for name in set(boomctl.__all__) - {"__version__"})


@pytest.mark.parametrize(
    ("keywords", "parameters"), [(BoomChanges, boomctl.BoomParameters), (HubBeamChanges, boomctl.HubBeamParameters)]
)
def test_keywords_of_a_factory_are_its_parameters(keywords, parameters):
    assert get_type_hints(keywords) == {field.name: field.type for field in fields(parameters)}


def _calls(name, source):
    """Return a function of some source, each line with a name."""
    source = re.sub(r"control\.\w+\(", "made(", source)  # python-control leaves open what it makes
    head = re.sub(r"\W", "_", f"def calls of {name}").replace("_", " ", 1)
    return [(name, line) for line in (f"{head}():", *(f"    {line}" for line in source.splitlines()), "    ...")]


def _pages():
    """Yield the name and the source of each page of the documentation, and of each notebook."""
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "notebooks").glob("*.py")):
        text = page.read_text(encoding="utf-8")
        blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL) if page.suffix == ".md" else [text]
        yield page.name, "\n".join(blocks)


def _script():
    """Return a script with each line's name: types of public functions and of members of classes, and all that calls them."""
    lines = [("", "import boomctl as bc, control"), ("", "from typing import reveal_type")]
    lines += [("", "def made(*given, **named) -> control.StateSpace: ...")]
    for name, value in public().items():
        if isinstance(value, type):
            own = [member.partition("(")[0] for member in members(value)]
            lines.append((name, f"def of_{name.replace('.', '_')}(x: bc.{name}):"))
            lines += [(f"{name}.{member}", f"    reveal_type(x.{member})") for member in own] + [(name, "    ...")]
        elif callable(value):
            lines.append((name, f"reveal_type(bc.{name})"))
        else:
            continue
        for example in doctest.DocTestFinder(exclude_empty=True).find(value, name):
            lines += _calls(example.name, "".join(each.source for each in example.examples))
    return [*lines, *(line for page in _pages() for line in _calls(*page))]


# what users hand over themselves, what depends on it, and axes of pictures that have one or several
OPEN = {
    *("exchange.ControllerMetadata.certificate", "exchange.ControllerMetadata.provenance", "slew.TrackedSlew.plant"),
    *("identification.FitResult.model", "identification.FitResult.parameters", "slew.TrackedSlew.sensors"),
    *("structure.SecondOrderModel.selection", "slew.SlewResult.plan", "analysis.PoleZeroResult.response"),
    *(f"studies.{name}.results" for name in ("MachineDesign", "SlewDesign", "SuspensionDesign")),
    *("rotating_beam.CampbellDiagram.plot", "synthesis.HInfinityResult.plot", "tuning.TuneResult.plot"),
    *(f"analysis.{name}.plot" for name in ("Comparison", "ModeTable", "PoleZeroResult")),
    *("analysis.NyquistResult.plot", "analysis.NyquistStability.plot"),
}
# records whose arrays may be given as lists, and pages that know more of a value than its type tells
FREE = {"boom.PlatformMotion", "boom.Track", "evaluate_spray.md", "designs.md", "6_fastest_slews.py"}


@pytest.mark.slow  # a type checker's start and one pass over all that is public: 10 s
@pytest.mark.skipif(find_spec("pyright") is None, reason="pyright is not installed (pip install '.[dev]')")
def test_a_type_checker_knows_every_public_type(tmp_path):
    """What functions return and what members are; arguments of examples fit, and misspelled ones do not."""
    lines = [*_script(), ("wrong", "bc.spray_boom(lengths=13.0)"), ("wrong", "bc.hub_beam(tip_mas=1.0)")]
    script = tmp_path / "public.py"  # in a folder of its own: a user's type checker has not this repository's settings
    script.write_text("\n".join(line for _, line in lines))
    (tmp_path / "pyrightconfig.json").write_text(json.dumps({"extraPaths": [str(PACKAGE.parent)]}))
    words = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "--outputjson", script.name]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    types, refused = {}, {}
    for entry in json.loads(done.stdout)["generalDiagnostics"]:
        (name, _), text = lines[entry["range"]["start"]["line"]], entry["message"]
        if text.startswith("Type of "):
            assert not re.search(r"\b(omega|timepts): (?!_Buffer|float)", text), (
                text
            )  # as arrays or lists, or one number
            # an array's shape and kind of numbers stay open, and what else arguments may be
            text = re.sub(r"ndarray\[(tuple\[Any, \.\.\.\]|Any), (dtype\[Any\]|Any)\]|slice\[Any, Any, Any\]", "", text)
            types[name] = text.partition('" is "')[2].rpartition(") -> ")[2]
        elif entry.get("rule") in ("reportArgumentType", "reportCallIssue") and '"__getitem__"' not in text:
            refused.setdefault(name, []).append(text)
    lengths, overloads = refused.pop("wrong")
    assert '"lengths"' in lengths
    assert '"hub_beam"' in overloads
    assert {*refused} == FREE, refused
    assert len(types) == sum("reveal_type(" in line for _, line in lines)
    assert {name for name, text in types.items() if re.search(r"\b(Any|Unknown)\b", text)} == OPEN
