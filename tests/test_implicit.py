"""Derivatives of the solution: both modes against central differences, under jit, vmap, and through `reconstruct`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from analytic import ball, plane, waves

from jaxsfs import (
    BlinnPhong,
    CosineFalloff,
    Curve,
    GammaResponse,
    Irradiance,
    KannalaBrandt,
    Lambertian,
    OrenNayar,
    Orthographic,
    Perspective,
    Power,
    Spherical,
    irradiance_of,
    log_range,
    reconstruct,
    scaled_to,
)

HEIGHT, WIDTH = 33, 41
SURFACES = {"plane": lambda d: plane(d, 15.0), "ball": ball, "waves": lambda d: waves(d, 0.03, 9.0)}


def view(surface, camera, reflectance=Lambertian()):  # noqa: B008
    """Irradiance and mask of a surface, the mask an ellipse with a bite taken out."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    mask = np.hypot((u - 20) / 20, (v - 16) / 16) <= 1
    mask[20:24, 30:] = False
    distance, cosine = SURFACES[surface](np.asarray(camera.rays()))
    values = np.where(mask, np.asarray(reflectance(jnp.asarray(cosine))) / distance**2, 1.0)
    return jnp.asarray(values), jnp.asarray(mask)


def weights(mask):
    chosen = np.random.default_rng(0).uniform(0.5, 1.5, mask.shape) * np.asarray(mask)
    return jnp.asarray(chosen / chosen.sum())


def wave(mask):
    v, u = np.mgrid[: mask.shape[0], : mask.shape[1]]
    return jnp.asarray(np.sin(u / 8 + 1) * np.cos(v / 6))


def central_differences(function, q, step=1e-6):
    rows = jnp.eye(q.size, dtype=q.dtype) * step
    return jnp.stack([(function(q + row) - function(q - row)) / (2 * step) for row in rows])


def agree(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max() * 1e-2)


CASES = {
    "sphere, ball": (
        2,
        "ball",
        lambda q: Spherical(27 * q[0], 20.3 + q[1], 15.8, WIDTH, HEIGHT, 1.0, q[2]),
        Lambertian,
    ),
    "first order": (1, "ball", lambda q: Spherical(27 * q[0], 20.3 + q[1], 15.8, WIDTH, HEIGHT, 1.0, q[2]), Lambertian),
    "pinhole, Oren-Nayar": (
        2,
        "plane",
        lambda q: Perspective(22 * q[0], 22 + q[2], 20.3 + q[1], 15.8, WIDTH, HEIGHT),
        lambda: OrenNayar(0.3),
    ),
    "Kannala-Brandt, Blinn-Phong": (
        2,
        "waves",
        lambda q: KannalaBrandt(22 * q[0], 22.0, 20.3 + q[1], 15.8, WIDTH, HEIGHT, (-0.1 + q[2], 0.0, 0.0, 0.0)),
        lambda: BlinnPhong(0.2, 3.0),
    ),
}
FAST = "sphere, ball"


@pytest.mark.parametrize("name", [n if n == FAST else pytest.param(n, marks=pytest.mark.slow) for n in CASES])
def test_both_modes_agree_with_central_differences(name):
    order, surface, camera_of, reflectance_of = CASES[name]
    q0 = jnp.array([1.0, 0.0, 0.01, 1.3, 0.0, 1.0, 0.1])
    values, mask = view(surface, camera_of(q0), reflectance_of())

    def mean(q):
        """Mean of ln r, by camera (3), albedo, irradiance, response's exponent and fall-off."""
        camera = camera_of(q)
        stored = values * (1 + q[4] * wave(mask))
        linear = GammaResponse(q[5]).decode(stored) / CosineFalloff(q[6])(camera.rays()[..., 2])
        found, _ = log_range(
            Irradiance(linear, mask), camera, albedo=q[3], reflectance=reflectance_of(), order=order, tolerance=1e-13
        )
        return jnp.sum(weights(mask) * found)

    value_and_gradient = jax.jit(jax.value_and_grad(mean))  # one program: compiling is most of this test
    gradient = value_and_gradient(q0)[1]
    agree(gradient, central_differences(lambda q: value_and_gradient(q)[0], q0))
    direction = jnp.linspace(0.3, 1, q0.size)
    forward = jax.jit(lambda d: jax.jvp(mean, (q0,), (d,))[1])(direction)
    np.testing.assert_allclose(forward, direction @ gradient, rtol=1e-10)
    assert float(gradient[3]) == pytest.approx(0.5 / 1.3, rel=1e-9)  # r grows with √ρ


