"""Whole videos: what is the same for all frames, and who computes them: threads here, or the workers of a cluster.

Nothing here imports JAX when it is imported: a worker sets its threads first.
"""
