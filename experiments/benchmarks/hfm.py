"""HamiltonFastMarching (Mirebeau 2014, 2019), where the machine has it: Python package agd and its compiled HFMpy.

No package registry holds HFMpy: compile `Interfaces/PythonHFM/src/main.cpp` of its sources with ModelName=Riemann2 as
HFMpy/HFM_Riemann2.
"""

from dataclasses import replace
from pathlib import Path

import measure
import numpy as np

NAME = "HFM Riemannian, order 2"


def riemannian(inverse_metric, speed, known, error) -> measure.Program | measure.Missing:
    """T with |∇T|_g = 1/F and T = `known` where that is finite; `inverse_metric` g^{ij} in (u, v)."""
    for module in ("agd", "HFMpy"):
        if missing := measure.peer(module, NAME)[1]:
            return replace(missing, note=f"skipped: no module {module}, see {Path(__file__).name}")
    from agd import Eikonal  # pyright: ignore[reportMissingImports]
    from agd.Metrics import Riemann  # pyright: ignore[reportMissingImports]

    metric = np.linalg.inv(np.asarray(inverse_metric, float)) / np.asarray(speed, float)[..., None, None] ** 2
    seeds = np.argwhere(np.isfinite(known))
    # first axis of the arrays: v
    problem = Eikonal.dictIn(
        {
            "model": "Riemann2",
            "arrayOrdering": "RowMajor",
            "order": 2,
            "exportValues": 1,
            "verbosity": 0,
            "dims": np.array(known.shape),
            "gridScale": 1.0,
            "origin": np.array([-0.5, -0.5]),  # pixel centres have whole coordinates
            "metric": Riemann(np.moveaxis(metric[..., ::-1, ::-1], (-2, -1), (0, 1))),
            "seeds": seeds.astype(float),
            "seedValues": np.asarray(known, float)[tuple(seeds.T)],
        }
    )
    return measure.Program(NAME, lambda: problem.Run()["values"], error, note="float64")
