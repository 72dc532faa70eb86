"""What `jaxsfs video` does: one set of settings from a few frames, the store, whoever computes, a summary."""

import contextlib
import dataclasses
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jaxsfs import files
from jaxsfs.camera import CameraFile, camera_to_dict
from jaxsfs.cli._clipping import clipping
from jaxsfs.cli._initial import check_mask_size
from jaxsfs.cli._photometric import Photometric, photometric
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._settings import COMMAND_LINE, Setting, given_or_default
from jaxsfs.cli._terminal import CannotRun, command_line, progress, quiet, say, versions
from jaxsfs.cli._video_options import VideoOptions
from jaxsfs.files._frames import AbstractFrames, open_frames
from jaxsfs.files._photo import photo_of
from jaxsfs.files._store import FrameStore, create_store
from jaxsfs.frames import FIGURES, STATUSES, common_highlight, common_mask, common_smoothing, shrink_for
from jaxsfs.photo import size_message
from jaxsfs.video._job import Job, packed, read_frames, settings_of

_NOT_TRUSTWORTHY, _INTERRUPTED = 3, 130
_LOOKED_AT = 7  # frames that mask and smoothing are chosen from
_SCALES = {
    "locked": "one gain times albedo for all frames: ranges of different frames compare where the exposure is locked",
    "frame": "each frame's median range is 1: ranges of different frames do not compare",
}


def run(options: VideoOptions) -> int:
    """Computes what is missing, prints a summary; the exit code."""
    start = time.perf_counter()
    progress(f"reading {options.input}")
    frames = open_frames(options.input)
    chosen = options.chosen(frames.count)
    if not chosen:
        raise files.InputError(f"--frames {options.frames} leaves none of the {frames.count} frames")
    with _workers(options) as client:
        return _run(options, frames, chosen, client, start)


def _run(options: VideoOptions, frames: AbstractFrames, chosen: range, client: Any, start: float) -> int:
    job, attributes, unit = _job(options, frames, chosen)
    frames.close()
    camera = json.loads(job.camera)
    store = create_store(
        options.out,
        chosen,
        (camera["width"], camera["height"]),
        statuses=STATUSES,
        figures=FIGURES,
        attributes=attributes,
        unit=unit,
        per_second=frames.per_second,
        batch=options.batch,
        force=options.force,
    )
    there = int((store.statuses() >= 0).sum())
    try:
        _compute(options, job, store, client)
    except KeyboardInterrupt:
        stored = int((store.statuses() >= 0).sum())
        print(
            f"jaxsfs: interrupted; {stored} of {len(chosen)} frames are stored, the same command goes on",
            file=sys.stderr,
        )
        return _INTERRUPTED
    return _summary(options, store, there, time.perf_counter() - start)


def _job(options: VideoOptions, frames: AbstractFrames, chosen: range) -> tuple[Job, dict[str, Any], Any]:
    """The job, the store's attributes, and the unit of length."""
    file = files.read_camera(options.camera)
    some = _some(frames, chosen, file, options.input)
    settings = _settings(options, file, some[0])
    mask, mask_origin = _mask(options, some, settings.response.value)
    sigma, sigma_origin = options.smooth_px(), COMMAND_LINE
    if sigma is None:
        sigma, noise = common_smoothing(some, mask)
        sigma_origin = f"automatic, median noise {noise:.2%} of full scale"
    clip, flat = clipping(options.clip_limit, some, mask)
    texts = {name: getattr(settings, name).value for name in ("response", "falloff", "reflectance", "channel")}
    job = Job(
        source=str(options.input.resolve()),
        store=str(options.out.resolve()),
        camera=json.dumps(camera_to_dict(file)),
        mask=packed(mask),
        **texts,
        albedo=float(settings.albedo.value),
        specular=options.specular,
        highlight=None,
        clip_limit=clip.value,
        shrink=options.shrink or shrink_for(file.camera),
        smooth_px=float(sigma),
        occlusions=options.occlusions,
        rim=options.rim,
        rounds=options.rounds,
        scale=options.scale,
    )
    job = dataclasses.replace(job, highlight=common_highlight(some, settings_of(job)))
    kept = ("specular", "shrink", "occlusions", "rim", "rounds", "scale")
    origins = {name: getattr(settings, name).as_dict() for name in (*texts, "albedo")}
    origins |= {"mask": mask_origin.as_dict(), "smooth_px": Setting(sigma, sigma_origin).as_dict()}
    origins["clip_limit"] = clip.as_dict()
    origins["highlight"] = Setting(job.highlight, f"from {len(some)} frames").as_dict()
    origins |= {name: given_or_default(options, name, getattr(job, name)).as_dict() for name in kept}
    unit = "median range of the frame" if options.scale == "frame" else settings.unit
    attributes = {
        "title": "surfaces of the frames of a video, from shading",
        "source": options.input.name,  # no path: a store may be passed on
        "camera": json.loads(job.camera),
        "settings": origins,
        "plateau": flat,
        "scale": _SCALES[options.scale],
        "unit": unit,
        "axes": "u right, v down; camera frame x right, y down, z forward; range along each pixel's ray, not depth",
        "versions": versions(),
    }
    return job, attributes, unit


