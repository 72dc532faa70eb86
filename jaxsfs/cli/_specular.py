"""`jaxsfs specular`: a photograph without its highlights."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import CannotRun, jax_session, say, warn

_COMPLIANT = 0.8  # share of planar regions; exact dichromatic pictures reach 0.98 or more, real frames 0.2 to 0.65


@dataclasses.dataclass(frozen=True)
class SpecularOptions:
    # The photograph.
    image: Annotated[Positional[Path], value("IMAGE")]
    # Folder for body.png, interface.png, mask.png, side-by-side.png and result.json.
    out: Annotated[Path, value("DIR")]
    # auto: luminance where there is no highlight, the dichromatic invariant inside, saturated cores filled. mask: fill
    # every highlight. dichromatic: the paper's method at every pixel.
    method: Literal["auto", "mask", "dichromatic"] = "auto"
    # Colour of the highlights in linear light: R,G,B or white.
    interface: Annotated[str | None, value("R,G,B", default="estimated, else white")] = None
    # Tone curve: srgb, linear or gamma:G.
    response: Annotated[str | None, value("CURVE", default="srgb for 8 bit, linear otherwise")] = None
    # Pixels to look at: non-zero in this image.
    mask: Annotated[Path | None, value("FILE", default="the lit field, found by its dark border")] = None
    # A pixel is saturated where any channel's stored value reaches this share of full scale.
    saturation: float = 254 / 255
    # Replace files in the folder.
    force: bool = False
    # Print result.json instead of a summary.
    json: bool = False

    def __post_init__(self):
        if not 0 < self.saturation < float("inf"):
            raise CannotRun(f"--saturation must be a share of full scale above 0, got {self.saturation:g}")


def specular(options: Annotated[SpecularOptions, FLAT]) -> int:
    """Takes the specular reflection off a photograph (eqs. 7 to 10): body image, interface image, mask.

    For example:
      jaxsfs render wavy-wall --shine 0.3 --out view
      jaxsfs specular view/image.png --out matte
    """
    with jax_session(32):
        return _separated(options)


def _separated(options: SpecularOptions) -> int:
    import jax.numpy as jnp
    import numpy as np

    from jaxsfs import files
    from jaxsfs.cli._clipping import plateau_warning
    from jaxsfs.cli._initial import check_mask_size
    from jaxsfs.field import find_field
    from jaxsfs.photo import automatic_response, plateau
    from jaxsfs.photometry import parse_response
    from jaxsfs.specular import dichromatic_compliance, remove_highlights, saturated

    photo = files.read_image(options.image)
    curve = options.response or automatic_response(photo.dtype)
    response = parse_response(curve)
    stored = photo.values.astype(np.float32)
    if options.mask is None:
        mask = find_field(stored).mask
    else:
        mask = files.read_mask(options.mask)
        check_mask_size(options.mask, mask.shape, stored.shape[1::-1])
    usable = photo.valid & mask
    linear = np.asarray(response.decode(jnp.asarray(stored)))
    clipped = saturated(stored, options.saturation) & usable
    flat = plateau(stored, usable, options.saturation)
    if flat is not None:
        # rounded down, so that the value itself is reached
        warn(plateau_warning(flat._asdict(), f"--saturation {flat.value - 5e-5:.4f}"))
    found = remove_highlights(
        linear,
        usable,
        saturated=clipped,
        method=options.method,
        interface=_colour(options.interface),
    )

    def picture(light):
        encoded = np.asarray(response.encode(jnp.asarray(np.clip(light, 0, 1), jnp.float32)))
        rgb = encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=-1)
        return np.rint(255 * np.clip(rgb, 0, 1)).astype(np.uint8)

    before, body, interface = picture(linear), picture(found.values), picture(linear - found.values)
    changed = np.repeat(np.where(found.highlights, 255, 0).astype(np.uint8)[..., None], 3, axis=-1)
    record = {"image": str(options.image), "response": curve, **found.report.as_dict()}
    if linear.ndim == 3:
        compliance = dichromatic_compliance(linear, usable & ~clipped)
        record |= {"planar_regions": None if np.isnan(compliance.share) else compliance.share}
    with files.output_folder(options.out, force=options.force) as folder:
        files.write_png(folder / "body.png", body)
        files.write_png(folder / "interface.png", interface)
        files.write_png(folder / "mask.png", changed)
        files.write_png(folder / "side-by-side.png", np.hstack([before, body, interface, changed]))
        files.write_json(folder / "result.json", record)
    if options.json:
        print((options.out / "result.json").read_text(encoding="utf-8"), end="")
    else:
        say(_summary(options.out, record, int(usable.sum())))
    return 0


def _colour(text: str | None):
    import numpy as np

    if text is None:
        return None
    if text.strip().lower() == "white":
        return np.ones(3)
    usage = "write white or three positive numbers such as 1,0.9,0.8"
    try:
        colour = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise ValueError(f"--interface {text!r} is no colour; {usage}") from None
    if colour.shape != (3,) or not (np.isfinite(colour).all() and (colour > 0).all()):
        raise ValueError(f"--interface {text!r} is no colour of a light; {usage}")
    return 3 * colour / colour.sum()


def _summary(out: Path, record: dict, usable: int) -> str:
    share = record["highlights"] / max(int(usable), 1)
    lines = [f"{out}: {record['method']}, {record['highlights']} pixels changed ({share:.1%} of the field)"]
    if record["filled"]:
        lines.append(f"filled from around: {record['filled']} pixels, saturated: {record['saturated']}")
    if record["interface_colour"]:
        colour = ", ".join(f"{part:.2f}" for part in record["interface_colour"])
        lines.append(f"interface colour: {colour} ({record['interface_origin']})")
    if record["message"]:
        lines.append(record["message"])
    planar = record.get("planar_regions")
    if planar is not None and planar < _COMPLIANT:
        lines.append(
            f"warning: the colours of only {planar:.0%} of the regions are planar, so the dichromatic model (eq. 7) "
            "does not hold everywhere; auto, which goes by the colours around each highlight, depends on it least"
        )
    return "\n".join(lines)
