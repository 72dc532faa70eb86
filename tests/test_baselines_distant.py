"""The methods for a distant light that the paper names, each on a picture that meets its assumptions."""

import importlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

FOLDER = Path(__file__).parents[1] / "experiments"
FRONTAL, OBLIQUE = (0.0, 0.0, 1.0), (1.0, 0.0, 1.0)


@pytest.fixture
def methods(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    names = ("conjugate_gradient", "distant", "energy", "horn", "ikeuchi_horn", "isophotes", "lagrangian", "lai_vemuri")
    names += ("lee_rosenfeld", "merging", "pentland", "strips", "szeliski", "tsai_shah", "zheng_chellappa")
    modules = {name: importlib.import_module(f"baselines.{name}") for name in names}
    return SimpleNamespace(distant_scenes=importlib.import_module("distant_scenes"), **modules)


def height_error(scene, relief) -> float:
    """Mean |ΔZ| after the best shift, relative to the scene's depth."""
    known = scene.mask & np.isfinite(relief.height)
    gap = (relief.height - scene.height)[known]
    return float(np.abs(gap - np.median(gap)).mean() / scene.depth())


def rim_slopes(scene):
    return tuple(np.where(scene.rim(), slope, np.nan) for slope in (scene.p, scene.q))


def test_scenes_slopes_are_the_derivatives_of_their_heights(methods):
    for name in methods.distant_scenes.FORMULAS:
        scene = methods.distant_scenes.distant_scene(name, 201)
        inner = scene.mask & ~scene.rim() & (np.hypot(scene.p, scene.q) < 2)
        q, p = np.gradient(scene.height, scene.spacing)
        assert np.abs(p - scene.p)[inner].max() < 0.06, name
        assert np.abs(q - scene.q)[inner].max() < 0.06, name


def test_integration_returns_a_surface_from_its_slopes(methods):
    scene = methods.distant_scenes.distant_scene("peaks", 65)
    grid = methods.distant.Grid(scene.mask, scene.spacing)
    z = grid.image(grid.integrate(grid.vector(scene.p), grid.vector(scene.q)))
    assert height_error(scene, methods.distant.Relief(z, scene.p, scene.q)) < 5e-4


@pytest.mark.parametrize("light", [FRONTAL, OBLIQUE])
def test_local_methods_are_right_on_a_sphere(methods, light):
    scene = methods.distant_scenes.distant_scene("sphere", 129)
    lit = scene.mask & (scene.image(light).values > 0.2) & (np.hypot(scene.p, scene.q) < 1.5)
    for method in (methods.pentland.local, methods.lee_rosenfeld.reconstruct):
        found = method(scene.image(light))
        assert np.median(np.hypot(found.p - scene.p, found.q - scene.q)[lit]) < 0.02


def test_linear_method_is_right_on_a_shallow_surface(methods):
    scene = methods.distant_scenes.distant_scene("peaks", 65)
    shallow = scene._replace(height=0.02 * scene.height, p=0.02 * scene.p, q=0.02 * scene.q)
    found = methods.pentland.linear(shallow.image(OBLIQUE))
    assert np.corrcoef(found.p[scene.mask], scene.p[scene.mask])[0, 1] > 0.95
    with pytest.raises(ValueError, match="oblique"):
        methods.pentland.linear(scene.image(FRONTAL))


def test_tsai_shah_s_first_step_solves_for_a_height_beside_flat_neighbours(methods):
    """With both neighbours at 0, p = q = Z: R(Z, Z) = E is what Newton's step linearises."""
    scene = methods.distant_scenes.distant_scene("peaks", 65)
    shallow = scene._replace(p=0.2 * scene.p, q=0.2 * scene.q)
    image = shallow.image(OBLIQUE)
    z = methods.tsai_shah.reconstruct(image, iterations=1).height / image.spacing
    explained = methods.distant.reflectance(z, z, image.light)
    assert np.abs(explained - image.values).mean() < 0.15 * np.abs(image.light[2] - image.values).mean()


def test_curve_expansion_follows_a_cap_and_crosses_itself_between_peaks(methods):
    sphere = methods.distant_scenes.distant_scene("sphere", 65)
    image, (top,) = sphere.image(FRONTAL), sphere.summits()
    chain = methods.lagrangian.expand(image, top[:2], 0.5 * sphere.depth(), steps=100)
    assert height_error(sphere, methods.lagrangian.heights(image, chain, top[2])) < 5e-3
    assert methods.lagrangian.self_intersections(chain.curves[-1]) == 0

    peaks = methods.distant_scenes.distant_scene("peaks", 65)
    chain = methods.lagrangian.expand(peaks.image(FRONTAL), peaks.summits()[0, :2], peaks.depth(), steps=200)
    assert methods.lagrangian.self_intersections(chain.curves[0]) == 0
    assert max(methods.lagrangian.self_intersections(curve) for curve in chain.curves) > 0
    with pytest.raises(ValueError, match="viewing direction"):
        methods.lagrangian.expand(peaks.image(OBLIQUE), (32, 32), 0.1)


def test_self_intersections_of_a_bow_and_a_square(methods):
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    assert methods.lagrangian.self_intersections(square) == 0
    assert methods.lagrangian.self_intersections(square[[0, 2, 1, 3]]) == 1


@pytest.mark.parametrize("light", [FRONTAL, OBLIQUE])
def test_isophotes_give_the_curvature_at_a_singular_point(methods, light):
    scene = methods.distant_scenes.distant_scene("sphere", 129)
    image = scene.image(light)
    (point,) = methods.isophotes.singular_points(image)
    hessian, (x, y) = methods.isophotes.hessian_of_height(image, point)
    # on the sphere of radius R the slope is that of the light, and Z's Hessian −(I + p pᵀ)/(R n_z)
    slope = -np.asarray(image.light[:2]) / image.light[2]
    expected = -(np.eye(2) + np.outer(slope, slope)) / (0.45 * image.light[2])
    np.testing.assert_allclose(hessian, expected, rtol=0.05, atol=0.05)
    np.testing.assert_allclose([x, y], 64 + 0.45 * 128 * np.asarray(image.light[:2]), atol=0.3)


@pytest.mark.parametrize("light", [FRONTAL, OBLIQUE])
def test_strips_climb_down_a_sphere(methods, light):
    scene = methods.distant_scenes.distant_scene("sphere", 65)
    found = methods.strips.reconstruct(scene.image(light))
    assert np.isfinite(found.height[scene.mask]).mean() > 0.85
    assert height_error(scene, found) < 5e-3


@pytest.mark.parametrize(
    ("solver", "order", "bound"), [pytest.param("level-set", 1, 0.02, marks=pytest.mark.slow), ("level-set", 2, 0.01)]
)
def test_level_set_from_known_summits_is_within_two_per_cent_of_the_vase_s_depth(methods, solver, order, bound):
    scene = methods.distant_scenes.distant_scene("vase", 65)
    found = methods.merging.from_known_heights(scene.image(FRONTAL), scene.summits(), solver, order)
    assert np.isfinite(found.height[scene.mask]).all()
    assert height_error(scene, found) < bound


def test_what_merging_adds(methods):
    scene = methods.distant_scenes.distant_scene("vase", 65)
    image, summits = scene.image(FRONTAL), scene.summits()
    one = height_error(scene, methods.merging.from_one(image, summits[0], "sweeping"))
    from_saddles = height_error(scene, methods.merging.from_saddles(image, summits[:, :2]))
    known = height_error(scene, methods.merging.from_known_heights(image, summits, "sweeping"))
    assert one > 0.1
    assert max(from_saddles, known) < 0.01


def test_optimisation_with_known_rim_finds_a_sphere(methods):
    scene = methods.distant_scenes.distant_scene("sphere", 33)
    image = scene.image(FRONTAL)
    for method in (methods.ikeuchi_horn, methods.horn, methods.szeliski, methods.lai_vemuri):
        assert height_error(scene, method.reconstruct(image, *rim_slopes(scene))) < 0.04, method.__name__


def test_energy_s_gradient_is_that_of_its_value(methods):
    scene = methods.distant_scenes.distant_scene("sphere", 17)
    energy = methods.energy.Energy(scene.image(OBLIQUE), *rim_slopes(scene))
    rng = np.random.default_rng(0)
    x = methods.energy.Unknowns(*(part + 0.1 * rng.standard_normal(part.shape) for part in energy.start()))
    gradient = energy.gradient(x, 1e-3, 0.1)
    for index, part in enumerate(gradient):
        d = [np.zeros_like(one) for one in x]
        d[index] = rng.standard_normal(part.shape) * (energy.free if index < 2 else 1)
        ends = [
            energy.value(methods.energy.Unknowns(*(a + h * b for a, b in zip(x, d, strict=True))), 1e-3, 0.1)
            for h in (1e-6, -1e-6)
        ]
        assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(2 * float(part @ d[index]), rel=1e-4)


def test_hierarchical_basis_is_its_own_adjoint_s_adjoint_and_haar_is_orthonormal(methods):
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 17, 17))
    szeliski, haar = methods.szeliski, methods.lai_vemuri
    assert np.sum(szeliski.synthesis(a) * b) == pytest.approx(np.sum(a * szeliski.analysis(b)))
    tent = np.zeros((17, 17))
    tent[8, 8] = 1
    assert szeliski.synthesis(tent)[4, 8] == pytest.approx(0.5)
    np.testing.assert_allclose(haar.haar_inverse(haar.haar(a[:16, :16])), a[:16, :16], atol=1e-12)
    assert np.linalg.norm(haar.haar(a[:16, :16])) == pytest.approx(np.linalg.norm(a[:16, :16]))


