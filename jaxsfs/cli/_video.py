"""`jaxsfs video`. What it does is in `_video_run`, which is imported when it runs."""

from typing import Annotated

from jaxsfs.cli._options import FLAT
from jaxsfs.cli._terminal import jax_session
from jaxsfs.cli._video_options import VideoOptions
from jaxsfs.video._worker import pin_threads


def video(options: Annotated[VideoOptions, FLAT]) -> int:
    """The surface of every frame of a video or a folder, as one Zarr store.

    For example:
      jaxsfs video colonoscopy.mp4 --camera camera.json --frames 100:400:2 --out result.zarr
      python -c "import xarray; print(xarray.open_zarr('result.zarr'))"

    The store has range, valid and residual per pixel (dimensions frame, v, u), a status and figures per frame, and
    camera and settings as attributes. What was interrupted goes on with the same command; a frame that cannot be used
    gets a status and stops nothing. Exit code 3: fewer than half of the frames can be trusted.
    """
    pin_threads()  # frames are what is done side by side
    with jax_session(32):
        from jaxsfs.cli._video_run import run

        return run(options)