def _some(frames: AbstractFrames, chosen: range, file: CameraFile, source: Path) -> list[np.ndarray]:
    """A few frames of the camera's size, evenly spaced."""
    places = sorted({chosen[i] for i in np.linspace(0, len(chosen) - 1, _LOOKED_AT).astype(int)})
    found = [frame for frame in read_frames(frames, places) if frame is not None]
    if not found:
        raise files.InputError(f"{source}: none of the frames {places} can be decoded")
    height, width = found[0].shape[:2]
    if (file.camera.width, file.camera.height) != (width, height):
        raise files.InputError(size_message(str(source), (width, height), file.camera))
    return [frame for frame in found if frame.shape == found[0].shape and frame.dtype == found[0].dtype]


def _settings(options: VideoOptions, file: CameraFile, frame: np.ndarray) -> Photometric:
    names = ("camera", "out", "response", "falloff", "reflectance", "channel", "preset", "albedo")
    still = ReconstructOptions(image=options.input, **{name: getattr(options, name) for name in names})
    return photometric(still, file, photo_of(frame, options.input))


def _mask(options: VideoOptions, some: list[np.ndarray], response: str) -> tuple[np.ndarray, Setting]:
    if options.mask is None:
        mask, words = common_mask(some, response)
        return mask, Setting(words, "automatic")
    mask = files.read_mask(options.mask)
    check_mask_size(options.mask, mask.shape, (some[0].shape[1], some[0].shape[0]))
    return mask, Setting(f"{options.mask.name}, {mask.mean():.0%} of the image", COMMAND_LINE)


@contextlib.contextmanager
def _workers(options: VideoOptions) -> Iterator[Any]:
    """A client of other processes if they are to compute, None otherwise. They start while the job is made."""
    with contextlib.ExitStack() as stack:
        client = None
        if options.scheduler or options.processes:
            from jaxsfs.video._cluster import workers

            with _named(options):
                client = stack.enter_context(workers(options.scheduler, options.processes))
        yield client


@contextlib.contextmanager
def _named(options: VideoOptions) -> Iterator[None]:
    """Errors of the connection with what it was to."""
    try:
        yield
    except OSError as error:
        given = f"--scheduler {options.scheduler}" if options.scheduler else f"--processes {options.processes}"
        raise CannotRun(f"{given}: {error}") from None


def _compute(options: VideoOptions, job: Job, store: FrameStore, client: Any) -> None:
    from tqdm import tqdm

    missing = store.missing()
    total = sum(end - start for start, end in missing)
    # None: no bar where stderr is no terminal
    with tqdm(total=total, unit="frame", desc="jaxsfs video", disable=True if quiet.get() else None) as bar:

        def done(batch: tuple[int, int], statuses: np.ndarray) -> None:
            bar.update(batch[1] - batch[0])

        if not missing:
            return
        if client is not None:
            from jaxsfs.video._cluster import run_there

            with _named(options):
                run_there(client, job, missing, done=done)
        else:
            from jaxsfs.video._threads import run_here

            run_here(job, missing, threads=options.thread_count(), done=done)


def _summary(options: VideoOptions, store: FrameStore, there: int, seconds: float) -> int:
    names = list(STATUSES)
    statuses = store.statuses()
    counts = Counter(names[number] for number in statuses.tolist())
    computed = len(statuses) - there
    record = {
        "store": str(options.out),
        "frames": len(statuses),
        "computed": computed,
        "seconds": round(seconds, 3),
        "frames_per_second": round(computed / seconds, 3),
        "plateau": store.attributes["plateau"],
        "statuses": dict(counts),
        "scale": store.attributes["scale"],
        "unit": store.attributes["unit"],
        "command": command_line.get(),
    }
    if options.json:
        print(json.dumps(record, indent=2))
    else:
        done = f"{computed} frames in {seconds:.1f} s, {record['frames_per_second']:.2f} a second"
        say(f"{options.out}: {len(statuses)} frames; {done if computed else 'nothing was missing'}")
        for name, count in counts.most_common():
            say(f"  {count:6d} {name}: {STATUSES[name]}")
        say(f"scale: {record['scale']} ({record['unit']})")
    return 0 if 2 * counts["good"] >= len(statuses) else _NOT_TRUSTWORTHY
