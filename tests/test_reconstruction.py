"""reconstruct(): initial curves, distant light, scale, status and bad input."""

import jax.numpy as jnp
import numpy as np
import pytest
from analytic import as_image, scene

from jaxsfs.camera import Orthographic, Perspective
from jaxsfs.initial import Curve, Deadline, SingularPoint, SummitHeights, Threshold
from jaxsfs.irradiance import Irradiance
from jaxsfs.reconstruction import reconstruct, scaled_to
from jaxsfs.status import Status

SIZE = 65


@pytest.fixture(scope="module")
def tilted():
    camera, distance, cosine, mask = scene("tilted", SIZE)
    return camera, distance, Irradiance(as_image(cosine / distance**2, mask), jnp.asarray(mask)), mask


def error(result, distance, mask) -> float:
    return float(np.mean(np.abs(np.asarray(result.surface.range) / distance - 1)[mask]))


def test_every_initial_curve_leads_to_the_same_plane(tilted):
    camera, distance, image, mask = tilted
    brightest = float(jnp.max(jnp.where(image.valid, image.values, 0)))
    ring = np.abs(distance - 1.1) < 0.02
    curves = [
        Deadline(),
        SingularPoint(),
        SingularPoint((21, 32), float(distance[32, 21])),
        Threshold(0.97 * brightest),
        Curve(jnp.asarray(ring & mask), 1.1),
    ]
    for initial in curves:
        for solver in ("sweeping", "level-set"):
            result = reconstruct(image, camera, initial=initial, solver=solver)
            bound = 0.02 if isinstance(initial, Curve) else 4e-3
            assert error(result, distance, mask) < bound, initial
            assert result.status is Status.GOOD


def test_a_nearer_initial_curve_pulls_the_surface_towards_it(tilted):
    """A given range is data: the surface there is where it was put, and its surroundings follow."""
    camera, distance, image, _ = tilted
    result = reconstruct(image, camera, initial=SingularPoint((40, 32), 0.8 * float(distance[32, 40])))
    assert np.isclose(result.surface.range[32, 40], 0.8 * distance[32, 40])
    assert np.asarray(result.surface.range)[32, 41] < distance[32, 41]


def test_albedo_and_known_range_set_the_scale(tilted):
    camera, _, image, mask = tilted
    plain = reconstruct(image, camera)
    larger = reconstruct(image, camera, albedo=9.0)
    np.testing.assert_allclose(larger.surface.range[mask], 3 * plain.surface.range[mask], rtol=1e-6)
    known = scaled_to(plain, (30, 20), 25.0)
    assert np.isclose(known.surface.range[20, 30], 25.0)
    again = reconstruct(image, camera, albedo=known.albedo)
    np.testing.assert_allclose(again.surface.range[mask], known.surface.range[mask], rtol=1e-6)


def test_exposure_and_unit_do_not_change_the_shape(tilted):
    camera, _, image, mask = tilted
    dark = Irradiance(image.values * 1e-7, image.valid)
    ratio = reconstruct(dark, camera).surface.range / reconstruct(image, camera).surface.range
    np.testing.assert_allclose(ratio[mask], 1e-7**-0.5, rtol=1e-6)


def bumps(size=97):
    """z of a wall with several summits under a distant frontal light, its camera, E = cos θ and the summits."""
    camera = Orthographic(scale=(size - 1) / 2, cx=(size - 1) / 2, cy=(size - 1) / 2, width=size, height=size)
    x, y = np.meshgrid(np.linspace(-1, 1, size), np.linspace(-1, 1, size))
    k = 1.5 * np.pi
    z = -0.15 * np.cos(k * x) * np.cos(k * y) + 0.05 * x
    zx = 0.15 * k * np.sin(k * x) * np.cos(k * y) + 0.05
    zy = 0.15 * k * np.cos(k * x) * np.sin(k * y)
    lower = np.pad(z, 1, constant_values=np.inf)
    neighbours = np.stack([lower[1 + a : size + 1 + a, 1 + b : size + 1 + b] for a in (-1, 0, 1) for b in (-1, 0, 1)])
    v, u = np.nonzero(z <= neighbours.min(axis=0))
    return camera, z, 1 / np.sqrt(1 + zx**2 + zy**2), np.stack([u, v, z[v, u]], axis=-1).astype(float)


@pytest.mark.parametrize("solver", ["sweeping", "level-set"])
def test_distant_light_merges_summits_of_known_height(solver):
    """Kimmel & Bruckstein 1995a from each summit, merged by the pointwise minimum: one surface with many summits."""
    camera, z, cosine, summits = bumps()
    image = Irradiance(jnp.asarray(cosine), jnp.ones(z.shape, bool))
    result = reconstruct(image, camera, light="distant", solver=solver, initial=SummitHeights(jnp.asarray(summits)))
    assert len(summits) > 4
    assert np.mean(np.abs(np.asarray(result.surface.range) - z)) < 0.01 * np.ptp(z)
    assert result.status is Status.GOOD


