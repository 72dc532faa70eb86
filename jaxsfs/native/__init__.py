"""Inner loops that Numba compiles for the CPU, as functions that XLA calls; the extra `fast` brings Numba.

XLA makes a row of a sweep out of some hundred vector operations and computes shared values anew for each; here a row is
one loop. The functions know nothing of cameras or surfaces; what they compute is that of their namesakes in JAX.
"""

import importlib.util
from functools import cache
from typing import Literal

import jax
import numpy as np


@cache
def is_available() -> bool:
    """Whether Numba is installed."""
    return importlib.util.find_spec("numba") is not None


def preferred() -> Literal["rows", "numba"]:
    """Who computes sweeps over rows fastest here: Numba's functions where it is installed and JAX works on the CPU."""
    return "numba" if is_available() and jax.default_backend() == "cpu" else "rows"


def target_for_sweeps(dtype) -> str:
    """The name under which XLA calls both sweeps over rows or columns of the static form, for images of a type."""
    from jaxsfs.native import _rows
    from jaxsfs.native._kernel import registered

    return registered(_rows.sweeps_in_single if dtype == np.float32 else _rows.sweeps_in_double)


def target_for_arrival(dtype) -> str:
    """The same for arrival times."""
    from jaxsfs.native import _arrival
    from jaxsfs.native._kernel import registered

    return registered(_arrival.sweeps_in_single if dtype == np.float32 else _arrival.sweeps_in_double)


def target_for_offers(dtype) -> str:
    """The name under which XLA asks what arrival times each pixel is offered from both sides."""
    from jaxsfs.native import _arrival
    from jaxsfs.native._kernel import registered

    return registered(_arrival.offers_in_single if dtype == np.float32 else _arrival.offers_in_double)
