"""The LAPACK and BLAS routines that trainers call directly: in place, one triangle, no checks per call.

scipy's wrappers copy, check for NaN and symmetrise at each call, which costs as much as the arithmetic on
matrices of some dozen rows. Inputs were checked once by ``check_samples``.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

gesdd, posv, potrf, potri, potrs, trtrs = get_lapack_funcs(
    ("gesdd", "posv", "potrf", "potri", "potrs", "trtrs"), dtype=np.float64
)
ger, symm, syrk, trmm, trsm = get_blas_funcs(("ger", "symm", "syrk", "trmm", "trsm"), dtype=np.float64)
