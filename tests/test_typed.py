"""What editors and type checkers know of the public names: the stub is in step, and no type is Any or Unknown."""

import ast
import json
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import boomctl

PACKAGE = Path(boomctl.__file__).parent
SCRIPT = Path(__file__).with_name("user_script.py")


def test_the_stub_names_what_the_package_loads_from_the_same_homes():
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text())
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    assert {name.name: node.module for node in imports for name in node.names} == boomctl._HOME
    (exported,) = [node.value for node in stub.body if isinstance(node, ast.Assign)]
    assert set(ast.literal_eval(exported)) == set(boomctl.__all__)


def test_the_package_says_that_it_is_typed():
    assert (PACKAGE / "py.typed").exists()


def test_the_users_script_uses_every_public_name():
    used = set(re.findall(r"\bbc\.(\w+)", SCRIPT.read_text()))
    assert used == set(boomctl.__all__)


@pytest.mark.slow  # a type checker's start and one pass over all that is public: 7 s
@pytest.mark.skipif(find_spec("pyright") is None, reason="pyright is not installed (pip install '.[dev]')")
def test_a_type_checker_knows_every_type_in_the_users_script(tmp_path):
    # in a folder of its own: a user's type checker does not read this repository's settings
    shutil.copy(SCRIPT, tmp_path)
    (tmp_path / "pyrightconfig.json").write_text(json.dumps({"extraPaths": [str(PACKAGE.parent)]}))
    words = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "--outputjson", SCRIPT.name]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = json.loads(done.stdout)["generalDiagnostics"]
    assert not [entry for entry in found if entry["severity"] == "error"]
    revealed = [entry["message"] for entry in found if entry["severity"] == "information"]
    assert len(revealed) == SCRIPT.read_text().count("reveal_type(")
    # an array's shape and kind of numbers stay open; everything else is known
    known = [re.sub(r"ndarray\[(tuple\[Any, \.\.\.\]|Any), (dtype\[Any\]|Any)\]", "ndarray", text) for text in revealed]
    assert not [text for text in known if re.search(r"\b(Any|Unknown)\b", text.partition('" is "')[2])]
