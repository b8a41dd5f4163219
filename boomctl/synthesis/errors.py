"""What a synthesis raises when it cannot vouch for a controller."""


class SynthesisError(RuntimeError):
    """No controller could be computed and verified; the message says which assumption fails, and at which signal."""
