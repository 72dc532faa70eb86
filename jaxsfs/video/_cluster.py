"""Frames on the workers of a Dask cluster: one that is there, or one of processes on this machine."""

import contextlib
import logging
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from jaxsfs.video._job import Job
from jaxsfs.video._worker import PINS, load, solve_batch

Batch = tuple[int, int]

_TRIES = 4  # of a batch whose worker dies; a batch that kills four workers is itself the cause
_PATIENCE = 20.0  # seconds to find a scheduler


def run_there(client, job: Job, batches: Sequence[Batch], *, done: Callable[[Batch, np.ndarray], None]) -> None:
    """Computes and stores `batches` on the workers of a `client`.

    Workers read the source and write the store themselves. A batch whose worker dies goes to another one. Raises what
    a batch raised.
    """
    from distributed import as_completed

    futures = client.map(
        solve_batch, *zip(*[(job, *batch) for batch in batches], strict=True), pure=False, retries=_TRIES - 1
    )
    try:
        for future, (start, end, statuses) in as_completed(futures, with_results=True):
            done((start, end), np.frombuffer(statuses, np.int8))
            future.release()
    except BaseException:
        client.cancel(futures)
        raise


@contextlib.contextmanager
def workers(scheduler: str | None, processes: int) -> Iterator[Any]:
    """A client of `scheduler`, or of `processes` workers here, which load the libraries meanwhile.

    Raises OSError where no scheduler answers.
    """
    with _client(scheduler, processes) as client:
        if processes:
            client.map(load, range(processes), pure=False)
        yield client


@contextlib.contextmanager
def _client(scheduler: str | None, processes: int) -> Iterator[Any]:
    try:
        import dask.config
        from distributed import Client, LocalCluster
    except ImportError:
        raise OSError("a cluster needs the extra: pip install 'jaxsfs[cluster]'") from None
    if scheduler is not None:
        with Client(scheduler, timeout=_PATIENCE) as client:
            yield client
        return
    # set by the nanny before the worker's interpreter starts; spawned, since a fork of a process that runs JAX hangs
    pinned = {
        "distributed.nanny.pre-spawn-environ": PINS | _cache(),
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.scheduler.allowed-failures": _TRIES - 1,
    }
    with dask.config.set(pinned):
        with _interrupts_ignored():
            options: dict[str, Any] = {"dashboard_address": ":0", "memory_limit": 0, "silence_logs": logging.ERROR}
            cluster = LocalCluster(n_workers=processes, threads_per_worker=1, **options)
        with cluster, Client(cluster) as client:
            yield client


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Processes started meanwhile leave Ctrl-C to this one, which ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _cache() -> dict[str, str]:
    """This process's cache of compiled programs, for its workers."""
    import jax

    folder = jax.config.values["jax_compilation_cache_dir"]
    if folder is None:
        return {}
    return {"JAX_COMPILATION_CACHE_DIR": str(folder), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
