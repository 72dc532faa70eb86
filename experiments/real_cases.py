"""Real and rendered endoscopic photographs with what is known of their scenes, as they lie beside the project."""

import dataclasses
import re
from pathlib import Path

import cv2
import jax
import jax.numpy as jnp
import numpy as np

from jaxsfs import AbstractCamera, Perspective, find_field, read_image, read_map, read_mask

SINUS, SIMCOL = "sinus_endoscope", "simcol3d"
SINUS_FRAMES, SIMCOL_FRAMES = (4584, 4600), ("0000", "0004")
# fx, fy, cx, cy: the data set's own script, and what others use.
SIMCOL_CAMERAS = {"A": (227.6, 237.5, 227.6, 237.5), "B": (227.60416, 227.60416, 237.5, 237.5)}
SIMCOL_CM = 20 / 255 / 256  # depth per stored step


@dataclasses.dataclass(frozen=True)
class Case:
    """A photograph with what is known of its scene: depth at every pixel, or points in the camera frame.

    `shrink`: how many pixels of the original make one here.
    """

    name: str
    photo: np.ndarray
    mask: np.ndarray
    camera: AbstractCamera
    dtype: str
    shrink: int
    depth: np.ndarray | None = None
    points: np.ndarray | None = None

    def pixels(self) -> np.ndarray:
        """(u, v) of the pixel nearest to each point."""
        return np.round(np.asarray(jax.vmap(self.camera.project)(jnp.asarray(self.points)))).astype(int)


def cases(data: Path, quick: bool) -> list[Case]:
    """All photographs; `quick`: the sinus at a quarter of its size, the colon at half of it."""
    sinus = [sinus_case(data / SINUS, frame, 4 if quick else 2) for frame in SINUS_FRAMES]
    colon = [
        simcol_case(data / SIMCOL, frame, camera, 2 if quick else 1)
        for frame in SIMCOL_FRAMES
        for camera in SIMCOL_CAMERAS
    ]
    return sinus + colon


def sinus_case(folder: Path, frame: int, shrink: int) -> Case:
    """An endoscopic frame with the points it sees, cut to what its mask and the scope's round field have in common
    (the data's mask also covers some of the black border)."""
    photo = read_image(folder / f"{frame:08d}.jpg")
    mask = read_mask(folder / "undistorted_mask.jpg") & find_field(photo.values).mask
    fx, fy, cx, cy = (float(x) for x in (folder / "camera_intrinsics_per_view").read_text().split())
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    # whole blocks of shrink × shrink px
    wide, high = ((int(last) - first + 1) // shrink * shrink for first, last in ((left, columns[-1]), (top, rows[-1])))
    cut = np.s_[top : top + high, left : left + wide]
    camera = Perspective(fx, fy, cx, cy, width, height).cropped(left, top, wide, high)
    return Case(
        name=f"sinus {frame}",
        photo=_shrunk(photo.values[cut], shrink),
        mask=_shrunk(mask[cut].astype(np.float32), shrink) > 0.99,
        camera=camera.resized(wide // shrink, high // shrink),
        dtype=photo.dtype,
        shrink=shrink,
        points=structure_points(folder, frame).astype(np.float32),
    )


def structure_points(folder: Path, frame: int) -> np.ndarray:
    """Points (n, 3) that structure from motion saw in `frame`, in its camera frame.

    motion.yaml has the camera's position t and orientation R (a quaternion) in the world, for the frames of
    selected_indexes in turn: X_camera = Rᵀ (X_world − t). view_indexes_per_point has a −1 before each point's frames.
    """
    order = [int(word) for word in (folder / "selected_indexes").read_text().split()]
    numbers = re.findall(r"^\s+[xyzw]: (\S+)", (folder / "motion.yaml").read_text(), re.MULTILINE)
    poses = np.array(numbers, float).reshape(-1, 7)
    if len(poses) != len(order):
        raise ValueError(f"motion.yaml has {len(poses)} poses for {len(order)} frames of selected_indexes")
    position, (x, y, z, w) = np.split(poses[order.index(frame)], [3])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    header, _, rows = (folder / "structure.ply").read_text().partition("end_header\n")
    count = int(re.search(r"element vertex (\d+)", header)[1])
    world = np.array([line.split() for line in rows.splitlines()[:count]], float)
    seen_by = (folder / "view_indexes_per_point").read_text().split("-1")[1:]
    if len(seen_by) != count:
        raise ValueError(f"view_indexes_per_point has {len(seen_by)} points, structure.ply {count}")
    visible = [str(frame) in frames.split() for frames in seen_by]
    return ((world - position) @ rotation)[visible]


def simcol_case(folder: Path, frame: str, camera: str, shrink: int) -> Case:
    """A rendered colonoscopy frame with its depth; `camera`: a reading of SIMCOL_CAMERAS."""
    photo = read_image(folder / f"FrameBuffer_{frame}.png")
    depth = read_map(folder / f"Depth_{frame}.png", scale=SIMCOL_CM)
    height, width = photo.valid.shape
    wide, high = width // shrink, height // shrink
    cut = np.s_[: high * shrink, : wide * shrink]
    whole = Perspective(*SIMCOL_CAMERAS[camera], width, height).cropped(0, 0, wide * shrink, high * shrink)
    return Case(
        name=f"simcol {frame} {camera}",
        photo=_shrunk(photo.values[cut], shrink),
        mask=np.ones((high, wide), bool),
        camera=whole.resized(wide, high),
        dtype=photo.dtype,
        shrink=shrink,
        # a mean of depths across an occlusion is the depth of nothing
        depth=depth[cut][shrink // 2 :: shrink, shrink // 2 :: shrink],
    )


def _shrunk(image: np.ndarray, shrink: int) -> np.ndarray:
    height, width = image.shape[:2]
    return cv2.resize(image, (width // shrink, height // shrink), interpolation=cv2.INTER_AREA)
