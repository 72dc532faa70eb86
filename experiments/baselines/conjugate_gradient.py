"""Preconditioned nonlinear conjugate gradients (Polak & Ribière) on the shading energy."""

from collections.abc import Callable

from baselines.distant import DistantImage, Relief
from baselines.energy import Energy, Unknowns

Preconditioner = Callable[[Unknowns], Unknowns]


def minimise(
    energy: Energy,
    x: Unknowns,
    precondition: Preconditioner,
    *,
    smooth: float,
    integrable: float,
    iterations: int,
    history: list[float] | None = None,
) -> Unknowns:
    """Runs `iterations` steps; each is the Gauss–Newton length along the direction, halved until the energy falls.

    `history` collects the energy after every step.
    """
    value = energy.value(x, smooth, integrable)
    old, direction, last = None, None, 0.0
    for _ in range(iterations):
        gradient = energy.gradient(x, smooth, integrable)
        better = precondition(gradient)
        product = _dot(gradient, better)
        if product < 1e-20:
            break
        keep = 0.0 if old is None else max(0.0, (product - _dot(old, better)) / last)
        direction = better if direction is None else _along(better, keep, direction)
        slope = _dot(gradient, direction)
        if slope <= 0:
            direction, slope = better, product
        step = slope / max(energy.curvature(x, direction, smooth, integrable), 1e-30)
        for _ in range(20):
            trial = _along(x, -step, direction)
            found = energy.value(trial, smooth, integrable)
            if found <= value:
                x, value = trial, found
                break
            step /= 2
        old, last = gradient, product
        if history is not None:
            history.append(value)
    return x


def staged(
    image: DistantImage, rim_p, rim_q, preconditioner_for: Callable[[Energy, float, float, Unknowns], Preconditioner],
    stages: tuple[float, ...], integrable: float, iterations: int,
) -> Relief:  # fmt: skip
    """Minimises with λ going through `stages`, each from where the last one ended."""
    energy = Energy(image, rim_p, rim_q)
    x = energy.start()
    for smooth in stages:
        precondition = preconditioner_for(energy, smooth, integrable, x)
        x = minimise(energy, x, precondition, smooth=smooth, integrable=integrable, iterations=iterations)
    grid = energy.grid
    return Relief(grid.image(x.z), grid.image(x.p), grid.image(x.q))


def _dot(a: Unknowns, b: Unknowns) -> float:
    return float(a.p @ b.p + a.q @ b.q + a.z @ b.z)


def _along(x: Unknowns, step: float, d: Unknowns) -> Unknowns:
    return Unknowns(x.p + step * d.p, x.q + step * d.q, x.z + step * d.z)
