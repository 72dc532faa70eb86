"""What each broken assumption costs: one assumption at a time, everything else as the model wants it.

    python experiments/model_errors.py --out out/model_errors
    python experiments/model_errors.py --quick

Scenes in millimetres, seen at 13–20 mm in a round field of 50°. AbsRel of range after median alignment, so that a
wrong overall scale is not counted. Exact pictures are changed and solved as they are; where the fault is one of
photographs (vessels, highlights, noise, blur, JPEG, clipping) the picture is stored in 8-bit sRGB and prepared as the
command line does it. Figure: one panel per assumption, a line per scene, the dashed line its error with nothing
broken. The table has the mean over the scenes; the words below it are made from the table. Interreflection is not
here: it needs a path tracer.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from near_scenes import NearImage, errors, near_image
from stored import irradiance_of_stored
from tables import main, pyplot, save, write_tables
from tqdm import tqdm

from data_synth import Ball, Plane, PolypWall, WavyWall, default_camera, take_photo, vessel_colours, wet_glints
from jaxsfs import CosineFalloff, Irradiance, Light, Lights, Spherical, SRGBResponse, reconstruct, shade_lights
from jaxsfs.specular import Method

SCENES = {
    "tilted plane": Plane(15.0, 0.3, -0.2),
    "ball": Ball(12.0, 0.0, 0.0, 25.0),
    "wavy wall": WavyWall(15.0),
    "polyps": PolypWall(((3.0, 2.0, 1.5, 2.5), (-5.0, 1.0, 1.5, 2.0)), 15.0, 0.1, -0.1, 1.0),
}
SRGB = SRGBResponse()


def solve(image: NearImage, values: np.ndarray, mask: np.ndarray | None = None, camera=None) -> np.ndarray:
    """Range map of jaxsfs, NaN where it has none."""
    mask = image.mask if mask is None else mask
    irradiance = Irradiance(jnp.asarray(values, jnp.float32), jnp.asarray(mask & (values > 0)))
    found = reconstruct(irradiance, image.camera if camera is None else camera).surface
    return np.where(np.asarray(found.valid), np.asarray(found.range, float), np.nan)


def photographed(
    image: NearImage, stored: np.ndarray, specular: Method = "auto", channel: str = "luminance", blood: float = 0.0
) -> np.ndarray:
    """Range map from stored values (full scale 1), prepared with the defaults of the command line."""
    made = irradiance_of_stored(stored, image.camera, image.mask, specular=specular, channel=channel, blood=blood)
    return solve(image, np.asarray(made.values), np.asarray(made.valid))


def light_off(image: NearImage, millimetres: float) -> np.ndarray:
    """One guide that far to the right of the lens, taken for a light at the lens."""
    lights = Lights((Light((millimetres, 0.0, 0.0)),))
    with jax.enable_x64(True):
        surface, normals = image.view.surface, jnp.asarray(image.view.normals)
        points = jnp.asarray(image.truth)[..., None] * surface.camera.rays()
        values = np.asarray(shade_lights(points, normals, lights))
    return solve(image, np.where(image.mask, values, 0))


def gamma_wrong(image: NearImage, percent: float) -> np.ndarray:
    """Stored with a gamma of 2.2 (1 + percent), decoded with 2.2: E^(1/(1 + percent))."""
    return solve(image, (image.values / image.values.max()) ** (1 / (1 + percent / 100)))


def falloff_ignored(image: NearImage, mu: float) -> np.ndarray:
    """A fall-off cos^μ α that nobody divides out."""
    axial = np.asarray(image.camera.rays())[..., 2]
    return solve(image, image.values * np.asarray(CosineFalloff(mu)(jnp.asarray(axial))))


def f_wrong(image: NearImage, percent: float) -> np.ndarray:
    """The lens taken for one with another f."""
    c = image.camera
    assert isinstance(c, Spherical)
    other = Spherical(f=float(c.f) * (1 + percent / 100), cx=c.cx, cy=c.cy, width=c.width, height=c.height)
    return solve(image, image.values, camera=other)


def vessels(channel: str, blood: float) -> Callable[[NearImage, float], np.ndarray]:
    """Blood in the mucosa: luminance taken for shading, or red light with its absorption divided out."""

    def answer(image: NearImage, strength: float) -> np.ndarray:
        colours = vessel_colours(image.view, seed=3, strength=strength)
        stored = take_photo(image.view, body_colour=colours).stored / 255.0
        return photographed(image, stored, channel=channel, blood=blood)

    return answer


def highlights(specular: Method) -> Callable[[NearImage, float], np.ndarray]:
    """Broad highlights and glints, left in ("off") or removed ("auto")."""

    def answer(image: NearImage, shine: float) -> np.ndarray:
        glints = wet_glints(image.view, seed=5, count=15) if shine else None
        stored = take_photo(image.view, shine=shine, glints=glints, seed=1).stored / 255.0
        return photographed(image, stored, specular)

    return answer


def noise(image: NearImage, percent: float) -> np.ndarray:
    """White noise, per cent of full scale, in linear light."""
    return photographed(image, take_photo(image.view, read_noise=percent / 100, seed=1).stored / 255.0)


def blur(image: NearImage, sigma: float) -> np.ndarray:
    """Gaussian blur in px."""
    return photographed(image, take_photo(image.view, blur_px=sigma).stored / 255.0)


def jpeg(image: NearImage, quality: float) -> np.ndarray:
    """Stored as JPEG of this quality."""
    stored = np.ascontiguousarray(take_photo(image.view).stored[..., ::-1])
    _, data = cv2.imencode(".jpg", stored, [cv2.IMWRITE_JPEG_QUALITY, int(quality)])
    return photographed(image, cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1] / 255.0)


def clipped(image: NearImage, percent: float) -> np.ndarray:
    """Exposed so that this share of the pixels clips in their brightest channel."""
    return photographed(image, take_photo(image.view, percentile=100 - percent, level=1.0).stored / 255.0)


class Fault(NamedTuple):
    """An assumption, the unit of its levels, the levels, the one a user may well meet, how it is broken, and what
    helps."""

    name: str
    unit: str
    levels: Sequence[float]
    typical: float
    answer: Callable[[NearImage, float], np.ndarray]
    advice: str


FAULTS = (
    Fault("light off the lens", "mm", (1, 2, 4, 8), 4, light_off, "give the lights' positions (--lights)"),
    Fault("gamma wrong", "%", (-20, -10, -5, 5, 10, 20), 10, gamma_wrong, "calibrate the response"),
    Fault("fall-off cos^μ ignored", "μ", (0.5, 1, 1.6, 2), 1.6, falloff_ignored, "photograph white paper"),
    Fault("f wrong", "%", (-5, -2, -1, 1, 2, 5), 1, f_wrong, "calibrate with circles or a grid"),
    Fault("vessels", "strength", (0.25, 0.5, 1), 0.5, vessels("luminance", 0), "use the red channel with --blood 0.15"),
    Fault("vessels, red, blood 0.15", "strength", (0.25, 0.5, 1), 0.5, vessels("red", 0.15), "nothing more"),
    Fault("highlights left in", "shine", (0.25, 0.5, 1), 0.5, highlights("off"), "let them be removed (the default)"),
    Fault("highlights removed", "shine", (0.25, 0.5, 1), 0.5, highlights("auto"), "nothing more"),
    Fault("noise", "%", (0.5, 1, 2, 5), 1, noise, "average frames"),
    Fault("blur", "σ px", (0.5, 1, 2, 4), 1, blur, "focus"),
    Fault("JPEG", "quality", (50, 75, 85, 95), 85, jpeg, "store losslessly"),
    Fault("clipped", "% of pixels", (5, 10, 20, 40), 10, clipped, "expose for the brightest part"),
)  # fmt: skip


def table_of(costs: dict[tuple[str, float, str], float], clean: dict[str, float], faults) -> list[dict]:
    """One row per fault and level: mean over the scenes."""
    base = np.mean(list(clean.values()))
    rows = [{"assumption": "none broken", "level": "–", "AbsRel": f"{base:.4f}", "added": "–"}]
    for fault in faults:
        for level in fault.levels:
            mean = np.mean([costs[fault.name, level, scene] for scene in clean])
            rows.append({"assumption": fault.name, "level": f"{level:g} {fault.unit}", "AbsRel": f"{mean:.4f}",
                         "added": f"{mean - base:+.4f}"})  # fmt: skip
    return rows


def advice(costs: dict[tuple[str, float, str], float], clean: dict[str, float], faults) -> str:
    """The paragraph: costs at usual levels, in order, and what to do about those above 1 %."""
    base = np.mean(list(clean.values()))
    added = {}
    for fault in faults:
        level = min(fault.levels, key=lambda x, fault=fault: abs(x - fault.typical))
        mean = np.mean([costs[fault.name, level, scene] for scene in clean]) - base
        added[f"{fault.name} ({level:g} {fault.unit})"] = (float(mean), fault.advice)
    order = sorted(added.items(), key=lambda item: -item[1][0])
    dear = [f"{name} +{100 * cost:.1f} %: {help_}" for name, (cost, help_) in order if cost >= 0.01]
    cheap = [f"{name} {100 * cost:+.2f} %" for name, (cost, _) in order if cost < 0.01]
    return (
        f"With nothing broken the error of range is {100 * base:.2f} % on these scenes. What costs 1 % or more at a "
        f"usual level, the dearest first: {'; '.join(dear) or 'nothing'}. What costs less: {'; '.join(cheap) or '–'}."
    )


def sheet(costs: dict[tuple[str, float, str], float], clean: dict[str, float], faults, path: Path) -> None:
    plt = pyplot()
    columns = 4
    lines = -(-len(faults) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(15, 3.2 * lines), layout="constrained", squeeze=False)
    for axis, fault in zip(axes.flat, faults, strict=False):
        for index, (scene, base) in enumerate(clean.items()):
            values = [costs[fault.name, level, scene] for level in fault.levels]
            axis.plot(fault.levels, values, "o-", color=f"C{index}", label=scene, ms=3)
            axis.axhline(base, color=f"C{index}", ls="--", lw=0.7)
        axis.set(title=fault.name, xlabel=fault.unit, yscale="log", ylim=(3e-5, 0.5))
        axis.grid(True, alpha=0.3)
    for axis in list(axes.flat)[len(faults) :]:
        axis.axis("off")
    axes[0, 0].legend(fontsize=7)
    for line in axes:
        line[0].set_ylabel("AbsRel of range")
    save(figure, path)


def run(out: Path, quick: bool) -> list[dict]:
    """Writes model_errors.png and the table with its words to `out`; returns the rows."""
    size, names = (65, ("tilted plane",)) if quick else (257, tuple(SCENES))
    faults = [fault._replace(levels=[fault.typical]) if quick else fault for fault in FAULTS]
    images = {name: near_image(SCENES[name], size, default_camera(SCENES[name], size, size)) for name in names}
    clean = {name: errors(image, solve(image, image.values)).abs_rel for name, image in images.items()}
    jobs = [(fault, level, name) for name in names for fault in faults for level in fault.levels]
    costs = {}
    for fault, level, name in tqdm(jobs, file=sys.stderr, disable=None):
        costs[fault.name, level, name] = errors(images[name], fault.answer(images[name], level)).abs_rel
    sheet(costs, clean, faults, out / "model_errors.png")
    rows = table_of(costs, clean, faults)
    print(write_tables(out, "model_errors", {"model errors": rows}, advice(costs, clean, faults)))
    return rows


if __name__ == "__main__":
    main("What each broken assumption costs.", run, "model_errors")
