"""Ctrl-C ends a command wherever it comes."""

import os
import signal
import time
from collections.abc import Callable

import pytest

from jaxsfs.cli._interruption import interruptible

pytestmark = [
    pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this platform has no SIGALRM"),
    pytest.mark.usefixtures("heeds_interrupts"),
]


def run(what: Callable[[], None]) -> None:
    with interruptible():
        what()
        time.sleep(5)  # long enough for an interrupt that comes later


def test_at_once():
    with pytest.raises(KeyboardInterrupt):
        run(lambda: os.kill(os.getpid(), signal.SIGINT))


def test_later_if_it_comes_within_a_callback_that_would_swallow_it():
    came = []

    def _xla_gc_callback():
        os.kill(os.getpid(), signal.SIGINT)
        came.append("finished")

    with pytest.raises(KeyboardInterrupt):
        run(_xla_gc_callback)
    assert came == ["finished"]


def test_afterwards_all_is_as_before():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)
    with interruptible():
        pass
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)) == before
