"""The other end of ``boomctl.synthesis.hinf.native``: runs native synthesis where it can be killed.

Requests come through standard input, answers go through what was standard output; whatever native code prints is lost.
The file runs by itself, as a script, and imports nothing of the package, so that the process is there soon.
"""

import os
import struct
import sys
import time
from typing import BinaryIO

import numpy as np

REQUEST = struct.Struct("<5qd")
ANSWER = struct.Struct("<3qd")
READY = b"boomctl"


def _read(source: BinaryIO, count: int) -> bytes:
    data = source.read(count)
    if len(data) != count:
        sys.exit(0)
    return data


def _matrix(source: BinaryIO, rows: int, columns: int) -> np.ndarray:
    return np.frombuffer(_read(source, 8 * rows * columns)).reshape(rows, columns).copy()


def _serve(source: BinaryIO, sink: BinaryIO) -> None:
    import slycot

    sink.write(READY)
    sink.flush()
    while True:
        n, m, p, ncon, nmeas, gamma = REQUEST.unpack(_read(source, REQUEST.size))
        A, B, C, D = (_matrix(source, *shape) for shape in ((n, n), (n, m), (p, n), (p, m)))
        start = time.process_time()
        try:
            K = slycot.sb10fd(n, m, p, ncon, nmeas, gamma, A, B, C, D, 0.0)[:4]
            payload = b"".join(np.ascontiguousarray(part, dtype=float).tobytes() for part in K)
            head = ANSWER.pack(1, len(K[0]), len(payload), time.process_time() - start)
        except Exception as error:
            payload = " ".join(str(error).split()).encode("utf-8", "replace")
            head = ANSWER.pack(0, 0, len(payload), time.process_time() - start)
        sink.write(head + payload)
        sink.flush()


def main() -> None:
    """Serve until standard input ends."""
    source = os.fdopen(os.dup(0), "rb")
    sink = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    os.dup2(nothing, 1)
    _serve(source, sink)


if __name__ == "__main__":
    main()
