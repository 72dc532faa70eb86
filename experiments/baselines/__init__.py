"""The methods that the paper names, written from the literature: one small module each, its source in the docstring.

Distant light, orthographic camera (what most of them assume): `distant` holds their common words. Light at the
lens: `curve_expansion` (Okatani & Deguchi 1997 and the paper itself) and `prados_faugeras`. They are here to be
compared with, so they are plain NumPy, readable before fast, and each does what its source says and no more.
"""
