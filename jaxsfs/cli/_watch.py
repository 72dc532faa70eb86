"""`jaxsfs watch`. What it does is in `_watch_run`, which is imported when it runs."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._settings import check_clip_limit
from jaxsfs.cli._terminal import CannotRun, jax_session
from jaxsfs.video._worker import pin_threads


@dataclasses.dataclass(frozen=True)
class WatchOptions:
    # The number of a camera (0 is the first), a video file, or a folder of pictures.
    source: Annotated[Positional[str], value("SOURCE")]
    # Camera file (JSON) of exactly the frames' size.
    camera: Annotated[Path, value("FILE")]
    # Port of the page, on this machine only; 0 takes a free one.
    port: int = 8642
    # Write overlays as numbered PNG files to this folder instead of serving a page.
    out: Annotated[Path | None, value("FOLDER", default="none, a page is served")] = None
    # Share of the depth colours over the picture, 0 to 1.
    strength: float = 0.6
    # The size is divided by N before solving: 2 takes a quarter of the time.
    reduce: int = 2
    # Highlights, as jaxsfs reconstruct deals with them.
    specular: Literal["auto", "mask", "off"] = "off"
    # Stored value, as a share of full scale, from which a pixel is clipped and so no data; auto: the last two steps of
    # an integer type, none of float; highest: the highest value of the first frame; off: nothing is clipped.
    clip_limit: Annotated[str, value("auto|highest|off|VALUE")] = "auto"
    # End after so many overlays.
    count: Annotated[int | None, value("N", default="without end; a file or folder ends by itself")] = None
    # Replace pictures of an earlier run in --out.
    force: bool = False

    def __post_init__(self):
        if not 0 <= self.strength <= 1:
            raise CannotRun(f"--strength must lie between 0 and 1, got {self.strength:g}")
        if not 0 <= self.port < 65536:
            raise CannotRun(f"--port must lie between 0 and 65535, got {self.port}")
        if self.reduce < 1:
            raise CannotRun(f"--reduce must be 1 or more, got {self.reduce}")
        check_clip_limit(self.clip_limit)


def watch(options: Annotated[WatchOptions, FLAT]) -> int:
    """Depth over the live picture: yellow near to violet far, on a page of this machine or in a folder.

    For example:
      jaxsfs watch 0 --camera camera.json
      jaxsfs watch colonoscopy.mp4 --camera camera.json --out overlays

    A frame that comes while another is being solved is dropped, so the picture does not lag; a video file plays at its
    own speed. The colours are those of each frame's own range. Ctrl-C ends it.
    """
    pin_threads()  # reading, solving and showing are what is done side by side
    with jax_session(32):
        from jaxsfs.cli._watch_run import run

        return run(options)
