"""The formats that are written when asked for; the command line reads the names without loading anything else."""

from typing import Literal

Format = Literal["stl", "obj", "pfm", "png16", "npz", "exr"]
