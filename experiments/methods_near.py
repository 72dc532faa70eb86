"""The tables `near` and `photograph` of methods.py."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from baselines import curve_expansion, prados_faugeras
from near_scenes import OCCLUDED, OPEN, NearImage, errors, near_image, rectified
from stored import irradiance_of_stored

from data_synth import take_photo
from jaxsfs import Irradiance, SRGBResponse, reconstruct

Method = Callable[[NearImage], np.ndarray]
SRGB = SRGBResponse()
CLIPPED = 254 / 255
OURS = "jaxsfs sweeping, order 2"


def _centre(image: NearImage) -> tuple[float, float]:
    return float(image.camera.cx), float(image.camera.cy)


def paper(start: str) -> Method:
    """Section 5 of the paper on the spherical image."""
    return lambda image: curve_expansion.spherical(
        image.values, image.mask, float(image.camera.f), _centre(image),
        getattr(curve_expansion, start)(image.values, image.mask),
    )  # fmt: skip


def paper_rectified(image: NearImage) -> np.ndarray:
    """Section 5's other way: rectify to perspective, then eq. (6)."""
    flat = rectified(image)
    start = curve_expansion.cone(flat.values, flat.mask)
    found = curve_expansion.perspective(flat.values, flat.mask, flat.focal_length, _centre(image), start)
    return flat.returned(found)


def okatani_deguchi(image: NearImage) -> np.ndarray:
    """Eq. (6) on the picture as it is: the lens is taken for a pinhole of the same scale in the centre."""
    start = curve_expansion.cone(image.values, image.mask)
    return curve_expansion.perspective(image.values, image.mask, float(image.camera.f), _centre(image), start)


def prados(image: NearImage) -> np.ndarray:
    """Their pinhole scheme on the rectified picture."""
    flat = rectified(image)
    return flat.returned(prados_faugeras.reconstruct(flat.values, flat.mask, flat.focal_length, _centre(image)))


def ours(**options) -> Method:
    """jaxsfs.reconstruct."""

    def method(image: NearImage) -> np.ndarray:
        values = jnp.asarray(image.values, jnp.float32)
        found = reconstruct(Irradiance(values, jnp.asarray(image.mask)), image.camera, **options).surface
        return np.where(np.asarray(found.valid), np.asarray(found.range, float), np.nan)

    return method


METHODS: dict[str, Method] = {
    "Okatani & Deguchi 1997 (lens as pinhole)": okatani_deguchi,
    "paper, rectified + eq. 6": paper_rectified,
    "paper, spherical, cone": paper("cone"),
    "paper, spherical, threshold": paper("threshold"),
    "Prados & Faugeras 2005, rectified": prados,
    "jaxsfs level set, order 1": ours(solver="level-set", order=1),
    "jaxsfs level set, order 2": ours(solver="level-set", order=2),
    "jaxsfs sweeping, order 1": ours(order=1),
    "jaxsfs sweeping, order 2, contours not cut": ours(occlusions="off"),
    OURS: ours(),
}


def near_table(quick: bool, timed) -> list[dict]:
    """Rows scene × method, exact pictures; errors over the pixels that every method has an answer for."""
    size, names = (49, ("ball", "wavy-wall")) if quick else (193, OPEN + OCCLUDED)
    rows = []
    for name in names:
        image = near_image(name, size)
        answers = {}
        for method, call in METHODS.items():
            answers[method] = timed(lambda call=call, image=image: call(image), method.startswith("jaxsfs"))
        common = image._replace(mask=image.mask & np.all([np.isfinite(found) for found, _ in answers.values()], axis=0))
        mine = []
        for method, (found, seconds) in answers.items():
            judged = errors(common, found)
            share = np.isfinite(found[image.mask]).mean()
            mine.append({"scene": name, "method": method, "AbsRel": float(f"{judged.abs_rel:.3g}"),
                         "normals °": f"{judged.normals_deg:.2f}", "share of pixels": f"{share:.3f}",
                         "cpu s": round(seconds, 3)})  # fmt: skip
        rows += [row | {"faster and better": _dominating(row, mine)} for row in mine]
    return rows


def _dominating(row: dict, rows: list[dict]) -> int:
    """How many rows are both faster and more accurate."""
    return sum(r["AbsRel"] < row["AbsRel"] and r["cpu s"] < row["cpu s"] for r in rows)


def red_minus_green(stored: np.ndarray, decode: bool) -> np.ndarray:
    """The paper's body image, R − G, of the stored values or of linear light; scaled to a 99th percentile of 1."""
    values = np.asarray(SRGB.decode(jnp.asarray(stored))) if decode else stored
    difference = np.maximum(values[..., 0] - values[..., 1], 0)
    return difference / np.percentile(difference[difference > 0], 99)


def photograph_table(quick: bool, timed) -> list[dict]:
    """Rows scene × (way to E, method) from an 8-bit colour photograph with highlights and noise of 0.4 %."""
    size, names = (49, ("ball",)) if quick else (193, ("ball", "wavy-wall", "tube", "polyps"))
    rows = []
    for name in names:
        image = near_image(name, size)
        stored = take_photo(image.view, shine=0.5, read_noise=0.004, seed=1).stored / 255.0
        clipped = (stored >= CLIPPED).any(axis=-1)
        ways = {
            "R − G of stored values": red_minus_green(stored, False),
            "R − G of linear light": red_minus_green(stored, True),
        }
        for way, values in ways.items():
            # the paper leaves clipped pixels black: holes that the front goes round
            seen = image._replace(values=values, mask=image.mask & ~clipped & (values > 0.01))
            for method in ("paper, spherical, cone", OURS):
                rows.append(_photographed(name, way, method, image, METHODS[method](seen)))
        rows.append(_photographed(name, "jaxsfs highlight removal", OURS, image, _prepared(image, stored)))
    return rows


def _photographed(name: str, way: str, method: str, image: NearImage, found: np.ndarray) -> dict:
    judged = errors(image, found)
    return {"scene": name, "E from": way, "method": method, "AbsRel": float(f"{judged.abs_rel:.3g}"),
            "normals °": f"{judged.normals_deg:.2f}", "share of pixels": f"{judged.share:.3f}"}  # fmt: skip


def _prepared(image: NearImage, stored: np.ndarray) -> np.ndarray:
    """As the command line does it."""
    irradiance = irradiance_of_stored(stored, image.camera, image.mask)
    seen = image._replace(values=np.asarray(irradiance.values), mask=np.asarray(irradiance.valid))
    return ours()(seen)
