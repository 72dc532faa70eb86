"""One frame of many: the same settings for all, a status instead of an error, and a scale that does not flicker."""

import dataclasses
import functools
import math
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Float32, Shaped

from jaxsfs.camera import AbstractCamera
from jaxsfs.field import find_field
from jaxsfs.forms import Scalar
from jaxsfs.noise import noise_level, smoothing_for
from jaxsfs.photo import Plateau, Weights, clipping_limit, plateau
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, LinearResponse
from jaxsfs.preparation import Preparation, prepare
from jaxsfs.reconstruction import Reconstruction, reconstruct_with_residual
from jaxsfs.reflectance import AbstractReflectance
from jaxsfs.specular import ESTIMATED, Method
from jaxsfs.status import Statistics, Status, status_of

Stored = Shaped[np.ndarray, "height width *channels"]

_SETTLED = 1e-3  # mean relative change of the last round; the surface is then within 3e-4 of the settled one
_SMALL = 170  # px, short side of the picture on which highlights are looked for

_ERRORS = {
    "unusable": "The frame holds no shading: it is black, white, or of another size than the camera.",
    "unreadable": "The frame cannot be decoded.",
}
# What a frame's number in a store means: its place here. −1 is a frame that was not computed yet.
STATUSES = {**{status.name.lower().replace("_", "-"): status.value for status in Status}, **_ERRORS}


@dataclasses.dataclass(frozen=True)
class FrameSettings:
    """What all frames have in common; as the arguments of `prepare` and `reconstruct`.

    `clip_limit`: the stored value (full scale 1) from which a pixel is clipped, "auto" for that of each frame's type.
    `highlight`: the highlights' colour in linear light, None to estimate it in each frame. `rounds`: at most so many
    rounds of the sweeps. `scale`: "locked": one gain·albedo for all frames, so that ranges
    of different frames compare where the exposure did not change; "frame": each frame's median range is 1.
    """

    camera: AbstractCamera
    mask: Bool[np.ndarray, "height width"]
    response: AbstractResponse
    falloff: AbstractFalloff
    reflectance: AbstractReflectance
    weights: Weights
    albedo: Scalar = 1.0
    specular: Method = "auto"
    highlight: tuple[float, float, float] | None = None
    clip_limit: Scalar | Literal["auto"] | None = "auto"
    shrink: int = 1
    smooth_px: Scalar = 0.0
    occlusions: Literal["auto", "off"] = "auto"
    rim: Literal["straight", "closed"] = "straight"
    rounds: int = 3
    scale: Literal["locked", "frame"] = "locked"


class FrameResult(NamedTuple):
    """`range` (NaN where not `valid`) and `residual` |E_rerendered − E|/mean(E) (NaN where there is none) per pixel;
    `status`: a key of STATUSES; `figures` of the frame, see FIGURES."""

    range: Float32[np.ndarray, "height width"]
    valid: Bool[np.ndarray, "height width"]
    residual: Float32[np.ndarray, "height width"]
    status: str
    figures: dict[str, float]


# name → what it is, for a store's attributes
FIGURES = {
    "valid_pixels": "pixels with a surface",
    "unreached_pixels": "usable pixels that no front reached",
    "contour_pixels": "pixels of occluding contours",
    "highlight_pixels": "pixels with a highlight, before they were dealt with",
    "clipped_pixels": "pixels with a clipped channel that counts",
    "rounds": "rounds of the sweeps",
    "change": "mean relative change in the last round",
    "residual_mean": "mean of the residual",
    "residual_p95": "95th percentile of the residual",
    "factor": "what the range was multiplied by to set its scale",
}


def reconstruct_frame(stored: Stored, settings: FrameSettings) -> FrameResult:
    """The surface that one frame shows, in single precision. `stored`: as the file has it; integers of full range.

    Raises nothing for a frame that cannot be used: its status says so and no pixel is valid.
    """
    with jax.enable_x64(False):
        try:
            return _solved(stored, settings)
        except ValueError:  # no usable pixel, or another size
            return no_result(settings, "unusable")


