"""What a batch of frames needs, as plain values that travel to another process."""

import dataclasses
import functools
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:  # JAX comes later, see __init__
    from jaxsfs.files._frames import AbstractFrames
    from jaxsfs.files._store import FrameStore
    from jaxsfs.frames import FrameResult, FrameSettings


@dataclasses.dataclass(frozen=True)
class Job:
    """One run over the frames of `source` into `store` (absolute paths, for workers that start elsewhere).

    `camera`: the camera file's content; `response`, `falloff`, `reflectance`, `channel`: as at the command line;
    `mask`: bits of the pixels to use, packed; the rest as in `FrameSettings`.
    """

    source: str
    store: str
    camera: str
    mask: bytes
    response: str
    falloff: str
    reflectance: str
    channel: str
    albedo: float
    specular: Literal["auto", "mask", "dichromatic", "off"]
    highlight: tuple[float, float, float] | None
    clip_limit: float | None
    shrink: int
    smooth_px: float
    occlusions: Literal["auto", "off"]
    rim: Literal["straight", "closed"]
    rounds: int
    scale: Literal["locked", "frame"]


_AS_GIVEN = (
    "albedo",
    "specular",
    "highlight",
    "clip_limit",
    "shrink",
    "smooth_px",
    "occlusions",
    "rim",
    "rounds",
    "scale",
)


def packed(mask: np.ndarray) -> bytes:
    """A mask as `Job` carries it."""
    return np.packbits(mask).tobytes()


@functools.lru_cache(maxsize=4)
def settings_of(job: Job) -> "FrameSettings":
    """The job's settings, made once in a process."""
    import json

    from jaxsfs.camera import camera_from_dict
    from jaxsfs.frames import FrameSettings
    from jaxsfs.photo import parse_channel
    from jaxsfs.photometry import parse_falloff, parse_response
    from jaxsfs.reflectance import parse_reflectance

    camera = camera_from_dict(json.loads(job.camera)).camera
    bits = np.unpackbits(np.frombuffer(job.mask, np.uint8), count=camera.width * camera.height)
    return FrameSettings(
        camera=camera,
        mask=bits.astype(bool).reshape(camera.height, camera.width),
        response=parse_response(job.response),
        falloff=parse_falloff(job.falloff),
        reflectance=parse_reflectance(job.reflectance),
        weights=parse_channel(job.channel),
        **{name: getattr(job, name) for name in _AS_GIVEN},
    )


def read_frames(frames: "AbstractFrames", indices: list[int]) -> list[np.ndarray | None]:
    """The stored frames; None for one that cannot be decoded."""
    from jaxsfs.files import InputError

    found: list[np.ndarray | None] = []
    for index in indices:
        try:
            found.append(frames.read(index))
        except InputError:
            found.append(None)
    return found


def solve(stored: list[np.ndarray | None], job: Job) -> dict[str, np.ndarray]:
    """The arrays of a batch, as a store takes them."""
    from jaxsfs.frames import FIGURES, STATUSES, no_result, reconstruct_frame

    settings = settings_of(job)
    results: list[FrameResult] = [
        no_result(settings, "unreadable") if frame is None else reconstruct_frame(frame, settings) for frame in stored
    ]
    numbers = {name: number for number, name in enumerate(STATUSES)}
    arrays: dict[str, Any] = {
        "range": np.stack([result.range for result in results]),
        "valid": np.stack([result.valid for result in results]),
        "residual": np.minimum([result.residual for result in results], 6e4).astype(np.float16),
    }
    figures = {name: np.array([result.figures[name] for result in results]) for name in FIGURES}
    return arrays | figures | {"status": np.array([numbers[result.status] for result in results], np.int8)}


class Opened(threading.local):
    """A process's open source and store, kept from batch to batch: a video is read forwards."""

    job: Job | None = None
    frames: "AbstractFrames"
    store: "FrameStore"

    def of(self, job: Job) -> "tuple[AbstractFrames, FrameStore]":
        """Source and store of the job."""
        if self.job != job:
            from jaxsfs.files._frames import open_frames
            from jaxsfs.files._store import FrameStore

            self.frames, self.store = open_frames(job.source), FrameStore(Path(job.store))
            self.job = job
        return self.frames, self.store
