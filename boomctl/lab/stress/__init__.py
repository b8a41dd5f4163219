"""What the package promises, tried where it is hardest: each case against a reference of its own, and what was seen."""
