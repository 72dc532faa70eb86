"""`jaxsfs evaluate`: errors of a range or depth map against the truth."""

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import jax_session

if TYPE_CHECKING:
    import numpy as np

    from jaxsfs.camera import AbstractCamera

Quantity = Literal["range", "depth"]
_QUANTITIES: tuple[Quantity, ...] = ("range", "depth")


@dataclasses.dataclass(frozen=True)
class EvaluateOptions:
    # Folder that reconstruct or render wrote, or a map: TIFF, NPY, or PNG with its scale.
    predicted: Annotated[Positional[Path], value("PREDICTED")]
    # The same kinds.
    truth: Annotated[Positional[Path], value("TRUTH")]
    # median: one factor makes the medians agree, for a surface of unknown scale; none: lengths as they are.
    align: Literal["median", "none"] = "median"
    # What is compared, and what a map holds unless it is called range.* or depth.*: range (along the ray) or
    # depth (along the optical axis). A camera converts.
    quantity: Quantity = "range"
    # Camera file of this image size; adds the errors of the normals.
    camera: Annotated[Path | None, value("FILE", default="none")] = None
    # Length per stored unit of a truth file.
    truth_scale: Annotated[float | None, value("S", default="none")] = None
    # Print JSON instead of a table.
    json: bool = False


def evaluate(options: Annotated[EvaluateOptions, FLAT]) -> int:
    """How far a reconstructed surface lies from the true one.

    For example:
      jaxsfs render wavy-wall --out view
      jaxsfs reconstruct view/image.png --camera view/camera.json --out result
      jaxsfs evaluate result view --align none --camera view/camera.json
    """
    with jax_session(64):
        record = _measured(options)
    print(json.dumps(record, indent=2, sort_keys=True) if options.json else _table(record))
    return 0


def _measured(options: EvaluateOptions) -> dict[str, Any]:
    from jaxsfs import evaluation, files

    predicted_path, predicted_quantity = _map_in(options.predicted, options.quantity)
    truth_path, truth_quantity = _map_in(options.truth, options.quantity)
    camera = None if options.camera is None else files.read_camera(options.camera).camera
    result = evaluation.evaluate(
        files.read_map(predicted_path),
        files.read_map(truth_path, options.truth_scale),
        quantity=options.quantity,
        predicted_quantity=predicted_quantity,
        truth_quantity=truth_quantity,
        align=options.align,
        camera=camera,
        truth_normals=_true_normals(options.truth, camera),
    )
    return {"predicted": str(predicted_path), "truth": str(truth_path)} | result.as_dict()


def _map_in(path: Path, quantity: Quantity) -> tuple[Path, Quantity]:
    """The file of a folder or path, and what it holds: as its name says, else the quantity to be compared."""
    from jaxsfs.files import InputError

    if path.is_dir():
        # rather what is asked for than what must be converted
        for held in sorted(_QUANTITIES, key=lambda held: held != quantity):
            if (path / f"{held}.tiff").is_file():
                return path / f"{held}.tiff", held
        raise InputError(f"{path} has neither range.tiff nor depth.tiff; give a folder of results or a map")
    for held in _QUANTITIES:
        if path.stem.lower() == held:
            return path, held
    return path, quantity


def _true_normals(truth: Path, camera: "AbstractCamera | None") -> "np.ndarray | None":
    """The exact normals of a rendered view, which has a scene.json; a reconstruction's are differenced again."""
    path = truth / "normals.tiff"
    if camera is None or not (truth / "scene.json").is_file() or not path.is_file():
        return None
    import tifffile

    from jaxsfs.files import InputError

    try:
        normals = tifffile.imread(path)
    except Exception as error:  # tifffile has no common class for what damaged files raise
        raise InputError(f"cannot read {path}: {error}") from None
    if normals.ndim != 3 or normals.shape[2] != 3:
        raise InputError(f"{path} holds an array of shape {normals.shape}; expected normals (height, width, 3)")
    return normals


def _table(record: dict[str, Any]) -> str:
    aligned = f"median, prediction times {record['scale']:.6g}" if record["align"] == "median" else "none"
    rows = [
        ("predicted", record["predicted"]),
        ("truth", record["truth"]),
        ("quantity", record["quantity"]),
        ("alignment", aligned),
        ("pixels", f"{record['pixels']}, {record['fraction']:.1%} of those with a truth"),
        *((name, f"{record[name]:.5g}") for name in ("abs_rel", "median_rel", "p95_rel", "sq_rel", "rmse", "rmse_log")),
        *((f"delta < {k}", f"{record['delta_' + k.replace('.', '_')]:.2%}") for k in ("1.05", "1.10", "1.25")),
    ]
    normals = record["normals"]
    if normals is not None:
        rows += [
            ("normals", f"mean {normals['mean_deg']:.3g}°, median {normals['median_deg']:.3g}°"),
            *((f"normals < {k}°", f"{normals['share_below_' + k.replace('.', '_') + '_deg']:.2%}") for k in _ANGLES),
        ]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)


_ANGLES = ("11.25", "22.5", "30")
