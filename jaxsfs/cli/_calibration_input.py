"""The photographs that a calibration reads."""

import dataclasses
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Shaped, UInt8

from jaxsfs import files
from jaxsfs.cli._terminal import progress
from jaxsfs.files._atomic import read_bytes
from jaxsfs.photo import automatic_response
from jaxsfs.photometry import AbstractResponse, parse_response

_LIT = 0.1  # of the bright values
_DEAD = 1e-4  # of the pixels: the fits cull what a few single ones do


@dataclasses.dataclass(frozen=True)
class Photographs:
    """Stored values, what they look like, and which files they came from."""

    images: list[Shaped[np.ndarray, "_height _width *_channels"]]
    pictures: list[UInt8[np.ndarray, "_height _width 3"]]
    response: AbstractResponse
    response_text: str
    sources: list[dict[str, Any]]

    @property
    def names(self) -> list[str]:
        return [source["file"] for source in self.sources]


def read_photographs(paths: Sequence[Path], response: str) -> Photographs:
    """All photographs. `response` "auto" follows the stored type. Raises InputError for files that are no images, that
    differ in stored type, or that are given twice."""
    progress(f"reading {len(paths)} photograph(s)")
    sources = [{"file": str(path), "sha256": hashlib.sha256(read_bytes(path)).hexdigest()} for path in paths]
    seen: dict[str, str] = {}
    for source in sources:
        if source["sha256"] in seen:
            raise files.InputError(
                f"{source['file']} and {seen[source['sha256']]} are the same photograph: give each once"
            )
        seen[source["sha256"]] = source["file"]
    photos = [files.read_image(path) for path in paths]
    for path, photo in zip(paths, photos, strict=True):
        _check_whole(photo, path)
    kinds = {photo.dtype for photo in photos}
    if len(kinds) > 1:
        raise files.InputError(f"all photographs must be stored alike, these are {', '.join(sorted(kinds))}")
    text = automatic_response(photos[0].dtype) if response == "auto" else response
    try:
        parsed = parse_response(text)
    except ValueError as error:
        raise files.InputError(f"--response: {error}") from None
    return Photographs(
        [_stored(photo) for photo in photos],
        [photo.rgb8() for photo in photos],
        parsed,
        text,
        sources,
    )


def _check_whole(photo: files.Photo, path: Path) -> None:
    """Raises InputError for numbers that are none amid the picture: what is put in their place would make edges.

    Dark noise below 0 and a transparent surround lie where nothing is lit.
    """
    if np.issubdtype(np.dtype(photo.dtype), np.integer):
        return
    grey = photo.values.mean(axis=2) if photo.values.ndim == 3 else photo.values
    lit = (grey > _LIT * np.percentile(grey, 99)).astype(np.uint8)
    dead = np.logical_not(photo.valid) & (cv2.dilate(lit, np.ones((5, 5), np.uint8)) > 0)
    if np.mean(dead) > _DEAD:
        rows = np.nonzero(dead.any(axis=1))[0]
        raise files.InputError(
            f"{path} has {np.mean(~photo.valid):.2%} NaN, infinite or negative pixels, also where the picture is lit "
            f"(rows {rows[0]} to {rows[-1]}): their borders would pass for edges of the target. Fill them from their "
            "neighbours and save the photograph again"
        )


def _stored(photo: files.Photo) -> Shaped[np.ndarray, "_height _width *_channels"]:
    """The values in the type of the file, which tells the calibrations what clipping and black are."""
    kind = np.dtype(photo.dtype)
    if not np.issubdtype(kind, np.integer):
        return np.asarray(photo.values, np.float64)
    return np.rint(np.asarray(photo.values, np.float64) * np.iinfo(kind).max).astype(kind)
