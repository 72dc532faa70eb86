"""Pictures for the eye: what is bright, what is grey."""

import jax.numpy as jnp
import numpy as np

from jaxsfs.camera import Perspective
from jaxsfs.pictures import depth_picture, shaded_picture
from jaxsfs.surface import Surface

CAMERA = Perspective(20.0, 20.0, 7.5, 5.5, 16, 12)


def test_near_is_bright_and_missing_data_grey():
    distance = np.broadcast_to(np.linspace(1, 3, 16), (12, 16)).copy()
    valid = np.ones((12, 16), bool)
    valid[0] = False
    picture = depth_picture(distance, valid)
    assert (picture[0] == 96).all()
    brightness = picture[5].astype(int).sum(axis=-1)
    assert (np.diff(brightness[1:-1]) < 0).all()
    assert (depth_picture(np.full((3, 3), np.nan), np.ones((3, 3), bool)) == 96).all()


def test_a_flat_map_has_one_colour():
    picture = depth_picture(np.full((3, 4), 2.0), np.ones((3, 4), bool))
    assert (picture == picture[0, 0]).all()


def test_walls_that_face_the_upper_left_are_brighter():
    x, y = (np.arange(16) - 7.5) / 20, (np.arange(12)[:, None] - 5.5) / 20

    def brightness(slope_x: float, slope_y: float) -> int:
        distance = 10 / (1 + slope_x * x + slope_y * y) * np.sqrt(1 + x**2 + y**2)
        valid = np.ones((12, 16), bool)
        valid[:2] = False
        picture = shaded_picture(Surface(CAMERA, jnp.asarray(distance), jnp.asarray(valid)))
        assert (picture[:2] == 96).all()
        return int(picture[6, 8, 0])

    # A positive slope brings the right (lower) end nearer: the wall faces left (up).
    assert brightness(0.8, 0.0) > brightness(0.0, 0.0) + 10 > brightness(-0.8, 0.0) + 40
    assert brightness(0.0, 0.8) > brightness(0.0, 0.0) + 10 > brightness(0.0, -0.8) + 40
