"""Derivatives of the static solution by the implicit function theorem: no sweep is unrolled.

At the solution every pixel obeys one equation F_x(v_x, v of up to four upwind pixels, image, metric) = 0, or its value
is given. So dv solves (I − C) dv = b with C = −(∂F/∂v_upwind)/(∂F/∂v_x), b = −(∂F/∂θ) dθ/(∂F/∂v_x): a sparse system,
triangular in the order of arrival, which a few sweeps of the same kind solve exactly, and whose transpose the same
sweeps in reverse order solve.
"""

from jaxsfs.implicit._log_range import log_range as log_range
from jaxsfs.implicit._solve import solve as solve
