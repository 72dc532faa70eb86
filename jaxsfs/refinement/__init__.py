"""Surfaces under lights that are not at the lens: the solution for a light at the lens, corrected."""

from jaxsfs.refinement._gauss_newton import Polish as Polish, polish as polish
from jaxsfs.refinement._ratio import light_ratio as light_ratio
from jaxsfs.refinement._refine import Refinement as Refinement, RefinementStatus as RefinementStatus, refine as refine
