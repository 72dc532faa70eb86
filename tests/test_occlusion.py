"""Occluding contours: found in the brightness, cut out of the solver, the mesh and the differences."""

import jax.numpy as jnp
import numpy as np
import pytest
from analytic import disc, disc_camera, plane, rays
from scipy import ndimage

from data_synth import default_camera, scene_from_text
from data_synth.viewing import observe
from jaxsfs import Irradiance, Surface, find_occlusions, mesh_from_surface, reconstruct, scaled_to

SIZE = 161


def ball_before_plane(size: int = SIZE, distance: float = 0.8, radius: float = 0.25, sideways: float = 0.5):
    """A small ball before the plane z = 1, beside its nearest point: (camera, range, E, mask, ball's pixels)."""
    camera, mask = disc_camera(size), disc(size)
    d = rays(camera)
    far, far_cosine = plane(d)
    along = distance * (d @ np.array([np.sin(sideways), 0, np.cos(sideways)]))
    root = np.sqrt(np.maximum(along**2 - distance**2 + radius**2, 1e-9))
    near, near_cosine = along - root, root / radius
    hit = along > np.sqrt(distance**2 - radius**2)
    r, c = np.where(hit, near, far), np.where(hit, near_cosine, far_cosine)
    return camera, r, np.where(mask, c / r**2, 0), mask, hit & mask


def image_of(values, mask) -> Irradiance:
    return Irradiance(jnp.asarray(values, jnp.float32), jnp.asarray(mask))


def relative(result, truth, mask) -> np.ndarray:
    return np.abs(np.asarray(result.surface.range)[mask] / truth[mask] - 1)


@pytest.fixture(scope="module")
def before_plane():
    return ball_before_plane()


