"""Moving pictures: GIF and MP4."""

import io
import secrets
import tempfile
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image

from jaxsfs.files._atomic import InputError, write_bytes

_HOLD = 1.5  # seconds that the last picture stays


def write_animation(
    path: str | Path, frames: Iterable[UInt8[np.ndarray, "_ _ 3"]], *, per_second: int = 12, force: bool = False
) -> None:
    """`frames` (red, green, blue, all of one even size) as .gif, which repeats for ever, or as .mp4 (MPEG-4 Part 2).

    The last picture stays for 1.5 s. Raises InputError for another ending and ValueError without frames.
    """
    path = Path(path)
    pictures = list(frames)
    if not pictures:
        raise ValueError("an animation needs at least one frame")
    kind = path.suffix.lower()
    if kind == ".gif":
        data = _gif(pictures, per_second)
    elif kind == ".mp4":
        data = _mp4(pictures, per_second)
    else:
        raise InputError(f"an animation is written as .gif or .mp4, got {path.name!r}")
    write_bytes(path, data, force=force)


def _gif(pictures: list[np.ndarray], per_second: int) -> bytes:
    # one palette for all, from dark and bright frames: palettes of their own would flicker
    typical = np.concatenate([pictures[len(pictures) // 3], pictures[2 * len(pictures) // 3], pictures[-1]])
    palette = Image.fromarray(typical).quantize(256, dither=Image.Dither.NONE)
    stored = [Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for p in pictures]
    step = round(1000 / per_second)
    times = [step] * (len(stored) - 1) + [round(1000 * _HOLD)]
    buffer = io.BytesIO()
    stored[0].save(buffer, "GIF", save_all=True, append_images=stored[1:], duration=times, loop=0, optimize=False)
    return buffer.getvalue()


def _mp4(pictures: list[np.ndarray], per_second: int) -> bytes:
    height, width = pictures[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:  # OpenCV writes to files only
        name = Path(folder) / f"{secrets.token_hex(4)}.mp4"
        writer = cv2.VideoWriter(str(name), cv2.VideoWriter.fourcc(*"mp4v"), per_second, (width, height))
        if not writer.isOpened():
            raise InputError("this OpenCV cannot write MP4 here; write .gif instead")
        for picture in [*pictures, *([pictures[-1]] * round(_HOLD * per_second))]:
            writer.write(np.ascontiguousarray(picture[..., ::-1]))
        writer.release()
        return name.read_bytes()
