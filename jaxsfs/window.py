"""The part of a picture that is computed: what is valid of it, in one of few sizes."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Shaped

from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.forms import Scalar

_MARGIN = 4  # px round the valid pixels
_SIZES = 16  # a size and its double have so many between them: at most 1/16 too large on each side


class Window(NamedTuple):
    """Rows from `top` and columns from `left`, `height` × `width` px; it may go on beyond the picture's far sides."""

    top: int
    left: int
    height: int
    width: int

    def cut(self, image: Shaped[Array, "_ _"], fill: Scalar | bool) -> Shaped[Array, "_ _"]:
        """`image` in the window, `fill` beyond the picture."""
        xp = _module(image)
        part = xp.asarray(image)[self.top : self.top + self.height, self.left : self.left + self.width]
        beyond = ((0, self.height - part.shape[0]), (0, self.width - part.shape[1]))
        return jnp.asarray(xp.pad(part, beyond, constant_values=fill))

    def paste(self, part, shape: tuple[int, ...], fill: Scalar | bool) -> Any:
        """A picture of `shape` that is `part` in the window and `fill` elsewhere; the inverse of `cut`."""
        rows, columns = min(self.height, shape[0] - self.top), min(self.width, shape[1] - self.left)
        xp = _module(part)
        around = ((self.top, shape[0] - self.top - rows), (self.left, shape[1] - self.left - columns))
        return xp.pad(xp.asarray(part)[:rows, :columns], around, constant_values=fill)

    def camera(self, camera: AbstractCentralCamera) -> AbstractCentralCamera:
        """The camera of the window's pixels."""
        return camera.cropped(self.left, self.top, self.width, self.height)


def window_of(usable: Bool[np.ndarray, "height width"]) -> Window | None:
    """The window of the `usable` pixels, None where there is none or the whole picture is one.

    Its sizes are 16 to the octave, so that pictures of nearly equal size share their compiled programs. It also spares
    the dark frame round an endoscope's field.
    """
    rows, columns = np.flatnonzero(usable.any(1)), np.flatnonzero(usable.any(0))
    if not rows.size:
        return None
    top, left = max(int(rows[0]) - _MARGIN, 0), max(int(columns[0]) - _MARGIN, 0)
    height = bucketed(min(int(rows[-1]) + 1 + _MARGIN, len(usable)) - top)
    width = bucketed(min(int(columns[-1]) + 1 + _MARGIN, usable.shape[1]) - left)
    return None if (top, left, height, width) == (0, 0, *usable.shape) else Window(top, left, height, width)


def bucketed(size: int) -> int:
    """`size` rounded up to a multiple of a sixteenth of the power of two below it: 100 → 100, 101 → 104, 470 → 480."""
    step = max(1, (1 << (size.bit_length() - 1)) // _SIZES)
    return -(-size // step) * step


def _module(image):
    """jax.numpy where derivatives pass, else NumPy, which compiles nothing."""
    return jnp if isinstance(image, Tracer) else np
