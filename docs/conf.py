"""Settings of the documentation site: `sphinx-build -W docs build/docs`."""

import inspect
import re
import shutil
from importlib.metadata import version as installed_version
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from numpydoc.docscrape import ClassDoc, FunctionDoc
from numpydoc.docscrape_sphinx import SphinxDocString
from sphinx.ext.autosummary import import_by_name

HERE = Path(__file__).parent
NOTEBOOKS = HERE.parent / "notebooks"
BY_TASK = re.compile(r"^   ~?(boomctl\.\S+)$", flags=re.MULTILINE)  # an entry of the lists in `api/`
CLASS = re.compile(r"(?<![.\w])[A-Z]\w+")

project = "boomctl"
author = "the boomctl developers"
copyright = "2026, the boomctl developers"  # noqa: A001  Sphinx's name
release = version = installed_version("boomctl")

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
]
source_suffix = {".rst": "restructuredtext", ".md": "myst-nb", ".ipynb": "myst-nb"}
exclude_patterns = ["build"]
html_theme = "furo"
html_math_renderer = "mathml"
html_title = "boomctl"
html_static_path = ["style"]
html_css_files = ["site.css"]
templates_path = ["templates"]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # notebooks keep the outputs that the tests made anew and compared

autosummary_generate = True
autodoc_typehints = "none"  # the docstring says it in words
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
suppress_warnings = ["myst.header"]


def _members(name: str, thing: type, told_of: set[str]) -> tuple[list[str], list[tuple[str, str, list[str]]]]:
    """Return what a class has beside its fields, and what hands something out: its name on a page, its type, an example."""
    fields = ClassDoc(thing, config={"show_class_members": False})["Attributes"]
    handed = [(f"``{entry.name}`` of :class:`~{name}`", entry.type, []) for entry in fields]
    told = {field.strip() for entry in fields for field in entry.name.split(",")}
    members = []
    for member in sorted({*dir(thing)} - told):
        value = inspect.getattr_static(thing, member)
        value = getattr(value, "__func__", getattr(value, "fget", value))
        ours = (getattr(value, "__module__", None) or "").startswith("boomctl") and inspect.getdoc(value)
        if ours and not member.startswith("_"):
            members.append(member)
            home = getattr(value, "__qualname__", "").partition(".")[0]
            elsewhere = home != thing.__name__ and home in told_of  # on the page of the class that it is inherited from
            if inspect.isfunction(value) and not elsewhere:
                handed.append((f":meth:`~{name}.{member}`", *_returned(value)))
    return members, handed


def _returned(function) -> tuple[str, list[str]]:
    """Return what a function returns, and its example."""
    doc = FunctionDoc(function)
    return " ".join(entry.type for entry in doc["Returns"]), doc["Examples"]


def _classes() -> dict[str, dict]:
    """Return of each class in the lists what its page says beside its docstring: who hands it out, and how it is got."""
    listed = dict.fromkeys(name for page in sorted(HERE.glob("api/*.md")) for name in BY_TASK.findall(page.read_text()))
    things = {name: import_by_name(name)[1] for name in listed}
    classes = {name: thing for name, thing in things.items() if isinstance(thing, type)}
    full = {name.rpartition(".")[2]: name for name in classes}
    inside = {name: _members(name, thing, {*full}) for name, thing in classes.items()}
    handed = [
        ("", f":func:`~{name}`", *_returned(thing)) for name, thing in things.items() if inspect.isfunction(thing)
    ]
    handed += [(owner, *one) for owner, (_, ones) in inside.items() for one in ones]
    makers = {
        name: [] for name in classes
    }  # of each the class that it is part of, what a page calls it, and its example
    for owner, what, types, shown in handed:
        for word in CLASS.findall(types):
            if full.get(word, owner) != owner:
                makers[full[word]].append((owner, what, shown))

    def example(name: str, asked: tuple[str, ...] = ()) -> list[str]:
        """Return the example of a class, or else of what hands it out, or else of the class that it is part of."""
        if (own := ClassDoc(classes[name])["Examples"]) or name in asked:
            return own
        first = next((shown for *_, shown in makers[name] if shown), [])
        return first or next((found for of, *_ in makers[name] if of and (found := example(of, (*asked, name)))), [])

    return {
        name: {
            "makers": [what for _, what, _ in makers[name]],
            "members": inside[name][0],
            "example": [] if ClassDoc(classes[name])["Examples"] else example(name),
        }
        for name in classes
    }


# what a class says of a field stands, also where the field is a property, whose own summary numpydoc would take
_process = SphinxDocString._process_param
SphinxDocString._process_param = lambda self, field, words, _: _process(self, field, words, False)
CLASSES = _classes()
autosummary_context = {"classes": CLASSES}
# what a function returns leads to the page of its class
numpydoc_xref_param_type = True
numpydoc_xref_aliases = {name.rpartition(".")[2]: name for name in CLASSES}
numpydoc_xref_ignore = "all"  # other words


def _own_classes_alone(_app, config) -> None:
    """Leave out numpydoc's links to pages of Python and NumPy, which need the network."""
    config.numpydoc_xref_aliases_complete = numpydoc_xref_aliases


def _without_arguments(_app, what, name, thing, _options, _arguments, _returned):
    """Leave out the arguments of classes that users are handed and do not make."""
    if (
        what == "class"
        and "Attributes\n----" in (inspect.getdoc(thing) or "")
        and "Parameters\n----" not in thing.__doc__
    ):
        return "", None
    return None


def _list_all(_app, page: str, source: list[str]) -> None:
    """Put on "Functions by task" what its pages list: each name and a line."""
    if page == "api/index":
        for name in re.findall(r"^(\w+)$", source[0], flags=re.MULTILINE):
            text = (HERE / "api" / f"{name}.md").read_text()
            text = re.sub(r"^# (.*)$", rf"# [\1]({name}.md)", text, flags=re.MULTILINE)
            text = re.sub(r"^#", "##", text, flags=re.MULTILINE)
            source[0] += "\n" + text.replace("   :toctree: generated\n", "")


def _bring_notebooks(_app) -> None:
    """Copy the notebooks beside the pages: Sphinx reads nothing outside its folder."""
    target = HERE / "notebooks"
    for source in sorted(NOTEBOOKS.glob("*.ipynb")):
        copied = target / source.name
        if not copied.exists() or copied.read_bytes() != source.read_bytes():
            target.mkdir(exist_ok=True)
            shutil.copyfile(source, copied)


def _inline_formula(writer, node) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _formula(writer, node) -> None:
    writer.body.append(convert(node.astext(), display="block"))
    raise nodes.SkipNode


def setup(app) -> None:
    app.connect("builder-inited", _bring_notebooks)
    app.connect("config-inited", _own_classes_alone, priority=900)  # after numpydoc's own
    app.connect("autodoc-process-signature", _without_arguments)
    app.connect("source-read", _list_all)
    # formulas as MathML, which browsers draw themselves: no script, no font and no network
    app.add_html_math_renderer("mathml", (_inline_formula, None), (_formula, None))
