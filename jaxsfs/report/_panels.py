"""Maps and photographs as pictures inside a page, each with its colour bar or legend."""

import base64
from collections.abc import Sequence
from html import escape

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from jaxsfs.report._scale import Scale

_LARGEST = 960  # px: long side of a picture in the page
_JPEG_QUALITY = 88

Picture = UInt8[np.ndarray, "height width channels"]


def stride(height: int, width: int, largest: int = _LARGEST) -> int:
    """Every so many-th row and column keeps a picture within `largest` px."""
    return max(1, -(-max(height, width) // largest))


def map_panel(title: str, values: Float[np.ndarray, "height width"], scale: Scale, note: str = "") -> str:
    """`values` in the colours of `scale`, with its bar; transparent where they are not finite."""
    step = stride(*values.shape)
    small = values[::step, ::step]
    picture = np.dstack([scale.rgb(small), np.where(np.isfinite(small), np.uint8(255), np.uint8(0))])
    return panel(title, image(png(picture), title), scale.bar(), note)


def colour_panel(
    title: str, rgb: UInt8[np.ndarray, "height width 3"], shown: Bool[np.ndarray, "height width"], note: str = ""
) -> str:
    """A coloured picture, transparent where not `shown`."""
    step = stride(*shown.shape)
    alpha = np.where(shown, np.uint8(255), np.uint8(0))
    return panel(title, image(png(np.dstack([rgb, alpha])[::step, ::step]), title), "", note)


def photograph_panel(title: str, rgb: UInt8[np.ndarray, "height width 3"], note: str = "") -> str:
    """A photograph, as JPEG."""
    return panel(title, image(jpeg(shrunk(rgb)), title), "", note)


def legend(rows: Sequence[tuple[str, str]]) -> str:
    """Pairs of a CSS colour and what it means."""
    marks = "".join(f'<li><i style="background:{colour}"></i>{escape(text)}</li>' for colour, text in rows)
    return f'<ul class="legend">{marks}</ul>'


def panel(title: str, body: str, below: str = "", note: str = "") -> str:
    """One figure of the grid."""
    words = f"<p>{escape(note)}</p>" if note else ""
    return f"<figure><h3>{escape(title)}</h3>{body}{below}<figcaption>{words}</figcaption></figure>"


def grid(panels: Sequence[str]) -> str:
    """Figures beside each other as far as there is room."""
    return f'<div class="panels">{"".join(panels)}</div>'


def shrunk(rgb: UInt8[np.ndarray, "height width 3"], largest: int = _LARGEST) -> UInt8[np.ndarray, "_ _ 3"]:
    """The photograph with its long side at most `largest` px."""
    height, width = rgb.shape[:2]
    factor = min(1.0, largest / max(height, width))
    size = max(1, round(width * factor)), max(1, round(height * factor))
    return rgb if factor == 1 else cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)


def png(rgba: Picture) -> str:
    """A data address of a PNG of red, green, blue (and alpha)."""
    order = [2, 1, 0, 3][: rgba.shape[2]]
    return _address(".png", "image/png", rgba[..., order], [cv2.IMWRITE_PNG_COMPRESSION, 4])


def jpeg(rgb: Picture) -> str:
    """A data address of a JPEG."""
    return _address(".jpg", "image/jpeg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])


def image(address: str, words: str) -> str:
    return f'<img alt="{escape(words)}" src="{address}">'


def _address(ending: str, kind: str, picture: np.ndarray, settings: list[int]) -> str:
    done, data = cv2.imencode(ending, np.ascontiguousarray(picture), settings)
    if not done:
        raise ValueError(f"cannot encode an image of shape {picture.shape}")
    return f"data:{kind};base64,{base64.b64encode(data.tobytes()).decode()}"
