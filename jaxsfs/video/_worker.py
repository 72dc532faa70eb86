"""A worker's part: one thread, whatever libraries it uses, and one batch after the other.

XLA's own threads share out single operations, which are short here: on busy cores they took three times the CPU time.

Imports neither JAX nor OpenCV, so that `pin_threads` comes first.
"""

import contextlib
import os
import sys

from jaxsfs.video._job import Job, Opened, read_frames, solve

# one thread each: as many workers as cores share a machine without getting in each other's way
PINS = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NPROC": "1",  # XLA's thread pool
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
}

_opened = Opened()


def pin_threads() -> None:
    """Sets the numbers of threads that libraries read when they are imported; what the environment says goes first."""
    if "jax" not in sys.modules:
        for name, number in PINS.items():
            os.environ.setdefault(name, number)
        if "xla_cpu_multi_thread_eigen" not in os.environ["XLA_FLAGS"]:
            os.environ["XLA_FLAGS"] += f" {PINS['XLA_FLAGS']}"
    import cv2

    cv2.setNumThreads(1)


def load(_: int = 0) -> None:
    """Imports what `solve_batch` needs: as long as a few frames take, and before the first of them is known."""
    pin_threads()
    import jaxsfs.files._frames
    import jaxsfs.files._store
    import jaxsfs.frames  # noqa: F401

    with contextlib.suppress(ImportError):
        import zarr  # noqa: F401


def solve_batch(job: Job, start: int, end: int) -> tuple[int, int, bytes]:
    """Reads, solves and stores the frames at positions `start` to before `end`: positions and statuses.

    Doing it twice leaves the same store as once.
    """
    pin_threads()
    frames, store = _opened.of(job)
    arrays = solve(read_frames(frames, store.indices[start:end].tolist()), job)
    store.write(start, arrays)
    return start, end, arrays["status"].tobytes()
