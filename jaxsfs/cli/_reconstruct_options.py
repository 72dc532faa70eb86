"""The options of `jaxsfs reconstruct`, checked."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import value
from jaxsfs.cli._settings import check_albedo, check_clip_limit, numbers, smooth_px
from jaxsfs.cli._terminal import CannotRun
from jaxsfs.files._formats import Format


@dataclasses.dataclass(frozen=True)
class ReconstructOptions:
    # The photograph: PNG, JPEG, BMP, TIFF, WebP or NPY; 8 bit, 16 bit or float; grey, colour, or with alpha.
    image: Annotated[Positional[Path], value("IMAGE")]
    # Camera file (JSON) of exactly this image size.
    camera: Annotated[Path, value("FILE")]
    # Folder for the results.
    out: Annotated[Path, value("FOLDER")]
    # Image of the photograph's size, non-zero where it is to be used. Without one, the dark border of an endoscope
    # picture is found.
    mask: Annotated[Path | None, value("FILE", default="found automatically")] = None
    # sweeping: fast; level-set: the paper's propagating front.
    solver: Literal["sweeping", "level-set"] = "sweeping"
    # Order of accuracy. 3 (sweeping only) is for pictures without noise: on smooth surfaces its errors are tens of
    # times less.
    order: Literal[1, 2, 3] = 2
    # Occluding contours, across which range jumps: auto finds them in the brightness; off takes the surface for
    # continuous; or an image of the photograph's size, non-zero on the contours.
    occlusions: Annotated[str, value("auto|off|FILE")] = "auto"
    # Where the nearest wall is cut off by the rim of the picture: straight takes it for a straight wall, closed takes
    # it to face the light there.
    rim: Literal["straight", "closed"] = "straight"
    # What is known to begin with: deadline (nothing but the brightness), singular-point[:U,V[,RANGE]] (a
    # pixel that faces the light), threshold:E (where the irradiance is at least E), or
    # curve:MASK.png,RANGE (the range is known where MASK is not zero).
    initial: Annotated[str | None, value("FORM", default="deadline; for a distant light singular-point")] = None
    # camera: a light at the lens, E = albedo G(cos)/range^2. distant: a far light behind an orthographic camera.
    light: Literal["camera", "distant"] = "camera"
    # Distant light: z at singular points, a CSV file with the header u,v,z.
    heights: Annotated[Path | None, value("FILE", default="none")] = None
    # Distant light: singular points are the farthest points around, not the nearest.
    concave: bool = False
    # The camera's tone curve; auto: srgb for 8 bit, linear for 16 bit and float.
    response: Annotated[str | None, value("auto|srgb|linear|gamma:G", default="the camera file's, else auto")] = None
    # Light and vignetting over the angle a from the optical axis: cos^MU a, exp(-MU (1 - cos a)),
    # or cos^A a exp(-B (1 - cos a)).
    falloff: Annotated[str | None, value("none|cos:MU|exp:MU|cosexp:A,B", default="the camera file's, else none")] = (
        None
    )
    # lambertian, power:A, oren-nayar:SIGMA, phong:K,N or blinn-phong:K,N.
    reflectance: Annotated[str | None, value("FORM", default="the camera file's, else lambertian")] = None
    # Which light is used; R,G,B are weights.
    channel: Annotated[
        str | None, value("luminance|red|green|blue|R,G,B", default="the camera file's, else luminance")
    ] = None
    # Takes out the darkening by blood: E (E/mean(G, B))^S. About 0.15 with --channel red; 0 leaves it in.
    blood: Annotated[float, value("S")] = 0.0
    # Highlights: auto measures inside them by colour and fills their cores; mask fills them; dichromatic is the paper's
    # separation at every pixel; off leaves them in.
    specular: Literal["auto", "mask", "dichromatic", "off"] = "auto"
    # Stored value, as a share of full scale, from which a pixel is clipped and so no data; auto: the last two steps of
    # an integer type, none of float; highest: the photograph's own highest value; off: nothing is clipped.
    clip_limit: Annotated[str, value("auto|highest|off|VALUE")] = "auto"
    # Gaussian smoothing in linear light; auto: 0 to 1.5 px by the photograph's noise.
    smooth: Annotated[str, value("auto|SIGMA_PX")] = "auto"
    # Photometry of a kind of scope, where neither these options nor the camera file say otherwise. colonoscope:
    # response gamma:2.2, fall-off cos:1.6, reflectance power:0.65.
    preset: Annotated[str | None, value("colonoscope", default="none")] = None
    # Gain times albedo, which sets the scale: E = RHO G(cos)/range^2. With 1, lengths are in scene units.
    albedo: Annotated[float | None, value("RHO", default="the camera file's gain_albedo, else 1")] = None
    # The range R in mm at pixel (U, V), which sets the scale instead of --albedo.
    known_range: Annotated[str | None, value("U,V,R", default="none")] = None
    # CSV file with the header u,v,range (mm): known ranges, from which response, fall-off, reflectance and scale are
    # estimated. At least five, at different distances; with --preset two, which then say how this scope differs.
    estimate_photometry: Annotated[Path | None, value("FILE", default="none")] = None
    # Lights beside the lens (JSON, mm): the surface is corrected for them. Needs the scale: --known-range, --albedo in
    # mm², or a calibrated gain_albedo in the camera file.
    lights: Annotated[Path | None, value("FILE", default="none")] = None
    # Also write the 1 sigma map of the range, from the photograph's noise and the camera file's calibration covariance
    # (range_sigma.tiff). Model error is not in it. Costs some twenty solutions.
    uncertainty: bool = False
    # Bits of the floating-point numbers.
    precision: Literal[32, 64] = 32
    # Further formats: mesh.stl; mesh.obj with the photograph as texture; range.pfm and depth.pfm; range.png of 16 bits
    # with its scale in range.json; surface.npz; range.exr (needs the extra exr).
    also: Annotated[tuple[Format, ...], value("stl|obj|pfm|…")] = ()
    # Write front.gif or front.mp4 as well: the front of constant range advances over the photograph.
    animate: Annotated[Literal["gif", "mp4"] | None, value("gif|mp4", default="none")] = None
    # Leave report.html out: the page with pictures, maps and a mesh to turn.
    report: bool = True
    # Replace the results of an earlier run.
    force: bool = False
    # Print result.json instead of a summary.
    json: bool = False

    def __post_init__(self):
        if self.albedo is not None and self.known_range is not None:
            raise CannotRun("--albedo and --known-range both set the scale; give one of them")
        check_albedo(self.albedo)
        self.smooth_px()
        check_clip_limit(self.clip_limit)
        if not 0 <= self.blood <= 2:
            raise CannotRun(f"--blood must lie between 0 and 2, got {self.blood:g}")
        if self.uncertainty and self.light == "distant":
            raise CannotRun("--uncertainty belongs to a light at the camera, not --light distant")
        if self.light == "distant" and self.occlusions not in ("auto", "off"):
            raise CannotRun("--occlusions FILE belongs to a light at the camera, not --light distant")
        self._check_light_options()
        if self.known_range is not None and not numbers("--known-range", self.known_range, "U,V,R")[2] > 0:
            raise CannotRun(f"--known-range needs a range R above 0, got {self.known_range!r}")
        if self.heights is not None and self.light != "distant":
            raise CannotRun("--heights belongs to --light distant; for a light at the camera write --initial")
        if self.heights is not None and self.initial is not None:
            raise CannotRun("--heights and --initial both say what is known to begin with; give one of them")
        if self.concave and self.light != "distant":
            raise CannotRun("--concave belongs to --light distant; a light at the camera leaves no such choice")

    def smooth_px(self) -> float | None:
        """The σ given in px, None for auto."""
        return smooth_px(self.smooth)

    def _check_light_options(self) -> None:
        if self.light == "distant" and (self.lights is not None or self.estimate_photometry is not None):
            raise CannotRun("--lights and --estimate-photometry belong to a light at the camera, not --light distant")
        if self.estimate_photometry is None:
            return
        found = ("response", "falloff", "reflectance", "albedo", "known_range")
        given = [f"--{name.replace('_', '-')}" for name in found if getattr(self, name) is not None]
        if given:
            raise CannotRun(f"--estimate-photometry finds what {', '.join(given)} would set; leave one of them out")
