"""Strict surroundings for every test: 64 bit at hand, no silent rank or dtype promotion, annotations checked."""

import os
import signal
from importlib.metadata import version
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")
KEPT = Path(__file__).parents[1] / ".pytest_cache"
# what the commands compile goes there, not to the user's folder
os.environ["XDG_CACHE_HOME"] = str(KEPT / "home")
# most of the suite's time is compilation of programs that run once: these two halve it (later versions stop at the
# first one, which they do not know)
_older = tuple(map(int, version("jaxlib").split(".")[:2])) < (0, 11)
_flags = "--xla_backend_optimization_level=1" + (" --xla_cpu_use_fusion_emitters=false" if _older else "")
os.environ.setdefault("XLA_FLAGS", _flags)

from jaxtyping import install_import_hook

_hook = install_import_hook(["jaxsfs", "data_synth"], "beartype.beartype")

import jax
import pytest

# compiled programs are shared between the workers, and kept for the next run
jax.config.update("jax_compilation_cache_dir", str(KEPT / "jax"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")


@pytest.fixture
def heeds_interrupts():
    """SIGINT as in a terminal, here and in processes started from here: a shell ignores it for what runs behind."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real images beside the project; tests that want it skip where it is absent."""
    folder = Path(os.environ.get("JAXSFS_DATA", Path(__file__).parents[1] / "../shared/data")).resolve()
    if not folder.is_dir():
        pytest.skip(f"no real images at {folder}; set JAXSFS_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def view(tmp_path_factory) -> Path:
    """The folder of a small rendered view, not to be written to."""
    from cli_folders import rendered

    return rendered(tmp_path_factory.mktemp("rendered") / "view")


@pytest.fixture(scope="session")
def result(view) -> Path:
    """What `jaxsfs reconstruct` wrote for it, not to be written to."""
    from cli_folders import main, reconstruct

    folder = view.parent / "result"
    assert main(reconstruct(view, folder)) == 0
    return folder
