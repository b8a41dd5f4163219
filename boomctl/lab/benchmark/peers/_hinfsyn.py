"""``control.hinfsyn`` at the other end of two pipes, where a hang can be killed: a call for each line that comes in.

A line is a plant as JSON, and so is the answer: the processor time of the call [s], the controller and the gamma that was
claimed, or the error.
"""

import json
import os
import sys
import time

import numpy as np


def main() -> None:
    """Answer until standard input ends."""
    import control

    sink = os.fdopen(os.dup(1), "w")
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    for line in sys.stdin:
        given = json.loads(line)
        P = control.ss(*(np.array(given[name], dtype=float) for name in "ABCD"))
        start = time.process_time()
        try:
            K, _, gamma, _ = control.hinfsyn(P, given["nmeas"], given["ncon"])
        except Exception as error:
            answer: dict[str, object] = {"error": " ".join(str(error).split())}
        else:
            answer = {"gamma": float(gamma), "K": [np.asarray(part).tolist() for part in (K.A, K.B, K.C, K.D)]}
        answer["seconds"] = time.process_time() - start
        sink.write(json.dumps(answer) + "\n")
        sink.flush()


if __name__ == "__main__":
    main()
