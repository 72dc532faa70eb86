"""What XLA shall compute once."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool


def once(tree, never: Bool[Array, ""]):
    """`tree`, computed once; `never` is false in a way that the compiler cannot know.

    Left alone, XLA's CPU backend computes a value anew in every loop that reads it (several times the time of the
    whole), and it removes barriers before it fuses; it does not look through a branch.
    """
    return jax.lax.cond(never, lambda t: jax.tree.map(jnp.zeros_like, t), lambda t: t, tree)
