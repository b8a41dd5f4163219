"""Tables and figures of the papers, computed and published values."""
