"""Dense matrices in place by BLAS and LAPACK, other threads going on meanwhile.

SciPy's own calls hold the interpreter's lock, so that two threads would take turns. Here its Fortran routines are
called by their addresses, which lets the lock go. Matrices are in Fortran order without gaps, all of a call doubles or
all of single precision; of symmetric and triangular ones the lower half is used.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from scipy.linalg import cython_blas, cython_lapack  # pyright: ignore[reportAttributeAccessIssue]

_LEFT, _RIGHT, _LOWER, _PLAIN, _TRANSPOSED, _ANY = (ctypes.c_char(letter) for letter in b"LRLNTN")
_NUMBERS = {
    "d": (ctypes.c_double(1.0), ctypes.c_double(-1.0), ctypes.c_double(0.0)),
    "s": (ctypes.c_float(1.0), ctypes.c_float(-1.0), ctypes.c_float(0.0)),
}
_LETTERS = {np.dtype(np.float64): "d", np.dtype(np.float32): "s"}
"""What the names of routines of a precision begin with."""


def cholesky(a: np.ndarray) -> bool:
    """a := L with L·Lᵀ = a; False where a pivot is not positive."""
    return not a.size or _lapack("potrf", a) == 0


def inverse_of_cholesky(a: np.ndarray) -> None:
    """a := (L·Lᵀ)⁻¹ from L in a."""
    if a.size:
        _lapack("potri", a)


def solve_from_right(lower: np.ndarray, b: np.ndarray, transposed: bool) -> None:
    """b := b·L⁻ᵀ, or b·L⁻¹."""
    if b.size:
        turn = _TRANSPOSED if transposed else _PLAIN
        rows, columns = _sizes(b)
        one, _, _ = _NUMBERS[_LETTERS[b.dtype]]
        _routine("trsm", b, lower)(
            _RIGHT, _LOWER, turn, _ANY, rows, columns, one, _address(lower), columns, _address(b), rows
        )  # fmt: skip


def subtract_square(a: np.ndarray, c: np.ndarray) -> None:
    """c −= a·aᵀ, the lower half."""
    if a.size:
        rows, columns = _sizes(a)
        one, minus, _ = _NUMBERS[_LETTERS[a.dtype]]
        _routine("syrk", a, c)(
            _LOWER, _PLAIN, rows, columns, minus, _address(a), rows, one, _address(c), rows
        )  # fmt: skip


def minus_product(symmetric: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    """c := −symmetric·b."""
    if b.size:
        rows, columns = _sizes(b)
        _, minus, zero = _NUMBERS[_LETTERS[b.dtype]]
        _routine("symm", symmetric, b, c)(
            _LEFT, _LOWER, rows, columns, minus, _address(symmetric), rows, _address(b), rows, zero, _address(c), rows
        )  # fmt: skip


def subtract_transposed_product(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    """c −= aᵀ·b, a and b (r, c)."""
    if a.size:
        rows, columns = _sizes(a)
        one, minus, _ = _NUMBERS[_LETTERS[a.dtype]]
        _routine("gemm", a, b, c)(
            _TRANSPOSED, _PLAIN, columns, columns, rows, minus, _address(a), rows, _address(b), rows, one,
            _address(c), columns,
        )  # fmt: skip


def _lapack(name: str, a: np.ndarray) -> int:
    rows, _ = _sizes(a)
    info = ctypes.c_int(0)
    _routine(name, a)(_LOWER, rows, _address(a), rows, info)
    return info.value


def _sizes(a: np.ndarray) -> tuple[ctypes.c_int, ctypes.c_int]:
    return ctypes.c_int(a.shape[0]), ctypes.c_int(a.shape[1])


def _address(a: np.ndarray) -> ctypes.c_void_p:
    if not a.flags.f_contiguous:
        raise ValueError("a matrix in Fortran order is needed")
    return ctypes.c_void_p(a.__array_interface__["data"][0])


def _routine(name: str, *matrices: np.ndarray) -> Any:
    """The Fortran routine for matrices of their precision."""
    first = matrices[0].dtype
    if first not in _LETTERS or any(a.dtype != first for a in matrices):
        raise ValueError("matrices of one precision, double or single, are needed")
    return _fortran(_LETTERS[first] + name)


@cache
def _fortran(name: str) -> Any:
    """The Fortran routine, which takes every argument by its address."""
    capsule = (cython_blas if name in cython_blas.__pyx_capi__ else cython_lapack).__pyx_capi__[name]
    get_name, get_pointer = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    get_name.restype, get_name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    get_pointer.restype, get_pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    address = get_pointer(capsule, get_name(capsule))
    function = ctypes.CFUNCTYPE(None)(address)

    def call(*arguments: Any) -> None:
        function(*(a if isinstance(a, ctypes.c_void_p) else ctypes.byref(a) for a in arguments))

    return call
