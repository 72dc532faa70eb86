"""Nothing is compiled anew for another photograph of the same kind of target: arrays are padded, or stay in numpy."""

import jax
import numpy as np
import pytest

from data_synth.target_patterns import Checkerboard, DotGrid, LineGrid, Rings
from data_synth.targets import Studio, photograph
from jaxsfs.calibration import (
    calibrate_checkerboard,
    calibrate_circles,
    calibrate_dots,
    calibrate_grid,
    calibrate_white,
    tilted,
)
from jaxsfs.camera import Spherical
from jaxsfs.photometry import ExponentialFalloff

CAMERA = Spherical(f=320.0, cx=322.0, cy=238.0, width=640, height=480)
OTHER = Spherical(f=300.0, cx=317.0, cy=243.0, width=640, height=480)  # its files differ, its programs must not
RADII = (5.0, 10.0, 15.0, 20.0, 25.0)
_programs: list[str] = []  # compiled or read from the cache, in the order of their coming
jax.monitoring.register_event_duration_secs_listener(lambda name, *_, **__: _programs.append(name))


def compiled(work) -> int:
    """How many programs `work` asks XLA for."""
    before = len(_programs)
    work()
    return sum(name == "/jax/core/compile/backend_compile_duration" for name in _programs[before:])


def white(image, camera, pose):
    return calibrate_white([image], camera, [pose])


KINDS = {
    "circles": (Rings(RADII, 1.0, 1.0), lambda image, *_: calibrate_circles([image], RADII)),
    "grid": (LineGrid(4.0, 0.5), lambda image, *_: calibrate_grid([image])),
    "checkerboard": (Checkerboard(9, 7, 4.0), lambda image, *_: calibrate_checkerboard([image], 9, 7, 4.0)),
    "dots": (DotGrid(9, 7, 4.0, 1.0), lambda image, *_: calibrate_dots([image], 9, 7, 4.0)),
    "white": (Rings(RADII, 1.0, 1.0), white),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_second_photograph_compiles_nothing(kind):
    pattern, calibrate = KINDS[kind]
    poses = (tilted(12.0, 70.0, 21.0, (1.0, 0.5)), tilted(16.0, 65.0, 22.5, (1.5, 0.0)))
    dim = Studio(falloff=ExponentialFalloff(0.5), blur=1.2)
    scenes = [
        (photograph(camera, pattern, pose, studio, seed), camera, pose)
        for seed, (camera, pose, studio) in enumerate(zip((CAMERA, OTHER), poses, (Studio(), dim), strict=True))
    ]
    assert not np.array_equal(scenes[0][0], scenes[1][0])
    compiled(lambda: calibrate(*scenes[0]))
    assert compiled(lambda: calibrate(*scenes[1])) == 0
