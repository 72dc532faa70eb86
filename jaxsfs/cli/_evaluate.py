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
    from jaxsfs.evaluation import Comparison

Quantity = Literal["range", "depth"]
Align = Literal["median", "scale-ls", "none"]
MetricSet = Literal["all", "c3vd", "simcol"]
_QUANTITIES: tuple[Quantity, ...] = ("range", "depth")


@dataclasses.dataclass(frozen=True)
class EvaluateOptions:
    # Folder that reconstruct or render wrote, or a map: TIFF, NPY, or PNG with its scale; or a mesh: PLY, OBJ, STL,
    # GLB.
    predicted: Annotated[Positional[Path], value("PREDICTED")]
    # The same kinds.
    truth: Annotated[Positional[Path], value("TRUTH")]
    # median: one factor makes the medians agree, for a surface of unknown scale; scale-ls: the factor of least squares;
    # none: lengths as they are.
    align: Annotated[Align | None, value("HOW", default="median, or what the metric set asks for")] = None
    # The measures of a benchmark, with its quantity, alignment and limits: c3vd (depth up to 100 mm, median) or simcol
    # (depth, factor of least squares).
    metric_set: MetricSet = "all"
    # What is compared, and what a map holds unless it is called range.* or depth.*: range (along the ray) or
    # depth (along the optical axis). A camera converts.
    quantity: Annotated[Quantity | None, value("WHAT", default="range, or what the metric set asks for")] = None
    # Camera file of this image size; adds the errors of the normals.
    camera: Annotated[Path | None, value("FILE", default="none")] = None
    # Write error_map.tiff ((p − d)/d), errors.png (map, cumulative curve, error against angle and distance) and
    # evaluation.json to this folder.
    out: Annotated[Path | None, value("DIR", default="none")] = None
    # Replace the folder if it exists.
    force: bool = False
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
      jaxsfs evaluate result view --metric-set c3vd --camera view/camera.json --out errors

    Two meshes are compared by the distances between their surfaces: jaxsfs evaluate result/mesh.ply scan.stl
    """
    with jax_session(64):
        record = _measured(options)
    print(json.dumps(record, indent=2, sort_keys=True) if options.json else _table(record))
    return 0


def _measured(options: EvaluateOptions) -> dict[str, Any]:
    from jaxsfs import comparison, evaluation, files

    if {path.suffix.lower() for path in (options.predicted, options.truth)} & set(files.MESH_SUFFIXES):
        return _between_meshes(options)
    rules = comparison.METRIC_SETS.get(options.metric_set)
    quantity = options.quantity or (rules.quantity if rules else "range")
    align = options.align or (rules.align if rules else "median")
    predicted_path, predicted_quantity = _map_in(options.predicted, quantity)
    truth_path, truth_quantity = _map_in(options.truth, quantity)
    camera = None if options.camera is None else files.read_camera(options.camera).camera
    predicted, truth = files.read_map(predicted_path), files.read_map(truth_path, options.truth_scale)
    common: dict[str, Any] = {
        "quantity": quantity,
        "predicted_quantity": predicted_quantity,
        "truth_quantity": truth_quantity,
        "align": align,
        "camera": camera,
    }
    if rules is not None:
        asked = evaluation.convert_quantity(truth, truth_quantity, quantity, camera)
        common["valid"] = (asked > rules.low) & (asked <= rules.high)
    result = evaluation.evaluate(predicted, truth, truth_normals=_true_normals(options.truth, camera), **common)
    record = {"predicted": str(predicted_path), "truth": str(truth_path)} | result.as_dict()
    if rules is not None:
        record |= {"metric_set": options.metric_set, "measures": comparison.measures_of(result, options.metric_set)}
    if options.out is not None:
        _write(options, record, evaluation.compare(predicted, truth, **common), camera)
    return record


def _write(options: EvaluateOptions, record: dict[str, Any], found: "Comparison", camera) -> None:
    """The folder of the errors; its JSON also has the curves as numbers."""
    from jaxsfs import comparison, files, report

    assert options.out is not None
    angles = None if camera is None else comparison.by_angle(found, camera)
    lengths = comparison.by_length(found)
    words = f"{record['predicted']} against {record['truth']}: AbsRel {record['abs_rel']:.4g}, {record['align']}"
    curves = {"cumulative": comparison.cumulative(found), "by_angle_deg": angles, f"by_{found.quantity}": lengths}
    with files.output_folder(options.out, force=options.force) as folder:
        relative = found.relative()
        files.write_tiff(folder / "error_map.tiff", relative, found.compared, description="(p - d)/d")
        files.write_bytes(folder / "errors.png", report.error_figure(found, angles, lengths, words))
        files.write_json(folder / "evaluation.json", record | curves)


def _between_meshes(options: EvaluateOptions) -> dict[str, Any]:
    """Distances between two surfaces given as meshes."""
    from jaxsfs import comparison, files

    if options.metric_set != "all" or options.camera is not None or options.out is not None:
        raise files.InputError("--metric-set, --camera and --out are for maps; meshes have distances only")
    align = options.align or "none"
    meshes = [files.read_mesh(path) for path in (options.predicted, options.truth)]
    distances = comparison.mesh_distances(*meshes, align=align)
    return {"predicted": str(options.predicted), "truth": str(options.truth), "align": align, "meshes": distances}


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
    if "meshes" in record:
        rows = [("predicted", record["predicted"]), ("truth", record["truth"]), ("alignment", record["align"])]
        return _lined_up(rows + [(name, f"{length:.5g}") for name, length in record["meshes"].items()])
    aligned = "none" if record["align"] == "none" else f"{record['align']}, prediction times {record['scale']:.6g}"
    if "measures" in record:
        rows = [(name, record[name]) for name in ("predicted", "truth", "quantity")] + [("alignment", aligned)]
        rows += [("metric set", record["metric_set"])]
        return _lined_up(rows + [(name, f"{number:.5g}") for name, number in record["measures"].items()])
    rows = [
        ("predicted", record["predicted"]),
        ("truth", record["truth"]),
        ("quantity", record["quantity"]),
        ("alignment", aligned),
        ("pixels", f"{record['pixels']}, {record['fraction']:.1%} of those with a truth"),
        *(
            (name, f"{record[name]:.5g}")
            for name in ("abs_rel", "median_rel", "p95_rel", "mae", "sq_rel", "rmse", "rmse_log")
        ),
        *((f"delta < {k}", f"{record['delta_' + k.replace('.', '_')]:.2%}") for k in ("1.05", "1.10", "1.25")),
    ]
    normals = record["normals"]
    if normals is not None:
        rows += [
            ("normals", f"mean {normals['mean_deg']:.3g}°, median {normals['median_deg']:.3g}°"),
            *((f"normals < {k}°", f"{normals['share_below_' + k.replace('.', '_') + '_deg']:.2%}") for k in _ANGLES),
        ]
    return _lined_up(rows)


def _lined_up(rows: list[tuple[str, str]]) -> str:
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)


_LENGTHS = ("abs_rel", "median_rel", "p95_rel", "mae", "sq_rel", "rmse", "rmse_log")
_ANGLES = ("11.25", "22.5", "30")
