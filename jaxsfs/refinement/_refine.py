"""Lights beside the lens by repeated solution for a light at the lens."""

import enum
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.lights import Lights, check_two_angles
from jaxsfs.reconstruction import Reconstruction, reconstruct
from jaxsfs.refinement._gauss_newton import polish
from jaxsfs.refinement._ratio import light_ratio
from jaxsfs.reflectance import AbstractReflectance, Lambertian
from jaxsfs.rendering import render_lights
from jaxsfs.surface import Surface

_SETTLED = 2e-3  # mean change of ln r; the rest is a fifth of that, and the polish takes it
_EXPLAINED = 0.2  # residual that a surface may have, as for a light at the lens


class RefinementStatus(enum.Enum):
    """What became of a refinement. The value is the message: what happened and what to do."""

    SETTLED = "The surface is corrected for the lights beside the lens."
    NOT_SETTLED = (
        "The correction for the lights was still changing when it ended, or does not explain the image: check the "
        "albedo (gain x albedo, in mm²) and the positions of the lights. Surfaces as near as the lights are to the "
        "lens are out of reach."
    )
    WORSE = (
        "The correction for the lights did not explain the image better and was dropped: the surface is that of a "
        "light at the lens. Check the positions of the lights and the albedo (gain x albedo, in mm²)."
    )

    @property
    def trustworthy(self) -> bool:
        """Whether the correction may be used without a second look."""
        return self is RefinementStatus.SETTLED


class Refinement(eqx.Module):
    """A surface corrected for its lights, and how that went.

    `changes`: mean |Δ ln r| of every solve; `polish_steps`: Gauss–Newton steps after them. `residual_before`,
    `residual_after`: mean |E_lights − E|/mean(E) of the given and of the returned surface under the true lights.
    """

    result: Reconstruction
    changes: tuple[float, ...]
    polish_steps: int
    residual_before: float
    residual_after: float
    status: RefinementStatus = eqx.field(static=True)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and texts, by name."""
        return {
            "status": self.status.name.lower().replace("_", "-"),
            "message": self.status.value,
            "solves": len(self.changes),
            "changes": list(self.changes),
            "polish_steps": self.polish_steps,
            "residual_before": self.residual_before,
            "residual_after": self.residual_after,
        }


def refine(
    result: Reconstruction,
    lights: Lights,
    *,
    reflectance: AbstractReflectance = Lambertian(),  # noqa: B008 (frozen)
    again: Callable[[Irradiance], Reconstruction] | None = None,
    solves: int = 8,
    polish_steps: int = 6,
    smoothness: Scalar = 0.04,
) -> Refinement:
    """The surface that explains the image of `result` under `lights`, from the one for a light at the lens.

    First E' = E/q(surface), surface = solution of E' = ρ G(cos θ)/r² for a light at the lens, again and again until
    ln r changes by less than 2e-3 on average or `solves` are done; q is the ratio of the two lights' irradiances on
    the last surface (`light_ratio`). A fixed point solves the equation of the true lights and stays a viscosity
    solution; the error falls by about the lights' offset over the range with every solve. Then at most `polish_steps`
    steps of Gauss–Newton on ln r with a weak prior on bends (`polish`, `smoothness`), which is central where the
    solver is one-sided: less error on clean images and less noise on noisy ones; 0 leaves them out.

    `result.surface` must be in the unit of the lights' positions (mm): solve with a calibrated albedo (gain·ρ in mm²),
    or scale by a known range first. The image does not tell a wrong scale: at each there is a surface that explains
    it. `again` solves E'; by default `reconstruct` with the camera, albedo and `reflectance` of `result`. Give it where
    other options were used, or where a known range sets the scale:
    `again=lambda e: scaled_to(reconstruct(e, camera), pixel, distance)`.

    Raises ValueError for a camera without a projection centre, a reflectance other than Lambertian and Power, and
    fewer than one solve.
    """
    _check(result, reflectance, solves)
    if again is None:
        again = partial(reconstruct, camera=result.surface.camera, albedo=result.albedo, reflectance=reflectance)
    before = _residual(result, result.irradiance, lights, reflectance)
    found, changes = _fixed_point(result, lights, reflectance, again, solves)
    found, steps = _polished(found, result.irradiance, lights, reflectance, smoothness, polish_steps)
    after = _residual(found, result.irradiance, lights, reflectance)
    if not after < before:
        return Refinement(result, changes, steps, before, before, status=RefinementStatus.WORSE)
    settled = changes[-1] < max(_SETTLED, 0.1 * changes[0]) and after < _EXPLAINED
    found = eqx.tree_at(lambda r: (r.irradiance, r.statistics.residual_mean), found, (result.irradiance, after))
    status = RefinementStatus.SETTLED if settled else RefinementStatus.NOT_SETTLED
    return Refinement(found, changes, steps, before, after, status=status)


def _fixed_point(
    result: Reconstruction, lights: Lights, reflectance: AbstractReflectance, again, solves: int
) -> tuple[Reconstruction, tuple[float, ...]]:
    """The last solution before the changes grow: then it runs away, or is at the level of the noise."""
    irradiance, current, changes = result.irradiance, result, []
    while len(changes) < solves and not (changes and changes[-1] < _SETTLED):
        ratio = light_ratio(current.surface, lights, reflectance)
        following = again(eqx.tree_at(lambda e: e.values, irradiance, irradiance.values / ratio))
        change = float(_change(current.surface, following.surface))
        if changes and not change < changes[-1]:
            break
        changes.append(change)
        current = following
    return current, tuple(changes)


def _polished(
    found: Reconstruction, irradiance: Irradiance, lights: Lights, reflectance, smoothness: Scalar, steps: int
) -> tuple[Reconstruction, int]:
    if not steps or not bool(jnp.any(found.surface.valid)):
        return found, 0
    done = polish(
        found.surface,
        irradiance,
        lights,
        reflectance=reflectance,
        albedo=found.albedo,
        smoothness=smoothness,
        steps=steps,
    )
    # the range alone: what a compiled function returns has arrays for the camera's numbers
    return eqx.tree_at(lambda r: r.surface.range, found, done.surface.range), int(done.steps)


def _check(result: Reconstruction, reflectance: AbstractReflectance, solves: int) -> None:
    camera = result.surface.camera
    if not isinstance(camera, AbstractCentralCamera):
        raise ValueError(f"lights beside the lens need a central camera, got {type(camera).__name__}")
    check_two_angles(reflectance)
    if solves < 1:
        raise ValueError(f"a refinement takes at least one solve, got solves={solves}")


@jax.jit
def _change(before: Surface, after: Surface):
    both = before.valid & after.valid
    ratio = jnp.where(both, after.range / before.range, 1)
    return jnp.mean(jnp.abs(jnp.log(ratio)), where=both)


@jax.jit
def _misfit(surface: Surface, irradiance: Irradiance, lights: Lights, reflectance, albedo):
    model = render_lights(surface, lights, reflectance=reflectance, albedo=albedo)
    both = model.valid & irradiance.valid
    return jnp.abs(model.values - irradiance.values) / jnp.mean(irradiance.values, where=both), both


def _residual(result: Reconstruction, irradiance: Irradiance, lights: Lights, reflectance) -> float:
    misfit, both = _misfit(result.surface, irradiance, lights, reflectance, result.albedo)
    return float(jnp.mean(misfit, where=both))