def test_preconditioners_speed_conjugate_gradients_up(methods):
    """Energy left after the same number of steps, from the same start."""
    scene = methods.distant_scenes.distant_scene("sphere", 65)
    energy = methods.energy.Energy(scene.image(FRONTAL), *rim_slopes(scene))
    left = {}
    for name in ("none", "szeliski", "lai_vemuri"):
        x = energy.start()
        module = getattr(methods, name, None)
        precondition = (lambda g: g) if module is None else module.preconditioner(energy, 1e-4, 0.1, x)
        history: list[float] = []
        methods.conjugate_gradient.minimise(
            energy, x, precondition, smooth=1e-4, integrable=0.1, iterations=30, history=history
        )
        assert history == sorted(history, reverse=True)
        left[name] = history[-1]
    assert left["szeliski"] < left["none"]
    assert left["lai_vemuri"] < left["none"]


def test_zheng_chellappa_improves_on_its_start(methods):
    scene = methods.distant_scenes.distant_scene("ripples", 65)
    image = scene.image(OBLIQUE)
    flat = methods.distant.Relief(*np.zeros((3, 65, 65)))
    found = methods.zheng_chellappa.reconstruct(image)
    assert height_error(scene, found) < 0.9 * height_error(scene, flat)
    assert np.hypot(found.p - scene.p, found.q - scene.q).mean() < 0.7 * np.hypot(scene.p, scene.q).mean()
