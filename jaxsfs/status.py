"""What became of a reconstruction: figures, and a verdict in words."""

import enum

import equinox as eqx


class Status(enum.Enum):
    """What became of a reconstruction. The value is the message: what happened and what to do."""

    GOOD = "The surface is reconstructed and explains the image."
    NOT_SETTLED = (
        "The sweeps did not settle, as happens on noisy images: smooth the image (--smooth 1 or more) or use order 1."
    )
    UNREACHED = (
        "The front did not reach all valid pixels: they are left out. Give the initial curve a place in every part of "
        "the mask, or let the level set take more steps."
    )
    UNEXPLAINED = (
        "The surface does not explain the image (see the residual): check the camera, the response and the mask, and "
        "look for highlights, noise and occlusions."
    )
    FEW_PIXELS = "Too few valid pixels for a surface: check the mask and the exposure."

    @property
    def trustworthy(self) -> bool:
        """Whether the surface may be used without a second look."""
        return self is Status.GOOD


class Statistics(eqx.Module):
    """Figures of a reconstruction.

    `contour_pixels`: those of occluding contours, across which nothing was read.
    `residual_mean`, `residual_p95`: |E_rerendered − E|/mean(E) over the valid pixels that have a normal. It tests the
    solution of the equation, not the photometry: one image fits any response and fall-off.
    """

    valid_pixels: int
    unreached_pixels: int
    contour_pixels: int
    work: int
    work_unit: str = eqx.field(static=True)
    change: float
    residual_mean: float
    residual_p95: float

    def as_dict(self) -> dict[str, float | int | str]:
        """Plain numbers, by name."""
        names = ("valid_pixels", "unreached_pixels", "contour_pixels", "change", "residual_mean", "residual_p95")
        return {name: getattr(self, name) for name in names} | {self.work_unit: self.work}


def status_of(statistics: Statistics) -> Status:
    """The verdict that the figures call for."""
    if statistics.valid_pixels < 16:
        return Status.FEW_PIXELS
    if statistics.change > 1e-5:
        return Status.NOT_SETTLED
    if statistics.unreached_pixels > 0.001 * statistics.valid_pixels:
        return Status.UNREACHED
    if not statistics.residual_mean < 0.2:
        return Status.UNEXPLAINED
    return Status.GOOD
