"""Names of formats that are written when asked for, and of units; nothing else is loaded for them."""

from typing import Literal

Unit = Literal["mm", "scene units"]
Format = Literal["stl", "obj", "pfm", "png16", "npz", "exr"]
