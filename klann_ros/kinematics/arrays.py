"""Types of NumPy arrays, one name for each kind of element; and records of them as text."""

from dataclasses import fields
from reprlib import Repr
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

AnyArray: TypeAlias = NDArray[Any]
BoolArray: TypeAlias = NDArray[np.bool_]
ByteArray: TypeAlias = NDArray[np.uint8]
ComplexArray: TypeAlias = NDArray[np.complex128]
FloatArray: TypeAlias = NDArray[np.float64]
IndexArray: TypeAlias = NDArray[np.intp]
IntArray: TypeAlias = NDArray[np.int64]
Record = TypeVar('Record', bound=type)


def plane_vectors(vectors: ComplexArray) -> FloatArray:
    """Return complex numbers as vectors (x, y), shape (..., 2)."""
    return np.stack([vectors.real, vectors.imag], axis=-1)


def real_rows(equations: ComplexArray) -> FloatArray:
    """Return complex equations as real ones: of each its x, then its y."""
    planes = np.stack([equations.real, equations.imag], axis=1)
    return planes.reshape(-1, *equations.shape[1:])


class _ArrayRepr(Repr):
    """Text of fields: arrays by their type and shape."""

    def repr_ndarray(self, array: AnyArray, _: int) -> str:
        """Return the type and the shape of an array."""
        return f'{array.dtype}{list(array.shape)}'


_array_repr = _ArrayRepr()
_array_repr.maxother = _array_repr.maxstring = 60


def with_short_repr(record_class: Record) -> Record:
    """Decorate a class of records with arrays: their text is that of `short_repr`."""
    record_class.__repr__ = short_repr  # type: ignore[assignment]  # a function becomes a method
    return record_class


def short_repr(record: Any) -> str:
    """Return a dataclass or a named tuple as one line, its arrays by their shapes."""
    names = getattr(record, '_fields', ())
    if not names:
        names = [field.name for field in fields(record) if field.repr]
    texts = [f'{name}={_array_repr.repr(getattr(record, name))}' for name in names]
    return f'{type(record).__name__}({", ".join(texts)})'
