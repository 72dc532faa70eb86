"""What two known ranges and other options bring on tubes whose photometry is only near the preset's.

    python experiments/known_ranges.py --out out/known_ranges
    python experiments/known_ranges.py --tuning --seeds 24

Scenes: see lumens.py. Everything starts from `--preset colonoscope`; AbsRel of depth after median scaling. Two ranges:
`--estimate-photometry` with the preset as prior, one pixel among the nearest fifth and one among the farthest, three
pairs a scene. `sure`: the same with ranges that must be met within 1 % each, which the rest of the model does not
allow. Options: one at a time. The last line but one is the mean, the last the number of scenes that are better than
with the preset alone.
"""

import argparse
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from lumens import PRESET, Lumen, lumen
from tables import write_tables
from tqdm import tqdm

from data_synth import REPORT_SEEDS, TUNING_SEEDS
from jaxsfs import CosineFalloff, GammaResponse, Irradiance, Power, evaluate, reconstruct
from jaxsfs.estimation import Prior, estimate_photometry, prior_about
from jaxsfs.photo import parse_channel
from jaxsfs.photometry import NoFalloff
from jaxsfs.preparation import Preparation, prepare

PRIOR = prior_about(GammaResponse(PRESET[0]), CosineFalloff(PRESET[1]), Power(PRESET[2]))
OPTIONS = {
    "even weights": {"channel": "1,1,1"},
    "green": {"channel": "green"},
    "rim closed": {"rim": "closed"},
    "contours off": {"occlusions": "off"},
}
PAIRS = 3


def prepared(seen: Lumen, gamma: float, mu: float | None, channel: str) -> Preparation:
    return prepare(
        seen.stored.astype(np.float32),
        seen.view.camera,
        valid=np.asarray(seen.view.surface.valid),
        response=GammaResponse(gamma),
        falloff=NoFalloff() if mu is None else CosineFalloff(mu),
        weights=parse_channel(channel),
    )


def error(seen: Lumen, photometry: tuple[float, float, float] = PRESET, channel: str = "luminance", **options) -> float:
    gamma, mu, power = photometry
    light = prepared(seen, gamma, mu, channel).irradiance
    found = reconstruct(
        Irradiance(light.values.astype(jnp.float32), light.valid), seen.view.camera, reflectance=Power(power), **options
    ).surface
    both = np.asarray(found.valid) & np.asarray(seen.view.surface.valid)
    depths = (np.where(both, np.asarray(one.depth(), float), np.nan) for one in (found, seen.view.surface))
    return float(evaluate(*depths, quantity="depth", align="median").abs_rel)


def with_two_ranges(seen: Lumen, prior: Prior, pairs: int) -> float:
    """Mean error over pairs of pixels."""
    light = prepared(seen, PRESET[0], None, "luminance").irradiance
    stored, usable = np.asarray(GammaResponse(PRESET[0]).encode(light.values)), np.asarray(light.valid)
    true = np.asarray(seen.view.surface.range)
    low, high = np.percentile(true[usable], [20, 80])
    rng = np.random.default_rng(0)
    near, far = (np.argwhere(usable & part) for part in (true < low, true > high))
    errors = []
    for pair in zip(rng.choice(near, pairs), rng.choice(far, pairs), strict=True):
        known = [(int(u), int(v), float(true[v, u])) for v, u in pair]
        found = estimate_photometry(stored, seen.view.camera, known, usable, prior)
        errors.append(error(seen, (found.gamma, found.mu, found.power)))
    return float(np.mean(errors))


def row(seed: int, size: int, pairs: int) -> dict[str, float]:
    seen = lumen(seed, size)
    figures = {"preset": error(seen), "two ranges": with_two_ranges(seen, PRIOR, pairs)}
    figures["two ranges, sure"] = with_two_ranges(seen, PRIOR._replace(range_sd=0.01), pairs)
    return figures | {name: error(seen, **options) for name, options in OPTIONS.items()}


def run(out: Path, seeds: range, size: int, pairs: int) -> str:
    """Writes the table to `out` and returns it."""
    found = [row(seed, size, pairs) for seed in tqdm(seeds, file=sys.stderr, disable=None)]
    rows = [
        {"seed": str(seed)} | {name: f"{value:.4f}" for name, value in one.items()}
        for seed, one in zip(seeds, found, strict=True)
    ]
    means = {name: f"{np.mean([one[name] for one in found]):.4f}" for name in found[0]}
    better = {name: str(sum(one[name] < one["preset"] for one in found)) for name in found[0]}
    return write_tables(
        out, "known_ranges", {"known ranges": [*rows, {"seed": "mean"} | means, {"seed": "better"} | better]}
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Two known ranges, on tubes of photometry near the preset's.")
    parser.add_argument("--out", type=Path, default=Path("out/known_ranges"), help="folder for the table")
    parser.add_argument("--quick", action="store_true", help="one small tube")
    parser.add_argument("--tuning", action="store_true", help="the seeds that the prior was chosen on, not for reports")
    parser.add_argument("--seeds", type=int, default=12, help="number of tubes")
    options = parser.parse_args()
    seeds = (TUNING_SEEDS if options.tuning else REPORT_SEEDS)[: 1 if options.quick else options.seeds]
    print(run(options.out, seeds, 81 if options.quick else 161, 1 if options.quick else PAIRS))


if __name__ == "__main__":
    main()
