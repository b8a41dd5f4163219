"""What a docstring says, section by section."""

import inspect
import re


def sections(documented):
    """Return the sections of a docstring: of each its entries, the first line of one and what is said of it."""
    found = {}
    text = inspect.getdoc(documented) or ""
    parts = re.split(r"^(\w+)\n-{3,}\n", text, flags=re.MULTILINE)
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        entries = re.findall(r"^(\S.*)\n((?:(?:    .*)?\n|    .*$)*)", body.rstrip() + "\n", flags=re.MULTILINE)
        found[title] = [(first, said.strip()) for first, said in entries]
    return found