def test_limb_of_a_ball_is_found_all_round(before_plane):
    _, _, values, mask, hit = before_plane
    found = find_occlusions(values, mask)
    limb = hit & ~ndimage.binary_erosion(hit)
    near = np.ones((5, 5), bool)
    assert (found <= ndimage.binary_dilation(limb, np.ones((9, 9), bool))).all(), "nothing but the limb"
    assert (limb <= ndimage.binary_dilation(found, near)).all(), "all of the limb"
    inside, _ = ndimage.label(mask & ~found, np.ones((3, 3)))
    assert inside[SIZE // 2, 133] != inside[SIZE // 2, 10], "no diagonal step leads through"


@pytest.mark.parametrize("solver", ["sweeping", "level-set"])
def test_front_does_not_leak_over_a_limb(before_plane, solver):
    camera, truth, values, mask, _ = before_plane
    image = image_of(values, mask)
    leaked, cut = (reconstruct(image, camera, solver=solver, occlusions=choice) for choice in ("off", "auto"))
    assert relative(leaked, truth, mask).mean() > 0.03
    assert relative(cut, truth, mask).mean() < 0.006
    assert int(leaked.statistics.contour_pixels) == 0 < int(cut.statistics.contour_pixels)


def test_contours_belong_to_the_nearer_side(before_plane):
    camera, truth, values, mask, hit = before_plane
    result = reconstruct(image_of(values, mask), camera)
    contours = np.asarray(result.surface.contours)
    assert np.asarray(result.surface.valid)[contours].all()
    on_ball = contours & hit
    assert on_ball.any()
    assert np.median(relative(result, truth, on_ball)) < 0.03


def test_given_contours_are_used(before_plane):
    camera, truth, values, mask, hit = before_plane
    line = ndimage.binary_dilation(hit) & ndimage.binary_dilation(~hit, np.ones((3, 3))) & mask
    result = reconstruct(image_of(values, mask), camera, occlusions=jnp.asarray(line))
    assert relative(result, truth, mask & ~line).mean() < 2e-3
    np.testing.assert_array_equal(np.asarray(result.surface.contours), line)


@pytest.mark.parametrize("name", ["plane", "tilted-plane", "ball", "hollow-ball", "wavy-wall"])
def test_smooth_scenes_have_no_contours(name):
    scene = scene_from_text(name)
    view = observe(scene, default_camera(scene, SIZE, SIZE), half_field_deg=50.0)
    assert not find_occlusions(np.asarray(view.irradiance.values), np.asarray(view.surface.valid)).any()


def test_contours_do_not_depend_on_gain_orientation_or_reflectance(before_plane):
    _, _, values, mask, _ = before_plane
    found = find_occlusions(values, mask)
    np.testing.assert_array_equal(find_occlusions(1e-4 * values, mask), found)
    np.testing.assert_array_equal(find_occlusions(np.where(mask, values, np.nan), mask), found)
    power = find_occlusions(values**0.65, mask, 0.65)  # E = cos^a/r^{2a}: another r, the same limb
    assert (power == found).mean() > 0.999


def test_noise_and_blur_are_survived(before_plane):
    camera, truth, values, mask, _ = before_plane
    rng = np.random.default_rng(3)
    blurred = ndimage.gaussian_filter(values, 1.0)
    noisy = np.clip(blurred + 0.004 * blurred.max() * rng.standard_normal(values.shape), 1e-4, None)
    result = reconstruct(image_of(noisy, mask), camera)
    assert relative(result, truth, mask).mean() < 0.02


def test_noise_alone_makes_no_contours():
    camera = disc_camera(SIZE)
    distance, cosine = plane(rays(camera))
    noisy = cosine / distance**2 * (1 + 0.02 * np.random.default_rng(1).standard_normal(cosine.shape))
    assert find_occlusions(noisy, disc(SIZE)).mean() < 1e-3


def test_degenerate_pictures_have_no_contours():
    ones = np.ones((40, 40), bool)
    for picture in (np.zeros((40, 40)), np.ones((40, 40)), np.eye(40)):
        assert find_occlusions(picture, ones).shape == (40, 40)
    assert not find_occlusions(np.zeros((40, 40)), ones).any()
    assert not find_occlusions(np.ones((40, 40)), ~ones).any()
    assert find_occlusions(np.ones((1, 1)), np.ones((1, 1), bool)).shape == (1, 1)


def test_no_triangle_and_no_normal_spans_a_contour(before_plane):
    camera, _, values, mask, hit = before_plane
    surface = reconstruct(image_of(values, mask), camera).surface
    mesh = mesh_from_surface(surface)
    pixels = np.asarray(mesh.vertex_attributes["pixel"])
    on_ball = ndimage.binary_dilation(hit, np.ones((3, 3)))[pixels[:, 1], pixels[:, 0]][mesh.faces]
    distance = np.linalg.norm(mesh.vertices, axis=1)[mesh.faces]
    assert (distance.max(axis=1) / distance.min(axis=1)).max() < 1.25, "the jump is from 0.75 to 1.1"
    assert on_ball.any(), "the ball itself is there"
    _, has_normal = surface.normals()
    assert not np.asarray(has_normal & surface.contours).any()
    whole = mesh_from_surface(Surface(surface.camera, surface.range, surface.valid))
    assert len(mesh.faces) <= len(whole.faces)


def test_scaling_keeps_the_contours(before_plane):
    camera, _, values, mask, _ = before_plane
    result = reconstruct(image_of(values, mask), camera)
    scaled = scaled_to(result, (SIZE // 2, SIZE // 2), 10.0)
    np.testing.assert_array_equal(np.asarray(scaled.surface.contours), np.asarray(result.surface.contours))


def test_mask_of_another_size_is_refused(before_plane):
    camera, _, values, mask, _ = before_plane
    with pytest.raises(ValueError, match=r"mask of occlusions has shape \(3, 3\), the image \(161, 161\)"):
        reconstruct(image_of(values, mask), camera, occlusions=jnp.zeros((3, 3), bool))


def test_part_behind_a_closed_contour_is_entered_between_the_two_extremes():
    """A sphere seen from its centre, c = 1 all over, with a nearer ring-shaped contour given round its middle."""
    camera, mask = disc_camera(SIZE), disc(SIZE)
    inner = np.arccos(np.clip(rays(camera)[..., 2], -1, 1)) < 0.45
    contour = ndimage.binary_dilation(inner, np.ones((3, 3)), iterations=2) & ~inner
    values = np.where(mask, np.where(inner | contour, 1 / 2.0**2, 1.0), 0)
    image = image_of(values, mask)
    found = reconstruct(image, camera, occlusions=jnp.asarray(contour), rim="closed")
    behind = np.asarray(found.surface.range)[SIZE // 2, SIZE // 2 + 30]
    assert 1.0 < behind < 2.0, "neither without a jump nor facing the light at the contour"
    middle = np.asarray(found.surface.range)[SIZE // 2, SIZE // 2]
    off = reconstruct(image, camera, occlusions="off", rim="closed").surface.range[SIZE // 2, SIZE // 2 + 30]
    assert float(off) < behind <= middle <= 2.0 + 1e-5