def no_result(settings: FrameSettings, status: str) -> FrameResult:
    """What is stored for a frame without a surface."""
    nothing = np.full(settings.mask.shape, np.nan, np.float32)
    return FrameResult(nothing, np.zeros(settings.mask.shape, bool), nothing, status, dict.fromkeys(FIGURES, np.nan))


def common_mask(frames: list[Stored], response: str) -> tuple[Bool[np.ndarray, "height width"], str]:
    """The lit field of all frames, from the brightest that each pixel gets; and how it was found, in words.

    One mask for all: a border that is found anew in each frame flickers.
    """
    brightest = np.max([as_float(frame) for frame in frames], axis=0)
    if response == "linear":
        white = max(float(np.percentile(brightest, 99.9)), 1e-9)
        brightest = (np.clip(brightest / white, 0, 1) ** (1 / 2.2)).astype(np.float32)
    field = find_field(brightest)
    return field.mask, f"{field.description}, from {len(frames)} frames"


def common_smoothing(frames: list[Stored], mask: Bool[np.ndarray, "height width"]) -> tuple[float, float]:
    """σ in px that suits the frames' median noise, and that noise (full scale 1)."""
    levels = [noise_level(values / max(1.0, float(values.max())), mask) for values in map(as_float, frames)]
    noise = float(np.median(levels))
    return smoothing_for(noise), noise


def highest_value(frames: list[Stored], mask: Bool[np.ndarray, "height width"]) -> float:
    """The frames' highest value (full scale 1) in `mask`; 0 if there is none."""
    return float(max(values[usable].max(initial=0) for values, usable in (_seen(frame, mask) for frame in frames)))


def common_plateau(
    frames: list[Stored], mask: Bool[np.ndarray, "height width"], limit: Scalar | None
) -> Plateau | None:
    """What `plateau` finds in `mask`, over all frames."""
    seen = [_seen(frame, mask) for frame in frames]
    values, usable = (np.concatenate(part) for part in zip(*seen, strict=True))
    return plateau(values, usable, limit)


def _seen(frame: Stored, mask: Bool[np.ndarray, "height width"]):
    """A frame's values with full scale 1, and the pixels of `mask` that have any."""
    values = as_float(frame)
    finite = np.isfinite(values)
    return values, mask & (finite if values.ndim == 2 else finite.all(axis=-1))


def common_highlight(frames: list[Stored], settings: FrameSettings) -> tuple[float, float, float] | None:
    """The highlights' colour in linear light: the median of what the frames show, white where none shows it.

    One for all, as there is one light and one camera: found anew in each frame it flickers and takes half of the time
    that highlights take. None for grey frames, and where highlights are left in.
    """
    if settings.specular == "off" or frames[0].ndim == 2:
        return None
    shown = []
    for frame in frames:
        try:
            with jax.enable_x64(False):
                report = _prepared(frame, dataclasses.replace(settings, highlight=None))[0].specular
        except ValueError:  # an unusable frame
            continue
        if report.interface_colour is not None and report.interface_origin == ESTIMATED:
            shown.append(report.interface_colour)
    red, green, blue = np.median(shown, axis=0).tolist() if shown else (1.0, 1.0, 1.0)
    return red, green, blue


def shrink_for(camera: AbstractCamera) -> int:
    """How many times smaller the picture is made on which highlights are looked for: a short side of about 170 px.

    At 512 x 512 px (3 times) the mean error over seven wet scenes is that of the full size, in a sixth of the time.
    """
    return max(1, round(min(camera.width, camera.height) / _SMALL))


def as_float(stored: Stored) -> Float[np.ndarray, "height width *channels"]:
    """Stored values with full scale 1; float values as they are."""
    if stored.dtype.kind in "iu":
        return stored.astype(np.float32) * np.float32(1 / np.iinfo(stored.dtype).max)
    return stored.astype(np.float32)