@pytest.mark.slow
def test_pixels_without_data_have_no_derivative_and_batches_agree():
    camera = Spherical(27.0, 20.3, 15.8, WIDTH, HEIGHT)
    values, mask = view("ball", camera)
    images = jnp.stack([values, values * (1 + 0.01 * wave(mask))])
    images = images.at[:, 5, 20].set(jnp.nan)

    def total(image):
        found, known = log_range(Irradiance(image, mask), camera, tolerance=1e-13)
        return jnp.sum(weights(mask) * found), known

    batched = jax.jit(jax.vmap(jax.value_and_grad(total, has_aux=True)))
    (_, known), gradient = batched(images)
    assert not bool(known[0, 5, 20])
    assert bool(jnp.all(known[0] == mask.at[5, 20].set(False)))
    assert np.all(np.isfinite(gradient))
    assert float(jnp.abs(jnp.where(known, 0, gradient)).max()) == 0.0
    step = jnp.broadcast_to(1e-6 * wave(mask), images.shape)
    (above, _), _ = batched(images + step)
    (below, _), _ = batched(images - step)
    agree(jnp.sum(jnp.where(known, gradient * step, 0), axis=(1, 2)), (above - below) / 2)


@pytest.mark.slow
def test_gradients_go_through_photograph_and_reconstruction():
    camera = Spherical(27.0, 20.3, 15.8, WIDTH, HEIGHT)
    values, mask = view("ball", camera, Power(0.8))
    stored = np.asarray(values) ** (1 / 2.2)

    def mean(q):
        scope = Spherical(27.0 * q[0], 20.3, 15.8, WIDTH, HEIGHT)
        irradiance, _ = irradiance_of(
            stored,
            scope,
            valid=np.asarray(mask),
            response=GammaResponse(q[1]),
            falloff=CosineFalloff(q[2]),
            clip_limit=None,
            smooth_px=0.7,
        )
        surface = reconstruct(irradiance, scope, albedo=q[3], reflectance=Power(q[4])).surface
        return jnp.sum(weights(mask) * jnp.where(surface.valid, jnp.log(surface.range), 0))

    q0 = jnp.array([1.0, 2.2, 0.1, 1.3, 0.8])
    agree(jax.grad(mean)(q0), central_differences(mean, q0, 1e-5))


@pytest.mark.slow
def test_gradients_by_known_range_and_scale():
    camera = Spherical(27.0, 20.3, 15.8, WIDTH, HEIGHT)
    values, mask = view("ball", camera)
    curve = jnp.zeros_like(mask).at[14:18, 10:12].set(True)

    def mean(q):
        start = Curve(curve, q[0])
        result = reconstruct(Irradiance(values, mask), camera, initial=start)
        surface = scaled_to(result, (25, 16), q[1]).surface
        return jnp.sum(weights(mask) * jnp.where(surface.valid, jnp.log(surface.range), 0))

    nearest = float(reconstruct(Irradiance(values, mask), camera).surface.range[16, 10])
    q0 = jnp.array([0.97 * nearest, 2.0])
    gradient = jax.grad(mean)(q0)
    agree(gradient, central_differences(mean, q0))
    assert float(gradient[1]) == pytest.approx(0.5, rel=1e-9)
    assert abs(float(gradient[0])) > 0.01


@pytest.mark.slow
def test_gradients_of_a_distant_light():
    camera = Orthographic(scale=10.0, cx=20.0, cy=16.0, width=WIDTH, height=HEIGHT)
    x, y = np.moveaxis((np.asarray(camera.pixels()) - [20, 16]) / 10, -1, 0)
    slope = np.hypot(2 * 0.1 * x, 2 * 0.1 * y)
    values, mask = jnp.asarray(1 / np.sqrt(1 + slope**2)), jnp.ones((HEIGHT, WIDTH), bool)

    def mean(q):
        image = Irradiance(values * (1 - q[0] * (2 + wave(mask)) * jnp.asarray(slope)), mask)
        return jnp.sum(weights(mask) * reconstruct(image, camera, albedo=q[1], light="distant").surface.range)

    q0 = jnp.array([0.01, 1.02])
    agree(jax.grad(mean)(q0), central_differences(mean, q0))


def test_derivatives_of_order_3_are_nearly_those_of_its_solution():
    camera = Spherical(27.0, 20.3, 15.8, WIDTH, HEIGHT)
    values, mask = view("ball", camera)

    def mean(strength):
        image = Irradiance(values * (1 + strength * wave(mask)), mask)
        return jnp.sum(weights(mask) * log_range(image, camera, order=3, tolerance=1e-13)[0])

    value_and_gradient = jax.jit(jax.value_and_grad(mean))
    (above, _), (below, _) = (value_and_gradient(strength) for strength in (1e-5, -1e-5))
    assert float(value_and_gradient(0.0)[1]) == pytest.approx(float(above - below) / 2e-5, rel=3e-2)
