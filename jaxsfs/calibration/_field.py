"""What of a photograph can be used: the lit field, its saturated spots, and a grey picture for the detectors."""

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Shaped

from jaxsfs.photometry import AbstractResponse, LinearResponse, SRGBResponse

_STEPS = np.linspace(0, 1, 4096)  # of stored values at which a response is tabulated


class Photograph(eqx.Module):
    """A grey picture in [0, 1]: `grey` as stored, `linear` as light by the assumed response.

    `field`: where there is light; `usable`: in the field, away from its rim and from saturated spots.
    """

    grey: Float[np.ndarray, "height width"]
    linear: Float[np.ndarray, "height width"]
    field: Bool[np.ndarray, "height width"]
    usable: Bool[np.ndarray, "height width"]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.grey.shape[1], self.grey.shape[0]

    def field_centre(self) -> tuple[float, float]:
        """Middle of the field's bounding box, or of the image if the field fills it, in px."""
        rows, columns = np.nonzero(self.field.any(axis=1))[0], np.nonzero(self.field.any(axis=0))[0]
        return float(columns[0] + columns[-1]) / 2, float(rows[0] + rows[-1]) / 2


def photograph_from(
    image: Shaped[np.ndarray, "height width *channels"], response: AbstractResponse | None = None
) -> Photograph:
    """Grey values, field and usable part of a stored image (8 bit, 16 bit or float; grey or three channels).

    `response`: by default sRGB for 8 bit and linear otherwise; blurred edges keep their place in linear light only.
    """
    if response is None:
        response = SRGBResponse() if image.dtype == np.uint8 else LinearResponse()
    scale = float(np.iinfo(image.dtype).max) if np.issubdtype(image.dtype, np.integer) else 1.0
    values = image.astype(np.float64) / scale
    grey = values.mean(axis=2) if values.ndim == 3 else values
    brightest = values.max(axis=2) if values.ndim == 3 else values
    if not np.isfinite(grey).all():
        raise ValueError("the photograph holds values that are not finite; write it again as 8- or 16-bit image")
    if float(np.percentile(grey, 99)) < 0.03:
        raise ValueError(
            f"the photograph is black (99 % of its values are below {np.percentile(grey, 99):.3f} of full scale): "
            "is the light on, the right file given?"
        )
    field = _lit_field(grey)
    saturated = cv2.morphologyEx((brightest >= 0.995).astype(np.uint8), cv2.MORPH_OPEN, _diamond(1))
    # the picture's own border is no rim of the field: cv2 takes what lies beyond for lit
    inner = cv2.erode(field.astype(np.uint8), _diamond(4))
    usable = (inner > 0) & (cv2.dilate(saturated, _diamond(5)) == 0)
    return Photograph(grey, _decoded(image, grey, response), field, usable)


def _decoded(image: Shaped[np.ndarray, "..."], grey: Float[np.ndarray, "height width"], response: AbstractResponse):
    """Linear light of the grey values, from a table."""
    if image.ndim == 2 and image.dtype == np.uint8:
        return response.decode(np.arange(256) / 255.0)[image]
    return np.interp(grey, _STEPS, response.decode(_STEPS))


def target_photograph(
    image: Shaped[np.ndarray, "height width *channels"], response: AbstractResponse | None = None
) -> Photograph:
    """`photograph_from` for pictures in which something is drawn. Raises ValueError for one without a contrast too."""
    photo = photograph_from(image, response)
    if not photo.field.any():
        raise ValueError(
            f"the photograph is {np.median(photo.grey):.0%} of full scale everywhere: nothing is to be seen in it. Is "
            "it overexposed, the right file given?"
        )
    return photo


def _diamond(reach: int) -> np.ndarray:
    """Pixels at most `reach` steps away."""
    along = np.abs(np.arange(-reach, reach + 1))
    return (along[:, None] + along[None] <= reach).astype(np.uint8)


def _lit_field(grey: Float[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """The largest region brighter than a small share of the picture's bright values, its holes filled."""
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 2.0)
    dark = float(np.percentile(smooth, 0.5))
    lit = smooth > dark + 0.07 * (float(np.percentile(smooth, 97)) - dark)
    close = max(3, grey.shape[1] // 60) | 1
    lit = cv2.morphologyEx(lit.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((close, close), np.uint8)) > 0
    count, regions, stats, _ = cv2.connectedComponentsWithStats(lit.astype(np.uint8), connectivity=4)
    if count > 2:
        lit = regions == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return _filled(lit)


def _filled(lit: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """With the dark regions that do not reach the picture's border."""
    dark = np.pad(np.logical_not(lit).astype(np.uint8), 1, constant_values=1)
    cv2.floodFill(dark, None, (0, 0), 2)
    return dark[1:-1, 1:-1] != 2
