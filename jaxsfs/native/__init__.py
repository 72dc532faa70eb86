"""Inner loops that Numba compiles for the CPU, as functions that XLA calls; the extra `fast` brings Numba.

XLA makes a row of a sweep out of some hundred vector operations and computes shared values anew for each; here a row is
one loop. The functions know nothing of cameras or surfaces; what they compute is that of their namesakes in JAX.
"""

import importlib
import importlib.util
from collections.abc import Callable
from functools import cache
from typing import Any, Literal

import jax
import numpy as np
from jaxtyping import Array


@cache
def is_available() -> bool:
    """Whether Numba is installed."""
    return importlib.util.find_spec("numba") is not None


def preferred() -> Literal["rows", "numba"]:
    """Who computes sweeps over rows fastest here: Numba's functions where it is installed and JAX works on the CPU."""
    return "numba" if is_available() and jax.default_backend() == "cpu" else "rows"


BLOCK = 128  # pixels; with less, what a run of blocks costs by itself is more than what is left out

Target = Literal["sweeps", "rounds", "owners", "pulls", "pushes"]
_MODULES: dict[Target, str] = {
    "sweeps": "_rows",
    "rounds": "_arrivals",
    "owners": "_arrivals",
    "pulls": "_causal",
    "pushes": "_causal",
}


def target_for(what: Target, dtype) -> str:
    """The name under which XLA calls a function on images of a type; compiled when it is first asked for.

    `sweeps` over rows or columns of the static form; `rounds` of them for arrival times, and the `owners` of pixels
    there; `pulls` and `pushes`: of the linear system of derivatives and its transpose. Raises ModuleNotFoundError where
    Numba is not installed.
    """
    from jaxsfs.native._kernel import registered

    make = getattr(importlib.import_module(f"jaxsfs.native.{_MODULES[what]}"), what)
    return registered(f"jaxsfs.{what}.{np.dtype(dtype)}", make, np.dtype(dtype).type)


def function(what: Target, dtype, *like: Array | jax.ShapeDtypeStruct) -> Callable[..., Any]:
    """What `target_for` names, to be called in a traced program; its results have shape and type of `like`."""
    results = tuple(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in like)
    return jax.ffi.ffi_call(target_for(what, dtype), results, vmap_method="sequential")
