"""Arithmetic with the same result, bit for bit, on every x86-64 machine with AVX2.

BLAS and LAPACK choose their kernels by the processor, numpy's exponentials, logarithms and inverse
trigonometric functions have other last bits with AVX-512, and a compiler that may reorder a sum
does so by the width of the registers. Code on which commands depend uses these instead:

- ``products``: products of matrices and vectors, and sums, which Python 3.12 rounds otherwise;
- ``linear_systems``: equations, inverses, determinants;
- ``functions``: elementary functions of arrays;
- ``algebra_kernels``: the same within compiled functions, and scalar products of long vectors.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
