"""Arrival times of a given speed against closed forms, and what they refuse."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsfs.arrival import arrival_from_point, arrival_times

SIZE = 65


def pixels():
    grid = np.arange(SIZE) / (SIZE - 1)
    return np.meshgrid(grid, grid)


def point_error(order):
    """Mean error for F = 1 + g·x: T = arcosh(1 + |g|²|x − x_s|²/(2 F F_s))/|g|."""
    x, y = pixels()
    u, v = 20, 30
    speed = 1 + 0.7 * x + 0.4 * y
    square, steepness = (x - x[v, u]) ** 2 + (y - y[v, u]) ** 2, np.hypot(0.7, 0.4)
    truth = np.arccosh(1 + steepness**2 * square / (2 * speed * speed[v, u])) / steepness
    found = arrival_from_point(jnp.asarray(speed), (u, v), spacing=1 / (SIZE - 1), order=order)
    assert bool(found.reached.all())
    return float(np.abs(np.asarray(found.time) - truth).mean())


def test_point_source_is_factored():
    assert point_error(1) < 2e-4
    assert point_error(2) < 4e-6


def curve():
    """(T, F) with T a wavy distance from a circle, F = 1/|∇T|."""
    x, y = pixels()
    dx, dy = x - 0.45, y - 0.55
    radius = np.hypot(dx, dy)
    slope_x = dx / radius + 0.2 * np.cos(4 * x) * np.cos(3 * y)
    slope_y = dy / radius - 0.15 * np.sin(4 * x) * np.sin(3 * y)
    return radius - 0.12 + 0.05 * np.sin(4 * x) * np.cos(3 * y), 1 / np.hypot(slope_x, slope_y)


@pytest.mark.parametrize(("order", "bound"), [(1, 1.5e-3), (2, 2.5e-4)])
def test_initial_curve(order, bound):
    time, speed = curve()
    known = jnp.asarray(np.where(time < 2.5 / (SIZE - 1), time, np.inf))
    found = arrival_times(jnp.asarray(speed), known, spacing=1 / (SIZE - 1), order=order)
    assert np.abs(np.asarray(found.time) - time).mean() < bound
    on = np.isfinite(np.asarray(known))
    np.testing.assert_array_equal(np.asarray(found.time)[on], np.asarray(known)[on])


def test_no_front_passes_where_there_is_no_speed():
    speed = jnp.ones((SIZE, SIZE)).at[:, 40].set(0.0).at[5, 5].set(jnp.nan)
    known = jnp.full((SIZE, SIZE), jnp.inf).at[30, 20].set(0.0)
    for order in (1, 2):
        found = arrival_times(speed, known, order=order)
        reached = np.asarray(found.reached)
        assert not reached[:, 40:].any()
        assert not reached[5, 5]
        assert reached[:, :40].sum() == SIZE * 40 - 1
        assert np.isinf(np.asarray(found.time)[~reached]).all()


def test_what_is_refused():
    speed, known = jnp.ones((5, 6)), jnp.full((5, 6), jnp.inf)
    with pytest.raises(ValueError, match="no arrival time is known"):
        arrival_times(speed, known)
    with pytest.raises(ValueError, match=r"speed has shape \(5, 6\), known times \(6, 5\)"):
        arrival_times(speed, known.T)
    with pytest.raises(ValueError, match="order must be 1 or 2, got 3"):
        arrival_from_point(speed, (0, 0), order=3)
    with pytest.raises(ValueError, match="outside the image of 6 x 5"):
        arrival_from_point(speed, (6, 0))
    with pytest.raises(ValueError, match="where the speed is 0"):
        arrival_from_point(speed.at[1, 2].set(0.0), (2, 1))
