"""One first-order level-set step: `jaxsfs.levelset.propagate`, the same scheme in NumPy and in Numba, hj-reachability.

The times of ours and NumPy are (long run − short run)/(difference in steps), see `level_set_step`. hj-reachability's
step is its own first-order scheme (Lax–Friedrichs) for φ_t + F |∇φ| = 0 with F = 1: the cheapest problem it has.
"""

import jax
import jax.numpy as jnp
import level_set_numba
import level_set_step
import measure
import numpy as np

SHORT, LONG = 5, 65


def rows(size: int, repetitions: int) -> list[dict]:
    """All programs at one size; time per step."""
    problem = level_set_step.Problem("wavy-wall", size)
    steps = LONG - SHORT
    programs = [
        _steps("jaxsfs, order 1", problem.jax, "float32"),
        _steps("NumPy, same scheme", problem.numpy, "float32, one thread"),
        level_set_numba.MISSING
        or _steps("Numba, same scheme", level_set_numba.program(problem), "float32, all threads"),
        *_hj_reachability(size, steps),
    ]
    found = measure.compare("level-set step, order 1", size, programs, repetitions)
    bandwidth = level_set_step.triad_bandwidth(4 if size < 128 else 64)
    floor = 4 * level_set_step.FLOATS_PER_PIXEL / bandwidth * 1e9
    empty = dict.fromkeys(measure.FIELDS, "") | {"comparison": "level-set step, order 1", "size": size}
    note = f"{level_set_step.FLOATS_PER_PIXEL} float32 a pixel at the {bandwidth / 1e9:.1f} GB/s of NumPy's triad"
    return [*found, empty | {"program": "memory alone", "ns_per_px": f"{floor:.2f}", "note": note}]


def _steps(name, run, note):
    return measure.Program(name, lambda: run(LONG), parts=LONG - SHORT, note=note, setup=lambda: run(SHORT))


def _hj_reachability(size, steps):
    hj, missing = measure.peer("hj_reachability", "hj-reachability")
    if missing:
        return [missing]

    class Eikonal(hj.Dynamics):
        """φ_t + |∇φ| = 0."""

        def __init__(self):
            super().__init__("max", "min", hj.sets.Ball(np.zeros(2), 1.0), hj.sets.Ball(np.zeros(2), 1.0))

        def __call__(self, state, control, disturbance, time):
            return control

        def optimal_control_and_disturbance(self, state, time, grad_value):
            return grad_value, jnp.zeros(2)

        def hamiltonian(self, state, time, value, grad_value):
            return jnp.sqrt(grad_value @ grad_value + 1e-12)

        def partial_max_magnitudes(self, state, time, value, grad_value_box):
            return jnp.ones(2)

    domain = hj.sets.Box(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(domain, (size, size))
    values = jnp.linalg.norm(grid.states, axis=-1) - 0.3
    found, dynamics = [], Eikonal()
    for name, accuracy in (("first order", "low"), ("WENO5", "very_high")):
        settings = hj.SolverSettings.with_accuracy(accuracy)

        @jax.jit
        def run(values, settings=settings):
            def step(_, state):
                return settings.time_integrator(settings, dynamics, grid, *state, -1e3)

            return jax.lax.fori_loop(0, steps, step, (jnp.zeros((), float), values))[1]

        once = measure.Program(
            f"hj-reachability, {name}", lambda run=run: jax.block_until_ready(run(values)), parts=steps, note="float32"
        )
        found.append(once)
    return found
