"""Indices for points that lie on a distorted lattice: grown from a seed, neighbour by neighbour."""

from collections import deque

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

_STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))
_REACH = 0.3  # of a step: how far a neighbour may lie from where it is expected


def grow_lattice(points: Float[np.ndarray, "count 2"]) -> tuple[Int[np.ndarray, " found"], Int[np.ndarray, "found 2"]]:
    """Rows of `points` on the largest lattice found, and their indices (column, row): columns run to the right, rows
    down. Empty if no point has two neighbours in different directions."""
    best: dict[tuple[int, int], int] = {}
    if len(points) < 4:
        return np.zeros(0, int), np.zeros((0, 2), int)
    tree = KDTree(points)
    middle = np.median(points, axis=0)
    for seed in np.argsort(np.hypot(*(points - middle).T))[:12]:
        basis = _basis(points, tree, int(seed))
        if basis is not None:
            found = _grow(points, tree, int(seed), basis)
            best = max(best, found, key=len)
        if len(best) > 0.8 * len(points):
            break
    if len(best) < 4:
        return np.zeros(0, int), np.zeros((0, 2), int)
    rows = np.array(list(best.values()))
    return rows, _upright(np.array(list(best.keys())), points[rows])


def _basis(points, tree: KDTree, seed: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Two steps from the seed: to its nearest neighbour, and to the nearest one across, each with a counterpart on
    the opposite side."""
    _, near = tree.query(points[seed], k=min(9, len(points)))
    steps = points[np.asarray(near)[1:]] - points[seed]
    kept = []
    for step in steps:
        gap, _ = tree.query(points[seed] - step)
        if gap < 0.35 * np.hypot(*step):
            kept.append(step)
    if len(kept) < 2:
        return None
    first = kept[0]
    # the shortest, most upright second step: not a diagonal
    sines = [abs(first[0] * b[1] - first[1] * b[0]) / (np.hypot(*first) * np.hypot(*b)) for b in kept[1:]]
    costs = [np.hypot(*b) / max(sine, 1e-3) ** 3 for b, sine in zip(kept[1:], sines, strict=True)]
    best = int(np.argmin(costs))
    return _reduced(first, kept[1 + best]) if sines[best] > 0.5 else None


def _reduced(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The shortest basis of the same lattice (Gauss): diagonals become sides."""
    for _ in range(8):
        if np.hypot(*first) > np.hypot(*second):
            first, second = second, first
        shift = round(float(first @ second / (first @ first)))
        if shift == 0:
            break
        second = second - shift * first
    return first, second


def _grow(points, tree: KDTree, seed: int, basis) -> dict[tuple[int, int], int]:
    index, taken = {(0, 0): seed}, {seed}
    local = {(0, 0): basis}
    queue = deque([(0, 0)])
    while queue:
        at = queue.popleft()
        first, second = local[at]
        for i, j in _STEPS:
            there = (at[0] + i, at[1] + j)
            if there in index:
                continue
            step = i * first + j * second
            gap, found = tree.query(points[index[at]] + step)
            if gap > _REACH * np.hypot(*step) or found in taken:
                continue
            moved = points[found] - points[index[at]]
            index[there] = int(found)
            taken.add(int(found))
            # the step just made is the best guess of the next one
            local[there] = (moved * i, second) if i else (first, moved * j)
            queue.append(there)
    return index


def _upright(index: Int[np.ndarray, "found 2"], points: Float[np.ndarray, "found 2"]) -> Int[np.ndarray, "found 2"]:
    """The same indices turned by a multiple of 90° (and mirrored if need be) so that columns run right, rows down."""
    design = np.column_stack([index, np.ones(len(index))])
    steps = np.linalg.lstsq(design, points, rcond=None)[0][:2]
    if abs(steps[0, 0]) < abs(steps[1, 0]):
        index, steps = index[:, ::-1], steps[::-1]
    turned = index * np.array([np.sign(steps[0, 0]) or 1, np.sign(steps[1, 1]) or 1]).astype(int)
    return turned - turned.min(axis=0)
