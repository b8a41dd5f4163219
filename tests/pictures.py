"""Draws the pictures of ``docs/pictures.md`` anew: ``python -m tests.pictures``.  Each shows what stands above it."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "pictures.md"
STEP = re.compile(r"```python\n(.*?)```|!\[[^\]]*\]\((pictures/\w+\.png)\)", flags=re.DOTALL)
DOTS_PER_INCH = 80  # some 30 kB a picture


def main() -> None:
    """Run the blocks in order; a picture is the last figure that was drawn before it."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    names: dict[str, object] = {}
    for code, target in STEP.findall(PAGE.read_text(encoding="utf-8")):
        if code:
            exec(compile(code, str(PAGE), "exec"), names)
        else:
            plt.savefig(PAGE.parent / target, dpi=DOTS_PER_INCH, bbox_inches="tight")
            plt.close("all")


if __name__ == "__main__":
    main()
