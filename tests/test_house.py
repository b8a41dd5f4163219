"""The rules of the house that a machine can check: no import circles, no crowded folders, no number without a meaning."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "boomctl"
FILES = {
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
    if "designs" not in path.parts
}
MOST = 18  # files in a folder: what a reader takes in at a glance


def _imported(path):
    """Return the modules of the package that a file imports: for type checkers, within functions and by name too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in FILES else node.module
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            yield from (a.value for a in node.args if isinstance(a, ast.Constant) and "plotting" not in str(a.value))


@pytest.mark.slow
def test_no_imports_run_in_a_circle():
    graph = {name: {m for m in _imported(path) if m in FILES} - {name, "boomctl"} for name, path in FILES.items()}
    circle = []
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = error.args[1]
    assert not circle, " <- ".join(circle)


@pytest.mark.slow
def test_names_are_imported_from_where_they_are_defined():
    """Not from a package that loads its public names when they are used: the graph above would not see where from."""
    lazy = {name for name, path in FILES.items() if path.with_suffix(".pyi").exists()} - {"boomctl"}
    wrong = [f"{name}: from {m}" for name, path in FILES.items() for m in _imported(path) if m in lazy]
    assert not wrong


def test_no_folder_is_crowded():
    for folder in {path.parent for path in FILES.values()}:
        count = sum(path.name != "__init__.py" for path in folder.glob("*.py"))
        assert count <= MOST, f"{folder.name}: {count} files; expected a room of its own for some"


@pytest.mark.slow
def test_every_number_says_what_it_is():
    bare = []
    for name, path in FILES.items():
        source = path.read_text(encoding="utf-8")
        lines = source.splitlines()
        for node in ast.parse(source).body:
            targets = getattr(node, "targets", [getattr(node, "target", None)])
            constant = isinstance(node, (ast.Assign, ast.AnnAssign)) and ast.unparse(targets[0]).isupper()
            numbers = [n for n in ast.walk(node) if isinstance(n, ast.Constant) and type(n.value) in (int, float)]
            if constant and numbers:
                around = lines[max(node.lineno - 3, 0) : node.end_lineno + 1]
                if not any("#" in line or '"""' in line for line in around):
                    bare.append(f"{name}: {ast.unparse(targets[0])}")
    assert not bare


def test_warnings_point_to_users():
    """Only `warn_user` finds the line that called the library; a fixed `stacklevel` counts the library's own calls."""
    sources = {name: path.read_text(encoding="utf-8") for name, path in FILES.items()}
    assert not {name for name, source in sources.items() if "stacklevel" in source}
