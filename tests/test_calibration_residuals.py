"""Residuals of every kind of target: their derivatives, and their first-order meaning in px."""

import numpy as np
import pytest

from jaxsfs.calibration._lens import LENSES, start_lens
from jaxsfs.calibration._problem import Rows, weighted
from jaxsfs.calibration._residuals import look, metric, residuals

POSES = (np.array([0.2, -0.15, 0.1, 1.0, -2.0, np.log(20.0)]), np.array([-0.1, 0.3, 0.4, -1.0, 0.5, np.log(25.0)]))


def case(kind, name="kannala-brandt"):
    """Thirty rows of noise about a plausible picture, and parameters."""
    rng = np.random.default_rng(3)
    rows = Rows(
        pixel=np.array([320.0, 240.0]) + rng.uniform(-180, 180, (30, 2)),
        target=rng.uniform(2, 15, (30, 2)),
        polarity=rng.choice([-1.0, 1.0], 30),
        shift=rng.uniform(0, 0.3, 30),
        group=np.arange(30) % 2,
    )
    lens = start_lens(310.0, 322.0, 243.0)
    lens[3:7] = 0.02, -0.1, 0.004, 0.01
    views = () if kind == "lines" else POSES
    parameters = np.concatenate([lens, [0.3, 0.05], *views])
    return weighted(rows, rng.uniform(0.5, 1.5, 30), LENSES[name].build, kind, 2), parameters


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("kind", ["rings", "points", "lines"])
def test_derivatives_are_those_of_the_residual(kind, name):
    observed, parameters = case(kind, name)
    held = metric(observed, parameters, look(observed, parameters))
    jacobian = residuals(observed, parameters, look(observed, parameters), held)[1]
    for column in range(len(parameters)):
        step = 1e-6 * max(1.0, abs(parameters[column])) * np.eye(len(parameters))[column]
        ahead, behind = (
            residuals(observed, p, look(observed, p), held)[0] for p in (parameters + step, parameters - step)
        )
        np.testing.assert_allclose(jacobian[..., column], (ahead - behind) / (2 * step.max()), rtol=2e-5, atol=1e-4)


@pytest.mark.parametrize("kind", ["rings", "points"])
def test_a_seen_place_moved_by_a_pixel_changes_the_residual_by_a_pixel(kind):
    observed, parameters = case(kind)
    held = metric(observed, parameters, look(observed, parameters))
    value = residuals(observed, parameters, look(observed, parameters), held)[0]
    moves = []
    for axis in np.eye(2):
        moved = weighted(
            Rows(observed.pixel + 1e-4 * axis, observed.target, observed.polarity, observed.shift, observed.group),
            observed.weight,
            LENSES["kannala-brandt"].build,
            kind,
            2,
        )
        moves.append((residuals(moved, parameters, look(moved, parameters), held)[0] - value) / 1e-4)
    if kind == "rings":
        np.testing.assert_allclose(np.hypot(*moves)[:, 0], 1.0, rtol=1e-3)
    else:
        np.testing.assert_allclose(np.stack(moves, axis=2), -np.broadcast_to(np.eye(2), (30, 2, 2)), atol=1e-3)


def test_great_circles_are_straight_and_leave_no_residual():
    lens = start_lens(310.0, 322.0, 243.0)
    ends = np.array([[-0.6, 0.3, 0.7], [0.5, 0.1, 0.8]])
    ray = ends[0] + np.linspace(0, 1, 9)[:, None] * (ends[1] - ends[0])
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    zero = np.zeros(9)
    rows = Rows(lens[1:3] + 310.0 * ray[:, :2], np.zeros((9, 2)), zero, zero, np.zeros(9, int))
    observed, parameters = (
        weighted(rows, np.ones(9), LENSES["spherical"].build, "lines", 1),
        np.append(lens, [0.0, 0.0]),
    )
    seen = look(observed, parameters)
    np.testing.assert_allclose(
        residuals(observed, parameters, seen, metric(observed, parameters, seen))[0], 0, atol=1e-6
    )
