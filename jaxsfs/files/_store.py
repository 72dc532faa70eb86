"""Results of many frames in one Zarr folder that xarray, napari and others open; written batch by batch, resumable."""

import json
import math
import shutil
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from jaxsfs.files._atomic import InputError

_MARK = "jaxsfs frames"
_LAYOUT = 1
_MISSING = -1  # status of a frame that was not computed yet
_PIXEL_ARRAYS = {
    "range": ("float32", math.nan, "distance from the projection centre along each pixel's ray; NaN where not valid"),
    "valid": ("bool", False, "pixels that have a surface"),
    "residual": ("float16", math.nan, "|E rendered from the surface - E| / mean E; NaN where there is no normal"),
}
_CHUNK_BYTES = 8 << 20  # of the range


class FrameStore:
    """Frames of one run, as Zarr arrays with the dimensions frame, v (row) and u (column).

    A batch is a chunk of every array. Its statuses are written last: whatever else of a batch is on disk, a batch
    counts when they are, so a killed run loses at most the batches in flight, and a batch that is written twice is
    there once.
    """

    def __init__(self, path: Path):
        self.path = path
        self._group: Any = _zarr().open_group(str(path), mode="r+")
        attributes = dict(self._group.attrs)
        if attributes.get("kind") != _MARK or attributes.get("layout") != _LAYOUT:
            raise InputError(f"{path} is not a folder that jaxsfs video wrote (or another version did)")
        self.attributes = attributes
        self.batch = int(self._group["status"].chunks[0])
        self.indices: Int[np.ndarray, " frames"] = np.asarray(self._group["frame"][:])

    def batches(self) -> list[tuple[int, int]]:
        """First and end position (in this store) of each batch."""
        return [(k, min(k + self.batch, len(self.indices))) for k in range(0, len(self.indices), self.batch)]

    def statuses(self) -> Int[np.ndarray, " frames"]:
        """A number per frame: its place in the attribute flag_meanings of `status`, -1 for those to come."""
        return np.asarray(self._group["status"][:])

    def missing(self) -> list[tuple[int, int]]:
        """The batches that are not there."""
        statuses = self.statuses()
        return [(start, end) for start, end in self.batches() if (statuses[start:end] == _MISSING).any()]

    def write(self, start: int, values: Mapping[str, np.ndarray]) -> None:
        """A whole batch from position `start` on: an array per name, the first axis the frames."""
        end = start + len(values["status"])
        for name in sorted(values, key=lambda name: name == "status"):
            self._group[name][start:end] = values[name]


def create_store(
    path: Path,
    indices: Sequence[int],
    size: tuple[int, int],
    *,
    statuses: Mapping[str, str],
    figures: Mapping[str, str],
    attributes: Mapping[str, Any],
    unit: str,
    per_second: float | None = None,
    batch: int | None = None,
    force: bool = False,
) -> FrameStore:
    """A store for frames `indices` of a source, of `size` (width, height); an earlier one goes on if it is of the same
    frames and `attributes`.

    `statuses`, `figures`: name → meaning. Raises InputError where another store or something else is in the way.
    """
    path = Path(path)
    if path.exists() and any(path.iterdir() if path.is_dir() else [path]):
        kept = _kept(path, indices, attributes, force)
        if kept is not None:
            return kept
    width, height = size
    batch = batch or max(1, min(16, _CHUNK_BYTES // (4 * width * height)))
    zarr = _zarr()
    try:
        group = zarr.open_group(str(path), mode="w", attributes={"kind": "jaxsfs frames, being made"})
    except OSError as error:
        raise InputError(f"cannot write the results to {path}: {error.strerror or error}") from None
    count = len(indices)
    for name, (dtype, fill, meaning) in _PIXEL_ARRAYS.items():
        about = {"long_name": meaning} | ({"unit": unit} if name == "range" else {})
        _array(group, name, dtype, (count, height, width), (batch, height, width), fill, "frame v u", about)
    for name, meaning in figures.items():
        _array(group, name, "float64", (count,), (batch,), math.nan, "frame", {"long_name": meaning})
    flags = {"flag_values": list(range(-1, len(statuses))), "flag_meanings": " ".join(["missing", *statuses])}
    _array(group, "status", "int8", (count,), (batch,), _MISSING, "frame", flags | {"messages": dict(statuses)})
    _coordinate(group, "frame", np.asarray(indices, np.int64), "number of the frame in the source, from 0")
    _coordinate(group, "v", np.arange(height), "pixel row, down, 0 at the centre of the first one")
    _coordinate(group, "u", np.arange(width), "pixel column, right, 0 at the centre of the first one")
    if per_second is not None:
        times = np.asarray(indices, np.float64) / per_second
        _array(group, "time", "float64", (count,), (max(1, count),), math.nan, "frame", {"unit": "seconds"})[:] = times
    # the mark comes last: a store that was not finished is none
    group.attrs.update({**attributes, "kind": _MARK, "layout": _LAYOUT})
    with warnings.catch_warnings():  # that the one file for all metadata is no part of Zarr 3 yet; xarray looks for it
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(path))
    return FrameStore(path)


def _kept(path: Path, indices: Sequence[int], attributes: Mapping[str, Any], force: bool) -> FrameStore | None:
    """The store that is there, if it is to go on; None after removing one that `force` gives up."""
    kind = _kind(path)
    if kind is None:
        raise InputError(f"{path} exists already and is no store of frames; choose another name for --out")
    if kind != _MARK or force:
        shutil.rmtree(path)
        return None
    store = FrameStore(path)
    wanted = json.loads(json.dumps(dict(attributes)))  # as it comes back from the file
    if store.indices.tolist() != list(indices):
        raise InputError(f"{path} holds other frames of {store.attributes.get('source')!r}; {_CHOICES}")
    differing = [key for key, value in wanted.items() if key not in _FREE and store.attributes.get(key) != value]
    if differing:
        raise InputError(f"{path} was made with other settings ({', '.join(differing)} differ); {_CHOICES}")
    return store


_FREE = ("command", "versions")  # may differ between a run and the one that goes on with it
_CHOICES = "choose another name for --out, or start again with --force"


def _kind(path: Path) -> str | None:
    try:
        found = json.loads((path / "zarr.json").read_text())["attributes"]["kind"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return found if isinstance(found, str) and found.startswith(_MARK) else None


def _array(group, name, dtype, shape, chunks, fill, dimensions: str, attributes):
    array = group.create_array(
        name,
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        fill_value=fill,
        dimension_names=dimensions.split(),
        attributes=attributes,
        # a higher level takes twice the time for 4 % less
        compressors=_zarr().codecs.BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"),
    )
    return array


def _coordinate(group, name: str, values: np.ndarray, meaning: str) -> None:
    size = len(values)
    _array(group, name, str(values.dtype), (size,), (max(1, size),), 0, name, {"long_name": meaning})[:] = values


def _zarr():
    try:
        import zarr
    except ImportError:
        raise InputError("frames are stored with zarr; install the extra: pip install 'jaxsfs[cluster]'") from None
    import zarr.codecs

    return zarr
