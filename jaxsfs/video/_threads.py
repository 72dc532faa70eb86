"""Frames on this machine: a thread reads, some solve, and each writes what it solved."""

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path

import numpy as np

from jaxsfs.video._job import Job, read_frames, solve

Batch = tuple[int, int]  # first and end position in the store


def run_here(job: Job, batches: Sequence[Batch], *, threads: int, done: Callable[[Batch, np.ndarray], None]) -> None:
    """Computes and stores `batches`; `done` hears of each with its statuses.

    Reading, solving and writing overlap: they spend their time outside of Python's lock. At most one batch waits to be
    solved beside those in work, so memory does not depend on the length. With several devices the threads take turns.
    """
    from jaxsfs.files._store import FrameStore

    store = FrameStore(Path(job.store))
    stop = threading.Event()
    with ThreadPoolExecutor(threads, thread_name_prefix="jaxsfs") as pool, _reading(job, store, batches, stop) as read:
        running: dict[Future[np.ndarray], Batch] = {}
        try:
            for number, (batch, stored) in enumerate(read):
                running[pool.submit(_solved, job, store, batch, stored, number)] = batch
                if len(running) >= threads:
                    _settle(running, done)
            while running:
                _settle(running, done)
        finally:
            stop.set()
            for future in running:
                future.cancel()


def _settle(running: dict[Future[np.ndarray], Batch], done: Callable[[Batch, np.ndarray], None]) -> None:
    for future in wait(running, return_when=FIRST_COMPLETED).done:
        done(running.pop(future), future.result())


def _solved(job: Job, store, batch: Batch, stored: list[np.ndarray | None], number: int) -> np.ndarray:
    import jax

    devices = jax.local_devices()
    with jax.default_device(devices[number % len(devices)]) if len(devices) > 1 else contextlib.nullcontext():
        arrays = solve(stored, job)
    store.write(batch[0], arrays)
    return arrays["status"]


@contextlib.contextmanager
def _reading(
    job: Job, store, batches: Sequence[Batch], stop: threading.Event
) -> Iterator[Iterator[tuple[Batch, list[np.ndarray | None]]]]:
    """Batches of stored frames, read ahead by one."""
    from jaxsfs.files._frames import open_frames

    ahead: queue.Queue = queue.Queue(maxsize=1)

    def put(item) -> None:
        while not stop.is_set():
            with contextlib.suppress(queue.Full):
                ahead.put(item, timeout=0.1)
                return

    def read() -> None:
        frames = None
        try:
            frames = open_frames(job.source)
            for batch in batches:
                if stop.is_set():
                    return
                put((batch, read_frames(frames, store.indices[slice(*batch)].tolist())))
            put(None)
        except BaseException as error:  # raised again where the frames are awaited
            put(error)
        finally:
            if frames is not None:
                frames.close()

    def items() -> Iterator[tuple[Batch, list[np.ndarray | None]]]:
        while (item := ahead.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item

    reader = threading.Thread(target=read, name="jaxsfs-reader", daemon=True)
    reader.start()
    try:
        yield items()
    finally:
        stop.set()
        reader.join()
