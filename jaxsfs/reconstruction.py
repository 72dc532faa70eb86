"""Irradiance → Surface: sets up the one equation, lets a solver run, and says how far the result can be trusted."""

from functools import partial
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsfs.camera import AbstractCamera, AbstractCentralCamera, Orthographic
from jaxsfs.forms import Scalar
from jaxsfs.front import front_over, held
from jaxsfs.initial import AbstractInitial, Deadline, SingularPoint
from jaxsfs.irradiance import Irradiance
from jaxsfs.occlusion import find_occlusions
from jaxsfs.reflectance import AbstractReflectance, Lambertian
from jaxsfs.rim import find_rim, limited_at_rim
from jaxsfs.shading import AbstractShading, DistantLight, LightAtCamera, distant_light, light_at_camera
from jaxsfs.status import Statistics, Status, status_of
from jaxsfs.surface import Surface
from jaxsfs.window import Window, window_of

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]


class Reconstruction(eqx.Module):
    """A surface, what it was made from, and what is to be thought of it.

    Lengths are in the unit of √(albedo/irradiance): scene units with albedo 1, millimetres with a calibrated
    gain·albedo, or whatever `scaled_to` says. `surface.contours`: pixels across which nothing was read.
    """

    surface: Surface
    irradiance: Irradiance
    statistics: Statistics
    albedo: Scalar
    status: Status = eqx.field(static=True)


def reconstruct(
    irradiance: Irradiance,
    camera: AbstractCamera,
    *,
    albedo: Scalar = 1.0,
    reflectance: AbstractReflectance = Lambertian(),  # noqa: B008 (frozen)
    light: Literal["camera", "distant"] = "camera",
    solver: Literal["sweeping", "level-set"] = "sweeping",
    order: Literal[1, 2, 3] = 2,
    initial: AbstractInitial | None = None,
    concave: bool = False,
    steps: int | None = None,
    occlusions: Literal["auto", "off"] | Mask = "auto",
    rim: Literal["straight", "closed"] = "straight",
) -> Reconstruction:
    """The surface r(u, v) with E = ρ G(cos θ)/r², for one light at the projection centre of `camera`.

    Range and normals follow from brightness alone (the maximal viscosity solution; Prados & Faugeras 2005), up to
    the factor √albedo. `initial`: `Deadline()` if not given, one automatic `SingularPoint()` for a distant light.
    `order`: of accuracy; 3, for the sweeps alone, corrects a solution of second order where it is smooth. `steps`: at
    most so many steps of the level set, or rounds of the sweeps.

    `light="distant"` (Kimmel & Bruckstein 1995a) needs the orthographic camera: E = ρ cos θ, no deadlines, so z at
    singular points is data (`SummitHeights`) and the solution is the smallest that grows away from them. Whether the
    surface is convex or hollow there cannot be told from the image: `concave=True` takes the given points as the
    farthest ones instead, z → −z.

    Near the light only: `occlusions`: pixels across which nothing is read, since range jumps there; "auto" finds them
    in the image (see `find_occlusions`), "off" takes the surface for continuous. `rim`: what is assumed where the
    nearest wall is cut off by the image's rim: that it is "straight" (see `limited_at_rim`), or nothing, so that it
    faces the light there ("closed", state constraints).

    The surface's range can be differentiated, forward (`jax.jvp`) and in reverse (`jax.grad`), by irradiance, albedo,
    and the parameters of camera and reflectance, by the implicit function theorem at the solution of the sweeps
    (`solver="sweeping"`); not inside `jax.jit`, which `log_range` is made for.

    Raises ValueError for sizes that do not match, a light that does not fit the camera, no valid pixel, an initial
    curve that the brightness contradicts.
    """
    found, _ = _found_and_misfit(
        irradiance, camera, albedo, reflectance, light, solver, order, initial, concave, steps, occlusions, rim
    )
    return found


def reconstruct_with_residual(
    irradiance: Irradiance,
    camera: AbstractCamera,
    *,
    albedo: Scalar,
    reflectance: AbstractReflectance,
    steps: int,
    occlusions: Literal["auto", "off"] | Mask,
    rim: Literal["straight", "closed"],
) -> tuple[Reconstruction, Float[np.ndarray, "height width"]]:
    """`reconstruct` and its `residual_map`, rendered once: for one frame of many, by the sweeps of second order."""
    return _found_and_misfit(
        irradiance, camera, albedo, reflectance, "camera", "sweeping", 2, None, False, steps, occlusions, rim
    )


