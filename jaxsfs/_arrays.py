"""One formula for two places: numpy on the host, JAX wherever it is compiled or differentiated.

On the host nothing is compiled, so that arrays may have any length: JAX compiles every operation anew for each shape.
"""

from types import ModuleType
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

if TYPE_CHECKING:  # what goes in comes out: a checker would want an overload of every function
    AnyArray = Any
else:
    AnyArray = Array | np.ndarray


def module_of(value: Any, *parameters: Any) -> ModuleType:
    """numpy for its arrays, unless a parameter is one of JAX's (or traced); jax.numpy for anything else."""
    plain = all(isinstance(parameter, np.ndarray | np.generic | float | int) for parameter in parameters)
    return np if plain and isinstance(value, np.ndarray) else jnp
