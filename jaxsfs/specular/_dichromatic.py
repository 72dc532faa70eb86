"""The dichromatic model in linear light, I = c_B k_d + c_I k_s (eqs. 7 and 8), and what is blind to the interface."""

import numpy as np
from jaxtyping import Float

Vector = Float[np.ndarray, "3"]
Colours = Float[np.ndarray, "*shape 3"]

WHITE: Vector = np.ones(3)
RED_MINUS_GREEN: Vector = np.array([1.0, -1.0, 0.0])  # the paper's choice, for k_s = (1, 1, 1)
LUMINANCE: Vector = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709, linear light

_LEAST_SATURATION = 1e-9  # |sin| of the angle between k_d and k_s from which they count as parallel


def interface_free_vector(
    body: Vector, interface: Vector = WHITE, noise_covariance: Float[np.ndarray, "3 3"] | None = None
) -> Vector:
    """The a ⟂ k_s (eq. 9) in which the body shows best: a = k_d − (k_d·k_s)k_s for unit k_s, scaled to a·k_d = 1.

    Of all a with a·k_s = 0 it has the largest a·k_d against white noise. With the covariance Σ of the channels' noise
    that is a = Σ⁻¹k_d − (k_sᵀΣ⁻¹k_d / k_sᵀΣ⁻¹k_s) Σ⁻¹k_s. `body`, `interface`: the colours k_d, k_s in linear light.

    Raises ValueError where body and interface have one colour, as on grey tissue under white light: then nothing
    tells them apart.
    """
    precision = np.eye(3) if noise_covariance is None else np.linalg.inv(noise_covariance)
    if saturation(body, interface) < _LEAST_SATURATION:
        raise ValueError(
            f"the body colour {_text(body)} and the interface colour {_text(interface)} are parallel: colour does not "
            "tell them apart; detect the highlights by brightness and fill them (method 'mask')"
        )
    towards, away = precision @ body, precision @ interface
    vector = towards - (interface @ towards) / (interface @ away) * away
    return vector / (vector @ body)


def saturation(body: Vector, interface: Vector = WHITE) -> float:
    """Sine of the angle between the colours k_d and k_s: 0 for grey under white light; 1/sine amplifies the noise."""
    k_d, k_s = body / np.linalg.norm(body), interface / np.linalg.norm(interface)
    return float(np.linalg.norm(k_d - (k_d @ k_s) * k_s))


def body_strength(linear: Colours, vector: Vector, body: Vector) -> Float[np.ndarray, "*shape"]:
    """c_B = (a·I)/(a·k_d), from eq. (10); adding any multiple of k_s to I changes nothing.

    `linear`: red, green, blue in linear light. `vector`: a with a·k_s = 0, such as RED_MINUS_GREEN. `body`: k_d; the
    result is in the unit that makes c_B k_d the body image, so a k_d of luminance 1 gives the body's luminance.

    Raises ValueError where a is blind to k_d too.
    """
    scale = float(vector @ body)
    if abs(scale) < 1e-12 * np.linalg.norm(vector) * np.linalg.norm(body):
        raise ValueError(
            f"a = {_text(vector)} is blind to the body colour {_text(body)} too: a·k_d = 0; choose another"
        )
    return linear @ (vector / scale).astype(linear.dtype)


def separate(
    linear: Colours, body: Vector, interface: Vector = WHITE, vector: Vector | None = None
) -> tuple[Colours, Colours]:
    """Body and interface image, c_B k_d and I − c_B k_d, of one body colour for the whole picture (eq. 8).

    `vector`: a with a·k_s = 0; the automatic one of `interface_free_vector` if not given.
    Raises ValueError where a is not perpendicular to k_s to 1e-6, and like `interface_free_vector`.
    """
    vector = interface_free_vector(body, interface) if vector is None else vector
    if abs(vector @ interface) > 1e-6 * np.linalg.norm(vector) * np.linalg.norm(interface):
        raise ValueError(
            f"a = {_text(vector)} is not perpendicular to the interface colour {_text(interface)}: "
            f"a·k_s = {vector @ interface:.3g}, expected 0 (eq. 9)"
        )
    body_part = body_strength(linear, vector, body)[..., None] * body.astype(linear.dtype)
    return body_part, linear - body_part


def _text(colour: Vector) -> str:
    return "(" + ", ".join(f"{part:.3g}" for part in colour) + ")"
