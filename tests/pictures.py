"""Draws the figures of the docs: ``python -m tests.pictures [PART OF A PAGE'S NAME ...]``.

Each figure is the result of the code block above it.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "docs" / "howto" / "plot_results.md", ROOT / "docs" / "reference" / "designs.md")
STEP = re.compile(r"```python\n(.*?)```|!\[[^\]]*\]\(((?:\.\./)*pictures/\w+\.png)\)", flags=re.DOTALL)
DOTS_PER_INCH = 80  # some 30 kB a picture


def main(parts) -> None:
    """Run the blocks of each page in order; a picture is the last figure drawn before it, if there is one."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    for page in PAGES:
        names: dict[str, object] = {}
        steps = (
            STEP.findall(page.read_text(encoding="utf-8")) if not parts or any(p in page.name for p in parts) else ()
        )
        for code, target in steps:
            if code:
                exec(compile(code, str(page), "exec"), names)
            elif plt.get_fignums():
                plt.savefig(page.parent / target, dpi=DOTS_PER_INCH, bbox_inches="tight")
                plt.close("all")


if __name__ == "__main__":
    main(sys.argv[1:])
