"""Ctrl-C ends a command wherever it comes."""

import os
import signal
import time

import pytest

from jaxsfs.cli._interruption import interruptible

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this platform has no SIGALRM")


def test_at_once():
    with pytest.raises(KeyboardInterrupt), interruptible():
        os.kill(os.getpid(), signal.SIGINT)
        pytest.fail("the interrupt did not come")


def test_later_if_it_comes_within_a_callback_that_would_swallow_it():
    came = []

    def _xla_gc_callback():
        os.kill(os.getpid(), signal.SIGINT)
        came.append("finished")

    with pytest.raises(KeyboardInterrupt), interruptible():
        _xla_gc_callback()
        time.sleep(5)
        pytest.fail("the interrupt was lost")
    assert came == ["finished"]


def test_afterwards_all_is_as_before():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)
    with interruptible():
        pass
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)) == before