def test_distant_light_hollow_reading_is_the_mirror_image():
    camera, z, cosine, summits = bumps()
    image = Irradiance(jnp.asarray(cosine), jnp.ones(z.shape, bool))
    mirrored = jnp.asarray(summits * np.array([1, 1, -1]))
    result = reconstruct(image, camera, light="distant", concave=True, initial=SummitHeights(mirrored))
    assert np.mean(np.abs(np.asarray(result.surface.range) + z)) < 0.01 * np.ptp(z)


def test_merging_is_the_minimum_of_the_single_solutions():
    camera, z, cosine, summits = bumps()
    image = Irradiance(jnp.asarray(cosine), jnp.ones(z.shape, bool))

    def solve(points):
        start = SummitHeights(jnp.asarray(points))
        return np.asarray(reconstruct(image, camera, light="distant", order=1, initial=start).surface.range)

    merged = np.minimum.reduce([solve(summits[i : i + 1]) for i in range(len(summits))])
    # where two fronts meet, an update may read one neighbour of each
    difference = np.abs(solve(summits) - merged)
    assert difference.mean() < 1e-3 * np.ptp(z)
    assert difference.max() < 0.02 * np.ptp(z)


def test_sphere_of_constant_range_is_a_flat_image():
    """All-white image: every pixel faces the light at the same range. A legal, if unlikely, surface."""
    camera, _, _, mask = scene("plane", SIZE)
    result = reconstruct(Irradiance(jnp.full((SIZE, SIZE), 0.25), jnp.asarray(mask)), camera)
    np.testing.assert_allclose(result.surface.range[mask], 2.0, rtol=1e-9)


def test_noise_is_told_from_surface():
    camera, _, _, mask = scene("plane", SIZE)
    noise = np.random.default_rng(3).uniform(0.01, 1, (SIZE, SIZE))
    result = reconstruct(Irradiance(jnp.asarray(noise), jnp.asarray(mask)), camera)
    assert not result.status.trustworthy
    assert "--smooth" in result.status.value or "residual" in result.status.value


def test_one_valid_pixel_is_no_surface():
    camera, _, _, mask = scene("plane", SIZE)
    single = np.zeros_like(mask)
    single[30, 30] = True
    result = reconstruct(Irradiance(jnp.ones((SIZE, SIZE)), jnp.asarray(single)), camera)
    assert result.status is Status.FEW_PIXELS


def test_nan_and_negative_values_are_left_out(tilted):
    camera, distance, image, mask = tilted
    values = image.values.at[10, 30].set(jnp.nan).at[40, 40].set(-1.0).at[41, 40].set(jnp.inf)
    result = reconstruct(Irradiance(values, image.valid), camera)
    assert not np.asarray(result.surface.valid)[[10, 40, 41], [30, 40, 40]].any()
    assert error(result, distance, mask & np.asarray(result.surface.valid)) < 4e-3


BAD = {
    "other size": ({"camera": Perspective(fx=50.0, fy=50.0, cx=9.0, cy=9.0, width=20, height=20)}, "65 x 65 px"),
    "empty mask": ({"valid": False}, "no pixel is valid"),
    "distant light, central camera": ({"light": "distant"}, "do not go together"),
    "unknown light": ({"light": "lamp"}, "light"),
    "unknown solver": ({"solver": "magic"}, "solver"),
    "threshold too high": ({"initial": Threshold(1e6)}, "choose a lower threshold"),
    "point outside": ({"initial": SingularPoint((70, 3))}, "outside the image of 65 x 65 px"),
    "point masked": ({"initial": SingularPoint((0, 0))}, "without data"),
    "impossible range": ({"initial": SingularPoint((30, 30), 50.0)}, "largest range that the brightness there allows"),
    "negative range": ({"initial": SingularPoint((30, 30), -1.0)}, "must be positive"),
    "curve off the mask": ({"initial": Curve(jnp.zeros((SIZE, SIZE), bool), 1.0)}, "no pixel in the valid part"),
    "curve of other size": ({"initial": Curve(jnp.ones((3, 3), bool), 1.0)}, "curve's mask has shape"),
    "hollow near light": ({"concave": True}, "choice for a distant light"),
    "heights near light": ({"initial": SummitHeights(jnp.zeros((0, 3)))}, "at least one row"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named(case, tilted):
    change, message = BAD[case]
    camera, _, image, _ = tilted
    options = dict(change)
    camera = options.pop("camera", camera)
    image = Irradiance(image.values, image.valid & options.pop("valid", True))
    with pytest.raises(Exception, match=message) as caught:
        reconstruct(image, camera, **options)
    # an annotation may catch a wrong literal first when the tests check annotations
    assert isinstance(caught.value, ValueError) or case in ("unknown light", "unknown solver")


def test_scaling_needs_a_surface_and_a_positive_range(tilted):
    camera, _, image, _ = tilted
    result = reconstruct(image, camera)
    for pixel, distance, message in [
        ((0, 0), 3.0, "no surface"),
        ((99, 3), 3.0, "no surface"),
        ((30, 30), 0.0, "positive"),
    ]:
        with pytest.raises(ValueError, match=message):
            scaled_to(result, pixel, distance)