def _found_and_misfit(
    irradiance: Irradiance, camera, albedo, reflectance, light, solver, order, initial, concave, steps, occlusions, rim
) -> tuple[Reconstruction, Float[np.ndarray, "height width"]]:
    """As `_whole`, computed in the window of the valid pixels where nothing else is given for the whole picture."""
    _check_size(irradiance, camera)
    options = (albedo, reflectance, light, solver, order, initial, concave, steps, occlusions, rim)
    near = light == "camera" and isinstance(camera, AbstractCentralCamera) and isinstance(occlusions, str)
    window = _window(irradiance) if near and (initial is None or isinstance(initial, Deadline)) else None
    if window is None:
        return _whole(irradiance, camera, *options)
    found, misfit = _whole(_cut(irradiance, window), window.camera(camera), *options)
    shape, surface = irradiance.values.shape, found.surface
    assert surface.contours is not None
    pasted = Surface(
        camera,
        jnp.asarray(window.paste(surface.range, shape, 1)),
        jnp.asarray(window.paste(surface.valid, shape, False)),
        jnp.asarray(window.paste(surface.contours, shape, False)),
    )
    whole = Reconstruction(pasted, irradiance, found.statistics, albedo, status=found.status)
    return whole, window.paste(misfit, shape, np.nan)


def _window(irradiance: Irradiance) -> Window | None:
    values = np.asarray(held(irradiance.values))
    return window_of(np.asarray(irradiance.valid) & np.isfinite(values) & (values > 0))


def _cut(irradiance: Irradiance, window: Window) -> Irradiance:
    return Irradiance(window.cut(irradiance.values, 0), window.cut(irradiance.valid, False))


def _whole(
    irradiance: Irradiance, camera, albedo, reflectance, light, solver, order, initial, concave, steps, occlusions, rim
) -> tuple[Reconstruction, Float[np.ndarray, "height width"]]:
    """Surface and misfit map of a picture."""
    inside = _usable(irradiance, camera)
    dtype = irradiance.values.dtype
    metric = camera.inverse_metrics(dtype)
    shading, metric = _shading(irradiance, inside, camera, metric, albedo, reflectance, light)
    initial = (SingularPoint() if light == "distant" else Deadline()) if initial is None else initial
    known = initial.known(_mirrored(shading, concave), inside)
    if int(jnp.sum(inside)) < 4:
        return _too_small(irradiance, camera, albedo, inside), np.full(inside.shape, np.nan, dtype)
    contours = _contours(held(irradiance), held(inside), held(known), held(reflectance), light, occlusions)
    if rim == "straight" and isinstance(shading, LightAtCamera):
        rim_pixels = find_rim(*(np.asarray(held(mask)) for mask in (inside, inside & ~contours)))
        shading = limited_at_rim(shading, metric, rim_pixels)

    found = front_over(shading, metric, inside, contours, known, solver=solver, order=order, steps=steps)
    w, reached = found.w, found.reached

    distance = jnp.where(reached, shading.to_range(w), 1.0).astype(dtype)
    surface = Surface(camera, -distance if concave else distance, reached, contours)
    shown, seen, gain, form = held((surface, irradiance, albedo, reflectance))
    misfit = _misfit_map(shown, seen, gain, form, light)
    explained = misfit[np.isfinite(misfit)]
    mean, p95 = (float(explained.mean()), float(np.percentile(explained, 95))) if explained.size else (np.nan, np.nan)
    statistics = Statistics(
        valid_pixels=int(jnp.sum(reached)),
        unreached_pixels=int(jnp.sum(inside & ~reached)),
        contour_pixels=int(jnp.sum(contours)),
        work=found.work,
        work_unit="steps" if solver == "level-set" else "rounds",
        change=found.change,
        residual_mean=mean,
        residual_p95=p95,
    )
    return Reconstruction(surface, irradiance, statistics, albedo, status=status_of(statistics)), misfit


def scaled_to(result: Reconstruction, pixel: tuple[Scalar, Scalar], distance: Scalar) -> Reconstruction:
    """The same surface with range `distance` at `pixel` (u, v): the equation fixes shape, one range fixes size.

    The albedo scales with the square. Raises ValueError where the pixel has no surface, or the range is not positive.
    """
    surface = result.surface
    u, v = round(float(pixel[0])), round(float(pixel[1]))
    height, width = surface.range.shape
    if not (0 <= u < width and 0 <= v < height and bool(surface.valid[v, u])):
        raise ValueError(f"the known range is at pixel ({u}, {v}), where there is no surface")
    if not distance > 0:
        raise ValueError(f"a known range must be positive, got {distance}")
    if not isinstance(surface.camera, AbstractCentralCamera):
        raise ValueError("a known range scales a near-light surface; with a distant light give heights instead")
    factor = distance / surface.range[v, u]
    return eqx.tree_at(
        lambda r: (r.surface.range, r.albedo), result, (surface.range * factor, result.albedo * factor**2)
    )


def residual_map(
    result: Reconstruction,
    *,
    reflectance: AbstractReflectance = Lambertian(),  # noqa: B008 (frozen)
    light: Literal["camera", "distant"] = "camera",
) -> Float[np.ndarray, "height width"]:
    """|E_rerendered − E|/mean(E) per pixel, what `Statistics` sums up; NaN where the surface has no normal.

    `reflectance` and `light` as in the reconstruction.
    """
    surface, irradiance = result.surface, result.irradiance
    camera, window = surface.camera, _window(irradiance)
    if window is None or light != "camera" or not isinstance(camera, AbstractCentralCamera):
        return _misfit_map(surface, irradiance, result.albedo, reflectance, light)
    # the size at which `reconstruct` computed it too, so that nothing is compiled for the whole picture
    part = Surface(
        window.camera(camera),
        window.cut(surface.range, 1),
        window.cut(surface.valid, False),
        None if surface.contours is None else window.cut(surface.contours, False),
    )
    misfit = _misfit_map(part, _cut(irradiance, window), result.albedo, reflectance, light)
    return window.paste(misfit, irradiance.values.shape, np.nan)


