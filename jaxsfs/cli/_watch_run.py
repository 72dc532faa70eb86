"""What `jaxsfs watch` does: the newest frame, its surface, an overlay shown or written; and again."""

import contextlib
import dataclasses
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from jaxsfs import files
from jaxsfs.camera import CameraFile
from jaxsfs.cli._clipping import clipping
from jaxsfs.cli._photometric import photometric
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._terminal import CannotRun, progress, say
from jaxsfs.cli._watch import WatchOptions
from jaxsfs.files._photo import photo_of
from jaxsfs.frames import FrameSettings, common_highlight, common_mask, common_smoothing, reconstruct_frame, shrink_for
from jaxsfs.photo import size_message
from jaxsfs.watch import Newest, Page, overlay


def run(options: WatchOptions) -> int:
    """Shows or writes overlays until the source ends or Ctrl-C; returns 0."""
    file = files.read_camera(options.camera)
    newest = Newest(options.source)
    shown, start = 0, time.perf_counter()
    try:
        with _target(options) as show:
            settings = None
            while options.count is None or shown < options.count:
                frame = newest.next()
                if frame is None:
                    break
                settings = settings or _settings(options, file, frame)
                show(overlay(frame, reconstruct_frame(_reduced(frame, options.reduce), settings), options.strength))
                shown += 1
                _rate(shown, newest.dropped, time.perf_counter() - start)
    except KeyboardInterrupt:  # how one ends it
        pass
    finally:
        newest.close()
    seconds = time.perf_counter() - start
    say(f"{shown} overlays in {seconds:.1f} s, {shown / seconds:.2f} a second; {newest.dropped} frames dropped")
    return 0


def _rate(shown: int, dropped: int, seconds: float) -> None:
    if sys.stderr.isatty() and shown % 10 == 0:
        progress(f"{shown / seconds:.1f} overlays a second, {dropped} frames dropped")


@contextlib.contextmanager
def _target(options: WatchOptions) -> Iterator[Callable[[np.ndarray], None]]:
    """Where an overlay goes."""
    if options.out is None:
        try:
            page = Page(options.port)
        except OSError as error:
            raise CannotRun(f"--port {options.port}: {error.strerror or error}; choose another, or 0") from None
        print(f"jaxsfs: look at {page.url} (Ctrl-C ends it)", file=sys.stderr, flush=True)
        try:
            yield page.show
        finally:
            page.close()
        return
    yield _numbered(options.out, options.force)


def _numbered(folder: Path, force: bool) -> Callable[[np.ndarray], None]:
    if folder.exists() and not folder.is_dir():
        raise files.InputError(f"expected a folder for the overlays, but {folder} is a file")
    if folder.is_dir() and any(folder.iterdir()) and not force:
        raise files.InputError(f"{folder} exists already and is not empty; choose another or overwrite it (--force)")
    folder.mkdir(parents=True, exist_ok=True)
    written = iter(range(10**6))

    def write(picture: np.ndarray) -> None:
        files.write_png(folder / f"{next(written):06d}.png", picture, force=force)

    return write


def _settings(options: WatchOptions, file: CameraFile, frame: np.ndarray) -> FrameSettings:
    """Mask and smoothing come from the first frame: what is found anew in each one flickers."""
    height, width = frame.shape[:2]
    if (file.camera.width, file.camera.height) != (width, height):
        raise files.InputError(size_message(options.source, (width, height), file.camera))
    still = ReconstructOptions(image=Path(options.source), camera=options.camera, out=Path("out"))
    chosen = photometric(still, file, photo_of(frame, options.source))
    small = _reduced(frame, options.reduce)
    mask, _ = common_mask([small], chosen.response.value)
    field = cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    camera = file.camera.resized(small.shape[1], small.shape[0])
    settings = FrameSettings(
        camera=camera,
        mask=mask,
        **{name: chosen.parsed(name) for name in ("response", "falloff", "reflectance")},
        weights=chosen.parsed("channel"),
        albedo=chosen.albedo.value,
        specular=options.specular,
        clip_limit=clipping(options.clip_limit, [frame], field)[0].value,
        shrink=shrink_for(camera),
        smooth_px=common_smoothing([small], mask)[0],
        occlusions="off",
    )
    return dataclasses.replace(settings, highlight=common_highlight([small], settings))


def _reduced(frame: np.ndarray, times: int) -> np.ndarray:
    if times == 1:
        return frame
    size = (max(1, frame.shape[1] // times), max(1, frame.shape[0] // times))
    return cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
