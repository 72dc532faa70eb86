"""Differences between neighbouring pixels of a region of any shape, as sparse matrices."""

from typing import Any

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Int

Numbers = Int[np.ndarray, "height width"]


def operators(inside: Bool[np.ndarray, "height width"]) -> tuple[Any, Any]:
    """Laplacian (at pixels with all four neighbours, else along the axes that have both) and gradient, as matrices.

    Columns, and the Laplacian's rows, are the pixels `inside` in reading order.
    """
    index = np.full(inside.shape, -1, np.int32)
    index[inside] = np.arange(int(inside.sum()), dtype=np.int32)
    count = int(inside.sum())
    first, second = [], []
    for axis in (0, 1):
        size = index.shape[axis]
        here, there = (index.take(range(k, size - 1 + k), axis) for k in range(2))
        pair = (here >= 0) & (there >= 0)
        first.append(_matrix(np.arange(int(pair.sum())), [(here[pair], -1), (there[pair], 1)], int(pair.sum()), count))
        before, middle, after = (index.take(range(k, size - 2 + k), axis) for k in range(3))
        triple = (before >= 0) & (middle >= 0) & (after >= 0)
        rows = middle[triple]
        second.append(_matrix(rows, [(before[triple], 1), (rows, -2), (after[triple], 1)], count, count))
    return second[0] + second[1], sp.vstack(first).tocsr()


def _matrix(rows: Int[np.ndarray, "_"], terms: list[tuple[np.ndarray, int]], height: int, width: int) -> Any:
    columns = np.concatenate([column for column, _ in terms])
    data = np.repeat(np.array([value for _, value in terms], float), len(rows))
    return sp.csr_matrix((data, (np.tile(rows, len(terms)), columns)), shape=(height, width))
