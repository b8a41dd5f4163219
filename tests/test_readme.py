"""Every Python block of the README runs alone, as a reader would paste it."""

import re
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize(
    "block", [pytest.param(block, marks=pytest.mark.slow if "optimal_slew" in block else ()) for block in BLOCKS]
)
def test_a_block_of_the_readme_runs_alone(block, tmp_path, monkeypatch):
    """What it writes is written elsewhere."""
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    with mpl.rc_context():
        exec(compile(block, "README.md", "exec"), names)
    plt.close("all")
    assert set(names) > {"__builtins__", "bc"}
