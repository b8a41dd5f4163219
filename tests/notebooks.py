"""The notebooks: their scripts read cell by cell, executed from clean, and written beside them with their outputs.

``python -m tests.notebooks [PART OF A NAME ...]`` executes them anew and writes the ``.ipynb`` files.
"""

import base64
import io
import json
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "notebooks"
TIME_LIMIT = 600  # of one cell on a loaded machine [s]; quiet ones take a few
SCRIPTS = sorted(FOLDER.glob("*.py"))


@dataclass(frozen=True)
class Cell:
    """A cell: ``"markdown"`` or ``"code"``, and its source without the script's comment signs."""

    kind: str
    source: str


def script_cells(path):
    """Return the cells of a script in jupytext's percent format."""
    _, *parts = re.split(r"^# %%(.*)\n", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    cells = []
    for mark, body in zip(parts[::2], parts[1::2], strict=True):
        text = body.strip("\n")
        if "[markdown]" in mark:
            text = "\n".join(re.sub("^# ?", "", line) for line in text.splitlines())
        cells.append(Cell("markdown" if "[markdown]" in mark else "code", text))
    return cells


def stored(path):
    """Return the notebook beside a script, as it is stored."""
    return json.loads(path.with_suffix(".ipynb").read_text(encoding="utf-8"))


def stored_cells(path):
    """Return the cells of the notebook beside a script."""
    return [Cell(cell["cell_type"], "".join(cell["source"])) for cell in stored(path)["cells"]]


def executed(path):
    """Run a script as a notebook in a kernel of its own and return it with its outputs; a cell that fails raises."""
    import jupytext
    from nbclient import NotebookClient

    notebook = jupytext.read(path, fmt="py:percent")
    for k, cell in enumerate(notebook.cells, 1):
        cell["id"] = f"cell-{k:02d}"  # the same on every run
        cell.source = cell.source.strip("\n")
    client = NotebookClient(
        notebook,
        timeout=TIME_LIMIT,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute(
        env={**os.environ, "PYTHONPATH": str(FOLDER.parent)}
    )  # this source, wherever the kernel's package is
    for cell in notebook.cells:
        cell.metadata.clear()
        if cell.cell_type == "code":
            cell.outputs = [
                each for each in cell.outputs if not _progress(each)
            ]  # it depends on how fast the machine is
    return notebook


def _progress(output):
    """Return whether an output is a line that says what goes on: it is displayed, and no picture."""
    return output.output_type == "display_data" and "image/png" not in output.data


def lighten(notebook):
    """Store the pictures of a notebook in 256 colors: a third of the bytes, and the eye sees no difference."""
    from PIL import Image

    for output in (output for cell in notebook.cells for output in cell.get("outputs", ())):
        if "image/png" in output.get("data", {}):
            picture = Image.open(io.BytesIO(base64.b64decode(output.data["image/png"]))).convert("RGB")
            target = io.BytesIO()
            picture.quantize(256, dither=Image.Dither.NONE).save(target, "PNG", optimize=True)
            output.data["image/png"] = base64.b64encode(target.getvalue()).decode()
    return notebook


def main(parts):
    """Execute the notebooks whose names contain one of some parts, and store them."""
    import nbformat

    for path in SCRIPTS:
        if not parts or any(part in path.name for part in parts):
            nbformat.write(lighten(executed(path)), path.with_suffix(".ipynb"))
            print(path.with_suffix(".ipynb").name, f"{path.with_suffix('.ipynb').stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
