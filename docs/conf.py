"""Settings of the documentation site: `sphinx-build -W docs build/docs`."""

import shutil
from importlib.metadata import version as installed_version
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

HERE = Path(__file__).parent
NOTEBOOKS = HERE.parent / "notebooks"

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
templates_path: list[str] = []

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # notebooks keep the outputs that the tests made anew and compared

autosummary_generate = True
autodoc_typehints = "none"  # the docstring says it in words
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = False
suppress_warnings = ["myst.header"]


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
    # formulas as MathML, which browsers draw themselves: no script, no font and no network
    app.add_html_math_renderer("mathml", (_inline_formula, None), (_formula, None))