def _check_size(irradiance: Irradiance, camera: AbstractCamera) -> None:
    shape = irradiance.values.shape
    if shape != (camera.height, camera.width):
        raise ValueError(
            f"the image is {shape[1]} x {shape[0]} px but the camera {camera.width} x {camera.height} px: "
            f"use the camera of this image size (camera.resized or camera.cropped)"
        )


def _usable(irradiance: Irradiance, camera: AbstractCamera) -> Mask:
    usable = irradiance.valid & camera.field() & jnp.isfinite(irradiance.values) & (irradiance.values > 0)
    if not bool(jnp.any(usable)):
        raise ValueError("no pixel is valid, has irradiance above 0 and a ray of the camera: check mask and exposure")
    return usable


def _shading(
    irradiance: Irradiance, inside: Mask, camera, metric, albedo: Scalar, reflectance, light: str
) -> tuple[AbstractShading, Float[Array, "height width 2 2"]]:
    if light == "camera" and isinstance(camera, AbstractCentralCamera):
        return light_at_camera(irradiance.values, inside, albedo, reflectance), metric
    if light == "distant" and isinstance(camera, Orthographic):
        if not isinstance(reflectance, Lambertian):
            cosine = reflectance.inverse(irradiance.values / albedo)
            irradiance = Irradiance(albedo * cosine, irradiance.valid)
        unit = camera.width / camera.scale
        return distant_light(irradiance.values, albedo, unit), metric * jnp.asarray(unit**2, metric.dtype)
    if light not in ("camera", "distant"):
        raise ValueError(f"light must be 'camera' or 'distant', got {light!r}")
    raise ValueError(
        f"light {light!r} and a {type(camera).__name__} camera do not go together: a light at the camera needs a "
        f"central camera, a distant light the orthographic one"
    )


def _contours(irradiance: Irradiance, inside: Mask, known: Image, reflectance, light: str, occlusions) -> Mask:
    """Pixels of occluding contours, without those whose range is given."""
    if isinstance(occlusions, str) and occlusions not in ("auto", "off"):
        raise ValueError(f"occlusions must be 'auto', 'off' or a mask, got {occlusions!r}")
    if light == "distant" or (isinstance(occlusions, str) and occlusions == "off"):
        return jnp.zeros_like(inside)
    if isinstance(occlusions, str):
        exponent = float(reflectance.exponent())
        occlusions = find_occlusions(np.asarray(irradiance.values), np.asarray(inside), exponent)
    if occlusions.shape != inside.shape:
        raise ValueError(f"the mask of occlusions has shape {occlusions.shape}, the image {inside.shape}")
    return jnp.asarray(occlusions) & inside & ~jnp.isfinite(known)


def _mirrored(shading: AbstractShading, concave: bool) -> AbstractShading:
    """For hollow surfaces the solver sees −z; only the way a range becomes w changes."""
    if not concave:
        return shading
    if not isinstance(shading, DistantLight):
        raise ValueError("concave is a choice for a distant light; near the light the image decides")
    return eqx.tree_at(lambda s: s.unit, shading, -shading.unit)


def _misfit_map(surface: Surface, irradiance: Irradiance, albedo, reflectance, light) -> Float[np.ndarray, "_ _"]:
    # one mask, made here: within the program XLA would make it anew for each neighbour that is read
    whole = Surface(surface.camera, surface.range, surface.smooth())
    misfit, ok = _misfit(whole, irradiance, albedo, reflectance, light == "distant")
    return np.where(np.asarray(ok), np.asarray(misfit), np.nan)


@partial(jax.jit, static_argnames="distant")
def _misfit(surface: Surface, irradiance: Irradiance, albedo, reflectance, distant: bool):
    cosines, ok = surface.cosines()
    expected = (
        albedo * reflectance(jnp.clip(cosines, 0, 1)) / jnp.where(distant | ~surface.valid, 1, surface.range) ** 2
    )
    mean = jnp.mean(irradiance.values, where=ok)
    return jnp.abs(expected - irradiance.values) / mean, ok


def _too_small(irradiance: Irradiance, camera, albedo: Scalar, inside: Mask) -> Reconstruction:
    nothing = jnp.zeros_like(inside)
    surface = Surface(camera, jnp.ones_like(irradiance.values), nothing, nothing)
    statistics = Statistics(0, int(jnp.sum(inside)), 0, 0, "rounds", 0.0, float("nan"), float("nan"))
    return Reconstruction(surface, irradiance, statistics, albedo, status=Status.FEW_PIXELS)
