"""Orders of updates for the static form: a round of one of them carries values across the whole picture.

All have the same fixed point. A round takes v, its owners (which sweep, or from which side, set each pixel's value),
the equation's right-hand side as a function of v, the frame as it is and with columns for rows, whether differences are
of second order, and whether owners stay as they are.
"""

from typing import Literal

from jaxsfs.updates._defect import defect
from jaxsfs.updates._diagonals import diagonals
from jaxsfs.updates._jacobi import jacobi
from jaxsfs.updates._numba import compiled_rows
from jaxsfs.updates._pixel import HUGE, PAD, BalanceOf, Frame
from jaxsfs.updates._rows import rows

Updates = Literal["rows", "numba", "diagonals", "jacobi"]
ROUNDS = {"rows": rows, "numba": compiled_rows, "diagonals": diagonals, "jacobi": jacobi}

__all__ = ["HUGE", "PAD", "ROUNDS", "BalanceOf", "Frame", "Updates", "defect"]
