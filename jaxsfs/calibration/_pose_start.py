"""First poses of a flat target from points, by a homography of the rays."""

import cv2
import numpy as np
from jaxtyping import Float

from jaxsfs.calibration._plane import rotation_vector


def start_pose(rays: Float[np.ndarray, "count 3"], target: Float[np.ndarray, "count 2"]) -> Float[np.ndarray, "6"]:
    """(rotation, offset, ln height) of the plane on which `target` (mm) is seen along `rays`."""
    ahead = rays[:, 2] > 0.1
    plane = rays[ahead, :2] / rays[ahead, 2:]
    homography, _ = cv2.findHomography(target[ahead].astype(np.float64), plane.astype(np.float64), 0)
    if homography is None or not np.isfinite(homography).all():
        return np.array([1e-3, 1e-3, 0.0, 0.0, 0.0, np.log(np.ptp(target) + 1e-9)])
    homography = homography / np.sqrt(np.linalg.norm(homography[:, 0]) * np.linalg.norm(homography[:, 1]))
    homography = homography * (np.sign(homography[2, 2]) or 1.0)
    first, second, shift = homography.T
    rough = np.stack([first, second, np.cross(first, second)], axis=1)
    left, _, right = np.linalg.svd(rough)
    rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    foot = rotation.T @ shift
    vector = np.array(rotation_vector(rotation))
    vector[:2] += 1e-3
    return np.concatenate([vector, foot[:2], [np.log(max(foot[2], 1e-6))]])
