"""`jaxsfs reconstruct`. What it does is in `_pipeline`, which is imported when it runs."""

from typing import Annotated

from jaxsfs.cli._options import FLAT
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._terminal import jax_session


def reconstruct(options: Annotated[ReconstructOptions, FLAT]) -> int:
    """The surface that one photograph shows, from its brightness.

    For example:
      jaxsfs render wavy-wall --out view
      jaxsfs reconstruct view/image.png --camera view/camera.json --out result

    Writes range.tiff, depth.tiff, normals.tiff, mask.png, mesh.ply, mesh.glb, depth.png, shaded.png, result.json, and
    report.html to look at; --animate adds front.gif or front.mp4.
    What is given here beats the camera file's photometry, that beats the default; the result says which it was. Exit
    code 3: the result is written, but not to be trusted; its status says why and what to do.
    """
    with jax_session(options.precision):
        from jaxsfs.cli._pipeline import run

        return run(options)
