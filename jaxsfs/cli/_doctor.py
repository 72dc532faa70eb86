"""`jaxsfs doctor`: what this machine computes with, and whether it computes right."""

import dataclasses
import json
import os
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

from jaxsfs.cli._options import FLAT
from jaxsfs.cli._terminal import CannotRun, jax_session, progress, versions

_NOT_TRUSTWORTHY = 3
_LARGEST_ERROR = 5e-3  # of the self-test's range; a sound machine has 2e-4
_EXTRAS = {
    "fast": ("numba",),
    "dicom": ("pydicom",),
    "exr": ("OpenEXR",),
    "cluster": ("dask", "distributed", "xarray", "zarr"),
}


@dataclasses.dataclass(frozen=True)
class DoctorOptions:
    # Print JSON instead of a table.
    json: bool = False


def doctor(options: Annotated[DoctorOptions, FLAT]) -> int:
    """Versions, devices, the cache of compiled programs, and one small surface reconstructed and compared.

    For example:
      jaxsfs doctor

    Exit code 2: something that jaxsfs needs is missing; 3: the self-test's surface is wrong. Whoever reports an error
    does well to add what this prints with --json.
    """
    try:
        record = {"versions": versions(), "extras": _extras()}
        with jax_session(32):
            record |= {"devices": _devices(), "cache": _cache()}
            progress("reconstructing a plane")
            record["self_test"] = _self_test()
    except (ImportError, PackageNotFoundError, RuntimeError) as error:  # RuntimeError: a device that JAX cannot use
        raise CannotRun(f"jaxsfs cannot run here: {error}; install it again (pip install jaxsfs)") from None
    print(json.dumps(record, indent=2) if options.json else _table(record))
    return 0 if record["self_test"]["good"] else _NOT_TRUSTWORTHY


def _extras() -> dict[str, bool]:
    return {name: all(_installed(package) for package in packages) for name, packages in _EXTRAS.items()}


def _installed(package: str) -> bool:
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def _devices() -> dict[str, Any]:
    import jax

    return {"backend": jax.default_backend(), "devices": [str(d) for d in jax.devices()], "cores": os.cpu_count()}


def _cache() -> dict[str, Any]:
    import jax

    folder = jax.config.values["jax_compilation_cache_dir"]
    if folder is None:
        return {"folder": None, "files": 0, "megabytes": 0.0}
    sizes = [entry.stat().st_size for entry in Path(folder).glob("*") if entry.is_file()]
    return {"folder": str(folder), "files": len(sizes), "megabytes": round(sum(sizes) / 1e6, 1)}


def _self_test() -> dict[str, Any]:
    """The wall z = 1 under a light at the camera: E = cos³α/z², r = z/cos α."""
    import jax.numpy as jnp
    import numpy as np

    from jaxsfs.camera import Spherical
    from jaxsfs.irradiance import Irradiance
    from jaxsfs.reconstruction import reconstruct

    start = time.perf_counter()
    camera = Spherical(f=60.0, cx=31.5, cy=31.5, width=64, height=64)
    cosine = camera.rays(jnp.dtype(jnp.float32))[..., 2]
    result = reconstruct(Irradiance(cosine**3, jnp.ones((64, 64), bool)), camera)
    error = float(np.mean(np.abs(np.asarray(result.surface.range * cosine) - 1)))
    good = bool(result.status.trustworthy and error < _LARGEST_ERROR)
    return {"good": good, "mean_error": error, "seconds": round(time.perf_counter() - start, 2)}


def _table(record: dict[str, Any]) -> str:
    devices, cache, test = record["devices"], record["cache"], record["self_test"]
    stored = f"{cache['folder']}, {cache['files']} files, {cache['megabytes']} MB" if cache["folder"] else "none"
    verdict = "good" if test["good"] else "WRONG"
    rows = [
        *record["versions"].items(),
        *((f"extra {name}", "installed" if there else "not installed") for name, there in record["extras"].items()),
        ("devices", f"{', '.join(devices['devices'])} ({devices['cores']} processor cores)"),
        ("cache", stored),
        ("self-test", f"{verdict}: mean error of range {test['mean_error']:.2g}, {test['seconds']} s"),
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)
