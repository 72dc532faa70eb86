"""The options of `jaxsfs video`, checked."""

import dataclasses
import os
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import value
from jaxsfs.cli._settings import check_albedo, check_clip_limit, smooth_px
from jaxsfs.cli._terminal import CannotRun


@dataclasses.dataclass(frozen=True)
class VideoOptions:
    # A video (MP4, AVI, MKV), a folder of pictures, or a DICOM file (needs the extra dicom).
    input: Annotated[Positional[Path], value("INPUT")]
    # Camera file (JSON) of exactly the frames' size.
    camera: Annotated[Path, value("FILE")]
    # Folder for the results, a Zarr store; a run that was interrupted goes on there.
    out: Annotated[Path, value("ZARR")]
    # Frames from FIRST to before END, every STEPth; each may be left out.
    frames: Annotated[str, value("FIRST:END:STEP", default="all")] = ":"
    # Image of the frames' size, non-zero where they are to be used. Without one, the dark border is found once for all.
    mask: Annotated[Path | None, value("FILE", default="found automatically")] = None
    # Address of a Dask scheduler whose workers compute; they must see the same files under the same names.
    scheduler: Annotated[str | None, value("tcp://HOST:PORT", default="none, this process computes")] = None
    # Processes on this machine, each with one thread, instead of threads in this process.
    processes: Annotated[int, value("N", default="0, threads instead")] = 0
    # Threads that solve.
    threads: Annotated[int | None, value("N", default="one per processor, 8 at most")] = None
    # locked: one gain for all frames, so ranges compare where the exposure is locked. frame: each frame's median range
    # is 1.
    scale: Literal["locked", "frame"] = "locked"
    # The camera's tone curve; auto: srgb for 8 bit, linear for 16 bit and float.
    response: Annotated[str | None, value("auto|srgb|linear|gamma:G", default="the camera file's, else auto")] = None
    # Light and vignetting over the angle a from the optical axis: cos^MU a, exp(-MU (1 - cos a)),
    # or cos^A a exp(-B (1 - cos a)).
    falloff: Annotated[str | None, value("none|cos:MU|exp:MU|cosexp:A,B", default="the camera file's, else none")] = (
        None
    )
    # lambertian, power:A, oren-nayar:SIGMA, phong:K,N or blinn-phong:K,N.
    reflectance: Annotated[str | None, value("FORM", default="the camera file's, else lambertian")] = None
    # Which light is used; R,G,B are weights.
    channel: Annotated[
        str | None, value("luminance|red|green|blue|R,G,B", default="the camera file's, else luminance")
    ] = None
    # Photometry of a kind of scope, where neither these options nor the camera file say otherwise.
    preset: Annotated[str | None, value("colonoscope", default="none")] = None
    # Gain times albedo, which sets the scale: E = RHO G(cos)/range^2. With 1, lengths are in scene units.
    albedo: Annotated[float | None, value("RHO", default="the camera file's gain_albedo, else 1")] = None
    # Highlights, as jaxsfs reconstruct deals with them.
    specular: Literal["auto", "mask", "dichromatic", "off"] = "auto"
    # Stored value, as a share of full scale, from which a pixel is clipped and so no data; auto: the last two steps of
    # an integer type, none of float; highest: the highest value of some frames; off: nothing is clipped.
    clip_limit: Annotated[str, value("auto|highest|off|VALUE")] = "auto"
    # Highlights and clipping are dealt with on a picture of 1/N of the size.
    shrink: Annotated[int | None, value("N", default="short side / 170 px")] = None
    # Gaussian smoothing in linear light; auto: 0 to 1.5 px by the frames' noise, the same for all.
    smooth: Annotated[str, value("auto|SIGMA_PX")] = "auto"
    # auto finds occluding contours in each frame, which takes two to three times as long; off takes the surface for
    # continuous.
    occlusions: Literal["auto", "off"] = "off"
    # Where the nearest wall is cut off by the rim of the picture: straight takes it for a straight wall, closed takes
    # it to face the light there.
    rim: Literal["straight", "closed"] = "straight"
    # Rounds of the sweeps at most; with 3 the range is within 0.03 % of the settled one in the mean.
    rounds: int = 3
    # Frames per batch, which is what is computed, written and lost as a whole.
    batch: Annotated[int | None, value("N", default="up to 16 by size")] = None
    # Start again where --out holds an earlier run.
    force: bool = False
    # Print a summary as JSON.
    json: bool = False

    def __post_init__(self):
        self.chosen(1)
        self.smooth_px()
        whole = {"--threads": self.threads, "--shrink": self.shrink, "--batch": self.batch, "--rounds": self.rounds}
        for name, number in whole.items():
            if number is not None and number < 1:
                raise CannotRun(f"{name} must be 1 or more, got {number}")
        if self.processes < 0:
            raise CannotRun(f"--processes must be 0 or more, got {self.processes}")
        if self.processes and self.scheduler:
            raise CannotRun("--processes and --scheduler both say who computes; give one of them")
        check_albedo(self.albedo)
        check_clip_limit(self.clip_limit)

    def chosen(self, count: int) -> range:
        """The frames of a source that has `count`."""
        parts = self.frames.split(":")
        try:
            bounds = [int(part) if part else None for part in parts]
        except ValueError:
            bounds = []
        if not 2 <= len(bounds) <= 3 or any(b is not None and b < 0 for b in bounds) or bounds[2:] == [0]:
            raise CannotRun(f"--frames must be FIRST:END or FIRST:END:STEP, such as 100:400:2, got {self.frames!r}")
        return range(count)[slice(*bounds)]

    def smooth_px(self) -> float | None:
        """The σ given in px, None for auto."""
        return smooth_px(self.smooth)

    def thread_count(self) -> int:
        """How many threads solve."""
        return self.threads or min(8, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2)
