"""Ctrl-C that is never lost."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

_AGAIN = 0.02  # s
_SWALLOWS = {"_xla_gc_callback", "__del__"}  # whatever these raise, Python prints and forgets


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt in this block, and later if it comes within a callback of the garbage collector.

    JAX adds such a callback, in which one of five interrupts came: the exception was dropped and the command went on.
    Only where the platform has SIGALRM, in the main thread, and where nobody else handles SIGINT.
    """
    free = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not (free and hasattr(signal, "SIGALRM") and threading.current_thread() is threading.main_thread()):
        yield
        return
    alarm = signal.signal(signal.SIGALRM, _interrupt)
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGALRM, alarm)


def _interrupt(_signal: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_name in _SWALLOWS:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
            return
        frame = frame.f_back
    raise KeyboardInterrupt
