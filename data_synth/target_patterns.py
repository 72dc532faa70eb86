"""What is printed on the targets: reflectance of the sheet at a target point in mm (x right, y down)."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsfs.forms import Scalar

PAPER, INK = 1.0, 0.06


class AbstractPattern(eqx.Module):
    """Ink on white paper."""

    @abc.abstractmethod
    def ink(self, point: Float[Array, "2"]) -> Float[Array, ""]:
        """Reflectance at `point`, the paper's own being 1."""


class BlankSheet(AbstractPattern):
    """White paper."""

    def ink(self, point: Float[Array, "2"]) -> Float[Array, ""]:
        return jnp.full((), PAPER)


class Rings(AbstractPattern):
    """Concentric circles of the given radii (mm): lines of `width` (dark, or bright on a dark disc), or filled
    bands whose edges have these radii; `dot`: radius of a centre dot, 0 for none."""

    radii: tuple[Scalar, ...]
    width: Scalar = 0.8
    dot: Scalar = 0.0
    style: str = eqx.field(default="dark", static=True)

    def ink(self, point: Float[Array, "2"]) -> Float[Array, ""]:
        radius = jnp.sqrt(jnp.sum(point**2))
        edges = jnp.stack([jnp.asarray(radius, float) for radius in self.radii])
        on_line = jnp.any(jnp.abs(radius - edges) < self.width / 2) | (radius < self.dot)
        if self.style == "dark":
            return jnp.where(on_line, INK, PAPER)
        if self.style == "bright":
            return jnp.where(on_line, PAPER, INK)
        odd = (jnp.sum(radius > edges) % 2) == 1
        return jnp.where(odd | (radius < self.dot), INK, PAPER)


class LineGrid(AbstractPattern):
    """Square grid of lines: `pitch`, `width`, and `cells` from the centre to each side (mm, mm, count)."""

    pitch: Scalar
    width: Scalar
    cells: Scalar = 20

    def ink(self, point: Float[Array, "2"]) -> Float[Array, ""]:
        half = self.cells * self.pitch + self.width / 2
        inside = jnp.all(jnp.abs(point) < half)
        away = jnp.abs(point - self.pitch * jnp.round(point / self.pitch))
        return jnp.where(inside & jnp.any(away < self.width / 2), INK, PAPER)


class Checkerboard(AbstractPattern):
    """`columns` × `rows` inner corners `pitch` mm apart, centred."""

    columns: Scalar
    rows: Scalar
    pitch: Scalar

    def ink(self, point: Float[Array, "2"]) -> Float[Array, ""]:
        size = jnp.stack([self.columns, self.rows]).astype(point.dtype) + 1
        cell = jnp.floor(point / self.pitch + size / 2)
        inside = jnp.all((cell >= 0) & (cell < size))
        return jnp.where(inside & (jnp.sum(cell) % 2 == 0), INK, PAPER)


class DotGrid(AbstractPattern):
    """`columns` × `rows` dots of `radius`, `pitch` mm apart, centred. `asymmetric`: rows `pitch` apart, dots in a row
    2·`pitch`, every second row shifted by `pitch` (as OpenCV counts)."""

    columns: Scalar
    rows: Scalar
    pitch: Scalar
    radius: Scalar
    asymmetric: bool = eqx.field(default=False, static=True)

    def ink(self, point: Float[Array, "2"]) -> Float[Array, ""]:
        step = 2 if self.asymmetric else 1
        columns, rows = (jnp.asarray(count, point.dtype) for count in (self.columns, self.rows))
        middle = jnp.stack([step * (columns - 1) + step - 1, rows - 1]) / 2
        place = point / self.pitch + middle
        row = jnp.clip(jnp.round(place[1]), 0, rows - 1)
        shift = jnp.where(row % 2 == 1, step - 1.0, 0.0)
        column = shift + step * jnp.clip(jnp.round((place[0] - shift) / step), 0, columns - 1)
        away = self.pitch * (place - jnp.stack([column, row]))
        return jnp.where(jnp.sum(away**2) < self.radius**2, INK, PAPER)
