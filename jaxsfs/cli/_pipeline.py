"""What `jaxsfs reconstruct` does: read, turn brightness into irradiance, solve, write."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsfs import files
from jaxsfs.camera import AbstractCamera, camera_to_dict
from jaxsfs.cli._clipping import plateau_record
from jaxsfs.cli._clock import Clock
from jaxsfs.cli._reconstruct_input import Input, initial_form, read
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._reconstruct_report import fronts, report
from jaxsfs.cli._settings import given_or_default
from jaxsfs.cli._summary import summary
from jaxsfs.cli._terminal import command_line, progress, say, started, versions
from jaxsfs.cli._uncertainty import range_sigma
from jaxsfs.irradiance import Irradiance
from jaxsfs.lights import lights_to_dict
from jaxsfs.photo import plateau
from jaxsfs.preparation import Preparation, prepare
from jaxsfs.reconstruction import Reconstruction, reconstruct as solve, scaled_to
from jaxsfs.refinement import Refinement, refine

_NOT_TRUSTWORTHY = 3


def run(options: ReconstructOptions) -> int:
    """Reconstructs as the options say, writes the folder of results, prints a summary; the exit code."""
    clock = Clock(started.get())
    files.check_formats(options.also)
    with files.output_folder(options.out, force=options.force) as folder:
        clock.lap("start")
        progress(f"reading {options.image}")
        given = read(options)
        clock.lap("read")
        progress(f"solving {given.size[0]} x {given.size[1]} px")
        prepared = _prepared(options, given)
        clock.lap("irradiance")
        once = _solution(options, given, prepared)
        result, refinement = _solved(given, prepared, once)
        jax.block_until_ready(result.surface.range)
        clock.lap("solve")
        sigma, spread = None, None
        if options.uncertainty and bool(result.surface.valid.any()):
            progress("estimating the uncertainty")
            by_sweeps = _solution(dataclasses.replace(options, solver="sweeping"), given, prepared)
            sigma, spread = range_sigma(given, prepared, result, by_sweeps)
        progress(f"writing {options.out}")
        files.write_surface(folder, result.surface, given.photo.rgb8(), given.settings.unit, sigma)
        record = _record(options, given, result, prepared, refinement) | {"uncertainty": spread}
        record["seconds"] = clock.rounded()
        files.write_json(folder / "result.json", record)
        files.write_also(folder, result.surface, given.photo.rgb8(), record, options.also, sigma)
        if options.animate and bool(result.surface.valid.any()):
            progress(f"drawing front.{options.animate}")
            files.write_animation(folder / f"front.{options.animate}", fronts(given, result, options.light))
        if options.report:
            page = report(given, result, prepared, record, options.light, sigma)
            files.write_bytes(folder / "report.html", page.encode())
    if options.json:
        print((options.out / "result.json").read_text(encoding="utf-8"), end="")
    else:
        say(summary(record, options.out, clock.total()))
    trustworthy = result.status.trustworthy and (refinement is None or refinement.status.trustworthy)
    return 0 if trustworthy else _NOT_TRUSTWORTHY


def _prepared(options: ReconstructOptions, given: Input) -> Preparation:
    settings = given.settings
    return prepare(
        given.photo.values,
        given.file.camera,
        valid=given.valid,
        specular=options.specular,
        blood=options.blood,
        response=settings.parsed("response"),
        falloff=settings.parsed("falloff"),
        weights=settings.parsed("channel"),
        smooth_px=given.smooth.value,
        clip_limit=given.clip.value,
    )


def _solution(options: ReconstructOptions, given: Input, prepared: Preparation):
    """How a surface is found, as a function of irradiance and camera."""
    settings = given.settings

    def once(irradiance: Irradiance, camera: AbstractCamera = given.file.camera) -> Reconstruction:
        found = solve(
            irradiance,
            camera,
            albedo=prepared.photo.largest if settings.albedo.value is None else settings.albedo.value,
            reflectance=settings.parsed("reflectance"),
            light=options.light,
            solver=options.solver,
            order=options.order,
            initial=given.initial,
            concave=options.concave,
            occlusions=given.occlusions if isinstance(given.occlusions, str) else jnp.asarray(given.occlusions),
            rim=options.rim,
        )
        return found if given.known_range is None else scaled_to(found, *given.known_range)

    return once


def _solved(
    given: Input, prepared: Preparation, once: Callable[[Irradiance], Reconstruction]
) -> tuple[Reconstruction, Refinement | None]:
    result = once(prepared.irradiance)
    if given.lights is None:
        return result, None
    progress("refining for lights beside the lens")
    refinement = refine(result, given.lights, reflectance=given.settings.parsed("reflectance"), again=once)
    return refinement.result, refinement


def _record(
    options: ReconstructOptions,
    given: Input,
    result: Reconstruction,
    prepared: Preparation,
    refinement: Refinement | None,
) -> dict[str, Any]:
    """result.json."""
    settings = given.settings
    flat = plateau(given.photo.values, given.valid, given.clip.value)
    albedo = dataclasses.replace(settings.albedo, value=float(result.albedo))
    settings_used = {
        "response": settings.response,
        "falloff": settings.falloff,
        "reflectance": settings.reflectance,
        "channel": settings.channel,
        "albedo": albedo,
        "mask": given.mask,
        "clip_limit": given.clip,
        "smooth": given.smooth,
        "initial": initial_form(options),
    }
    return {
        "image": str(options.image),
        "size": {"width": given.size[0], "height": given.size[1]},
        "status": {
            "name": result.status.name.lower().replace("_", "-"),
            "message": result.status.value,
            "trustworthy": result.status.trustworthy,
        },
        "unit": settings.unit,
        "figures": {
            "range": _lengths(result),
            "photograph": prepared.photo.as_dict() | {"plateau": plateau_record(flat)},
            "preparation": prepared.figures(),
            "solution": result.statistics.as_dict(),
        },
        "photometry_estimate": None if given.estimate is None else dict(vars(given.estimate)),
        "lights": None
        if refinement is None or given.lights is None
        else refinement.as_dict() | lights_to_dict(given.lights),
        "options": {name: setting.as_dict() for name, setting in settings_used.items()}
        | {
            name: given_or_default(options, name).as_dict()
            for name in (
                "preset",
                "specular",
                "occlusions",
                "rim",
                "blood",
                "light",
                "solver",
                "order",
                "precision",
                "known_range",
                "concave",
            )
        },
        "camera": camera_to_dict(given.file),
        "versions": versions(),
        "command": command_line.get(),
    }


def _lengths(result: Reconstruction) -> dict[str, float | None]:
    values = np.asarray(result.surface.range)[np.asarray(result.surface.valid)].astype(float)
    names = ("nearest", "median", "farthest")
    found = np.percentile(values, [0, 50, 100]).tolist() if values.size else [None] * len(names)
    return dict(zip(names, found, strict=True))