def _solved(stored: Stored, settings: FrameSettings) -> FrameResult:
    prepared, clipped = _prepared(stored, settings)
    found, residual = reconstruct_with_residual(
        prepared.irradiance,
        settings.camera,
        albedo=settings.albedo,
        reflectance=settings.reflectance,
        occlusions=settings.occlusions,
        rim=settings.rim,
        steps=settings.rounds,
    )
    pixels = {"highlight_pixels": float(prepared.highlights.sum()), "clipped_pixels": float(clipped)}
    return _result(found, residual, settings, pixels)


def _prepared(stored: Stored, settings: FrameSettings) -> tuple[Preparation, int]:
    """What the solver reads, and the number of usable pixels with a clipped channel that counts."""
    limit = clipping_limit(str(stored.dtype)) if isinstance(settings.clip_limit, str) else settings.clip_limit
    linear, limit = _linear(stored, settings.response, limit)
    usable = np.isfinite(linear) & (linear >= 0)
    usable = settings.mask & (usable if usable.ndim == 2 else usable.all(axis=-1))
    clipped = np.zeros(linear.shape, bool) if limit is None else linear >= limit
    if clipped.ndim == 3:
        clipped = (clipped & (np.asarray(settings.weights) > 0)).any(axis=-1)
    prepared = prepare(
        np.where(usable if linear.ndim == 2 else usable[..., None], linear, 0),
        settings.camera,
        valid=usable,
        specular=settings.specular,
        interface=None if settings.highlight is None or linear.ndim == 2 else np.array(settings.highlight),
        response=LinearResponse(),
        falloff=settings.falloff,
        weights=settings.weights,
        smooth_px=settings.smooth_px,
        clip_limit=limit,
        shrink=settings.shrink,
    )
    return prepared, int((clipped & usable).sum())


def _linear(
    stored: Stored, response: AbstractResponse, limit: Scalar | None
) -> tuple[Float32[np.ndarray, "height width *channels"], float | None]:
    """Linear light of a frame, and the clipping `limit` in it; integers by a table, in a tenth of the time."""
    if stored.dtype.kind not in "iu" or stored.dtype.itemsize > 2:
        decoded = (np.asarray(response.decode(jnp.asarray(x, jnp.float32))) for x in (as_float(stored), limit or 0))
        linear, least = decoded
        return linear, None if limit is None else float(least)
    table = _table(response, stored.dtype)
    # a stored value as single precision is off by some thousandths of a step
    step = len(table) if limit is None else math.ceil(float(limit) * (len(table) - 1) - 0.05)
    return table[stored], float(table[step]) if step < len(table) else None


@functools.lru_cache(maxsize=4)
def _table(response: AbstractResponse, dtype: np.dtype) -> Float32[np.ndarray, " values"]:
    values = np.arange(np.iinfo(dtype).max + 1, dtype=np.float32) / np.float32(np.iinfo(dtype).max)
    return np.asarray(response.decode(jnp.asarray(values)))


def _result(
    found: Reconstruction,
    residual: Float[np.ndarray, "height width"],
    settings: FrameSettings,
    pixels: dict[str, float],
) -> FrameResult:
    valid = np.asarray(found.surface.valid)
    distance = np.where(valid, np.asarray(found.surface.range), np.nan).astype(np.float32)
    factor = 1.0
    if settings.scale == "frame" and valid.any():
        factor = 1 / float(np.median(distance[valid]))
        distance = distance * np.float32(factor)
    figures = {**pixels, **found.statistics.as_dict(), "factor": factor}
    numbers = {name: float(figures.get(name, np.nan)) for name in FIGURES}
    status = _status(found.statistics).name.lower().replace("_", "-")
    return FrameResult(distance, valid, residual.astype(np.float32), status, numbers)


def _status(statistics: Statistics) -> Status:
    """As `reconstruct` judges, but what the few rounds of a video leave open is below what one sees."""
    settled = statistics.change <= _SETTLED
    return status_of(dataclasses.replace(statistics, change=0.0) if settled else statistics)
