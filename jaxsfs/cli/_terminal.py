"""The terminal: errors, progress, and the JAX that a command runs in."""

import contextlib
import os
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path


class CannotRun(ValueError):
    """The words of a command make no sense together; the message says what was expected, what came, what to do."""


def progress(line: str) -> None:
    """Says on a terminal's stderr what is being done; a file or a pipe does not need to know."""
    if sys.stderr.isatty() and not quiet.get():
        print(f"jaxsfs: {line} …", file=sys.stderr, flush=True)


def say(text: str) -> None:
    """Prints what became of files that were written, unless the user wants --quiet. Data is printed by `print`."""
    if not quiet.get():
        print(text)


def warn(text: str) -> None:
    """Says on stderr what is probably not as the user thinks; --quiet does not keep it back."""
    print(f"jaxsfs: warning: {text}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def jax_session(precision: int) -> Iterator[None]:
    """JAX in 32 or 64 bit for a `with` block, its compiled programs kept in the user's cache folder for next time.

    The folder is $JAX_COMPILATION_CACHE_DIR, or jaxsfs in $XDG_CACHE_HOME or ~/.cache.
    """
    import jax

    if jax.config.values["jax_compilation_cache_dir"] is None and (folder := _cache_folder()) is not None:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        # many small programs make up the second second of a start
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    with jax.enable_x64(precision == 64):
        yield


def _cache_folder() -> Path | None:
    """None where it cannot be made: a machine without a writable home runs without a cache."""
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    try:
        folder = Path(base).expanduser() / "jaxsfs"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return folder if os.access(folder, os.W_OK) else None


def versions() -> dict[str, str]:
    """Versions of what computed a result."""
    import platform
    from importlib.metadata import version

    packages = ("jaxsfs", "jax", "jaxlib", "equinox", "numpy", "scipy", "opencv-python-headless", "trimesh")
    return {"python": platform.python_version()} | {name: version(name) for name in packages}


# `main` sets these: whether --quiet was given, and the line that a result records as what made it.
quiet: ContextVar[bool] = ContextVar("quiet", default=False)
started: ContextVar[float] = ContextVar("started", default=0.0)  # the command, in time.perf_counter
command_line: ContextVar[str] = ContextVar("command_line", default="jaxsfs")
