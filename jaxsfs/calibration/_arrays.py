"""More of numpy and JAX at once: loops, constants and sums of the compiled fits and of their twins on the host."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, Int

from jaxsfs._arrays import AnyArray, module_of


def repeated(xp: ModuleType, count: int, step: Callable[[Any], Any], state: Any) -> Any:
    """`step` applied `count` times."""
    if xp is not np:
        return jax.lax.fori_loop(0, count, lambda _, current: step(current), state)
    for _ in range(count):
        state = step(state)
    return state


def constant(value: Any) -> Any:
    """`value`, not to be differentiated."""
    return value if isinstance(value, np.ndarray) else jax.lax.stop_gradient(value)


def sum_by_group(values: Float[AnyArray, "count ..."], group: Int[AnyArray, " count"], groups: int) -> AnyArray:
    """Sums over the rows of each group 0 … groups − 1."""
    if module_of(values) is not np:
        return jax.ops.segment_sum(values, group, groups)
    total = np.zeros((groups, *values.shape[1:]))
    np.add.at(total, group, values)
    return total
