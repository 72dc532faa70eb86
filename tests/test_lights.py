"""Lights beside the lens: the forward model, against closed forms and the plain model, and its file."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth import HollowBall, Plane, default_camera, observe
from jaxsfs.camera import Orthographic
from jaxsfs.files import InputError, read_lights, write_json
from jaxsfs.lights import Light, Lights, lights_from_dict, lights_to_dict, reflected, shade_lights
from jaxsfs.photometry import CosineExponentialFalloff, CosineFalloff, ExponentialFalloff, NoFalloff
from jaxsfs.reflectance import Lambertian, OrenNayar, Power
from jaxsfs.rendering import render, render_lights
from jaxsfs.surface import Surface

AT_LENS = Lights((Light((0.0, 0.0, 0.0)),))


def view(scene, size=32, half_field=60.0):
    return observe(scene, default_camera(scene, size, size, half_field), half_field_deg=half_field)


@pytest.mark.parametrize("reflectance", [Lambertian(), Power(0.65), Power(2.0)], ids=str)
def test_a_light_at_the_lens_is_the_plain_model(reflectance):
    seen = observe(HollowBall(), default_camera(HollowBall(), 32, 32, 60.0), reflectance=reflectance, albedo=3.0)
    got = shade_lights(seen.surface.points(), seen.normals, AT_LENS, reflectance=reflectance, albedo=3.0)
    valid = np.asarray(seen.surface.valid)
    np.testing.assert_allclose(np.asarray(got)[valid], np.asarray(seen.irradiance.values)[valid], rtol=1e-12)
    plain, lit = (
        render(seen.surface, reflectance=reflectance),
        render_lights(seen.surface, AT_LENS, reflectance=reflectance),
    )
    np.testing.assert_allclose(lit.values, plain.values, rtol=1e-12)


def test_plane_below_one_guide_has_its_closed_form():
    """n·(l − x) = h for a guide in the plane of the lens: E = p h/|l − x|³, brightest right in front of the guide."""
    seen = view(Plane(20.0))
    points = np.asarray(seen.surface.points())
    got = shade_lights(jnp.asarray(points), seen.normals, Lights((Light((3.5, 0.0, 0.0)),)))
    distance = np.linalg.norm(points - [3.5, 0, 0], axis=-1)
    np.testing.assert_allclose(got, 20.0 / distance**3, rtol=1e-12)


def test_powers_are_relative_and_lights_add_up():
    seen = view(Plane(10.0))
    points, normals = seen.surface.points(), seen.normals
    left, right = Light((-3.0, 0.0, 0.0), 1.0), Light((3.0, 0.0, 0.5), 3.0)
    both = shade_lights(points, normals, Lights((left, right)))
    apart = [shade_lights(points, normals, Lights((one,))) for one in (left, right)]
    np.testing.assert_allclose(both, 0.25 * apart[0] + 0.75 * apart[1], rtol=1e-12)


def test_spread_is_about_the_lights_own_direction():
    points, normals = jnp.asarray([[0.0, 0.0, 2.0], [2.0, 0.0, 2.0]]), jnp.asarray([[0.0, 0.0, -1.0]] * 2)
    plain = shade_lights(points, normals, AT_LENS)
    ahead = shade_lights(points, normals, Lights((Light((0.0, 0.0, 0.0), spread=CosineFalloff(2.0)),)))
    np.testing.assert_allclose(ahead / plain, [1.0, 0.5], rtol=1e-12)
    tilted = Lights((Light((0.0, 0.0, 0.0), direction=(5.0, 0.0, 5.0), spread=CosineFalloff(2.0)),))
    np.testing.assert_allclose(shade_lights(points, normals, tilted) / plain, [0.5, 1.0], rtol=1e-12)


def test_what_faces_away_from_all_lights_is_dark():
    """A slanted element that the lens sees and a guide beside it does not."""
    normal = jnp.asarray([[-math.sqrt(1 - 0.1**2), 0.0, -0.1]])
    point = jnp.asarray([[0.5, 0.0, 3.0]])
    assert shade_lights(point, normal, AT_LENS)[0] > 0
    assert shade_lights(point, normal, Lights((Light((3.5, 0.0, 0.0)),)))[0] == 0


def test_minnaert_is_reciprocal():
    """BRDF = G(θ_i, θ_e)/cos θ_i does not change when light and eye change places."""
    one, other = jnp.asarray([0.9, 0.3]), jnp.asarray([0.4, 0.8])
    brdf = reflected(Power(0.65), one, other) / one
    np.testing.assert_allclose(brdf, reflected(Power(0.65), other, one) / other, rtol=1e-12)


def test_rendering_differences_agree_with_exact_normals():
    lights = Lights((Light((3.5, 0.0, 0.0)), Light((-3.5, 1.0, 0.0), 2.0, spread=CosineFalloff(1.0))))
    errors = []
    for size in (48, 96):
        seen = view(HollowBall(22.0, 1.5, -1.0, -8.0), size)
        exact = shade_lights(seen.surface.points(), seen.normals, lights, albedo=2.0)
        drawn = render_lights(seen.surface, lights, albedo=2.0)
        errors.append(float(jnp.mean(jnp.abs(drawn.values / exact - 1), where=drawn.valid)))
    assert errors[1] < 1e-4
    assert 1.75 < math.log2(errors[0] / errors[1]) < 2.25


def test_gradients_reach_positions():
    seen = view(Plane(10.0), 16)

    def total(x):
        return jnp.sum(shade_lights(seen.surface.points(), seen.normals, Lights((Light((x, 0.0, 0.0)),))))

    numeric = (total(2.0 + 1e-5) - total(2.0 - 1e-5)) / 2e-5
    np.testing.assert_allclose(jax.grad(total)(2.0), numeric, rtol=1e-6)


def test_refusals():
    with pytest.raises(ValueError, match="only known for a light at the lens"):
        render_lights(view(Plane()).surface, AT_LENS, reflectance=OrenNayar(0.3))
    flat = Orthographic(scale=4.0, cx=3.5, cy=3.5, width=8, height=8)
    with pytest.raises(ValueError, match="central camera, got Orthographic"):
        render_lights(Surface(flat, jnp.ones((8, 8)), jnp.ones((8, 8), bool)), AT_LENS)
    with pytest.raises(ValueError, match="at least one light"):
        Lights(())
    with pytest.raises(ValueError, match="power must be positive"):
        Light((0.0, 0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match="direction must not be"):
        Light((0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="finite"):
        Light((float("nan"), 0.0, 0.0))


def test_file_round_trip(tmp_path):
    lights = Lights(
        (
            Light((3.5, 0.0, -0.5), 2.0, (0.1, 0.0, 1.0), CosineFalloff(1.5)),
            Light((-3.5, 0.25, 0.0), spread=ExponentialFalloff(2.77)),
            Light((0.0, -3.0, 0.0), spread=CosineExponentialFalloff(-0.5, 2.5)),
            Light((0.0, 3.0, 0.0), spread=NoFalloff()),
        )
    )
    write_json(tmp_path / "lights.json", lights_to_dict(lights))
    assert read_lights(tmp_path / "lights.json") == lights


BAD = [
    ({"lights": [{"position": [0, 0, 0]}]}, "'unit' must be"),
    ({"unit": "cm", "lights": [{"position": [0, 0, 0]}]}, "got 'cm'"),
    ({"unit": "mm"}, "at least one light, got None"),
    ({"unit": "mm", "lights": []}, "at least one light"),
    ({"unit": "mm", "lights": [3]}, r"lights\[0\] must be an object"),
    ({"unit": "mm", "lights": [{"power": 1}]}, r"lights\[0\] lacks its 'position'"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0]}, {"position": [1, 2]}]}, r"lights\[1\].*three numbers"),
    ({"unit": "mm", "lights": [{"position": [0, "a", 0]}]}, "finite numbers, got 'a'"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0], "power": -1}]}, r"lights\[0\].*positive"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0], "power": True}]}, "got True"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0], "spread": "cone:3"}]}, "cone:3"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0], "spread": 1}]}, "text such as"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0], "postion": 1}]}, "has no 'postion'"),
    ({"unit": "mm", "lights": [{"position": [0, 0, 0], "direction": [0, 0, 0]}]}, "must not be"),
]


@pytest.mark.parametrize(("description", "message"), BAD, ids=range(len(BAD)))
def test_bad_descriptions_say_what_is_wrong(description, message):
    with pytest.raises(ValueError, match=message):
        lights_from_dict(description)


def test_bad_file_is_named(tmp_path):
    write_json(tmp_path / "bad.json", {"unit": "mm", "lights": []})
    with pytest.raises(InputError, match=r"bad\.json: 'lights' must be a list"):
        read_lights(tmp_path / "bad.json")
