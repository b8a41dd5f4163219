"""The papers' tables and figures, computed again beside what was published."""
