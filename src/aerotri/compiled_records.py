"""Records of arrays that kernels are given as one address, which keeps their compilation short.

Numba takes a named tuple apart: a kernel that is given sixty arrays gets more than four hundred numbers, hands them on
one by one at every call, and counts who holds each array; two thirds of what is compiled is that. Here a record is
written down once, before the kernel is called, as one row of eight-byte words, in the layout that numba's own arrays
have in memory, and a kernel reads of it what it names. The arrays belong to the caller throughout.

Kernels may name the fields of a record, hand it on, and make records anew, which then are numba's named tuples.
"""

from __future__ import annotations

from hashlib import sha256
from itertools import accumulate
from struct import Struct
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, lower_getattr_generic, models, register_model, typeof_impl, unbox
from numba.np.numpy_support import as_dtype

T = TypeVar("T", bound=type)
WORD = 8


class RecordType(types.Type):
    """A record: its class, its fields in order with their types, and the word at which each begins.

    Parameters
    ----------
    of : the class, a named tuple.
    parts : types of its fields: arrays, float64, int64, records of these.
    """

    def __init__(self, of: type, parts: tuple[Any, ...]):
        self.of, self.parts = of, parts
        named: Any = of
        widths = [_words(part) for part in parts]
        self.words = sum(widths)
        starts = accumulate(widths, initial=0)
        self.fields = {name: (part, start) for name, part, start in zip(named._fields, parts, starts, strict=False)}
        # numba writes the name into every symbol: all types in full would be pages
        digest = sha256(f"{of.__module__}.{of.__qualname__}{parts}".encode()).hexdigest()[:12]
        super().__init__(name=f"{of.__name__}_{digest}")


def record(of: T) -> T:
    """Let kernels take a class of named tuples as one address, where its fields are arrays, numbers and such records.

    An instance with other fields, such as None, stays what numba makes of named tuples.
    """
    named: Any = of
    # in a named tuple all that is known of an instance is in its fields
    named.packed = property(_packed)

    def typed(value: Any, context: Any) -> Any:
        parts = tuple(typeof_impl(part, context) for part in value)
        if any(part is None for part in parts):
            return None
        return RecordType(of, parts) if all(map(_packs, parts)) else types.NamedTuple(parts, of)

    typeof_impl.register(of)(typed)
    return of


def _packs(part: Any) -> bool:
    return isinstance(part, types.Array | RecordType) or part in (types.float64, types.int64)


def _words(part: Any) -> int:
    """Words that a field takes: who holds an array, its parent, items, item size, address, shape, strides."""
    if isinstance(part, RecordType):
        return part.words
    return 5 + 2 * part.ndim if isinstance(part, types.Array) else 1


def _packed(value: Any) -> bytes:
    """A record as words in memory; kernels read them."""
    words: list[Any] = []
    form = _put(value, words, "")
    return _struct(form).pack(*words)


_forms: dict[str, Struct] = {}


def _struct(form: str) -> Struct:
    if form not in _forms:
        _forms[form] = Struct(form)
    return _forms[form]


def _put(value: Any, words: list[Any], form: str) -> str:
    for part in value:
        if isinstance(part, np.ndarray):
            words += (0, 0, part.size, part.itemsize, part.ctypes.data, *part.shape, *part.strides)
            form += "qqqqq" + "qq" * part.ndim
        elif isinstance(part, tuple):
            form = _put(part, words, form)
        else:
            words.append(part)
            form += "d" if isinstance(part, float) else "q"
    return form


@register_model(RecordType)
class _RecordModel(models.OpaqueModel):
    """An address; nobody counts who holds it."""


@unbox(RecordType)
def _unbox(typ: Any, obj: Any, c: Any) -> NativeValue:
    packed = c.pyapi.object_getattr_string(obj, "packed")
    failed = cgutils.is_null(c.builder, packed)
    address = cgutils.alloca_once_value(c.builder, ir.Constant(cgutils.voidptr_t, None))
    with c.builder.if_then(c.builder.not_(failed)):
        c.builder.store(c.pyapi.bytes_as_string(packed), address)
    # held until the kernel is done
    return NativeValue(c.builder.load(address), is_error=failed, cleanup=lambda: c.pyapi.decref(packed))


@infer_getattr
class _RecordAttributes(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        return typ.fields[attr][0] if attr in typ.fields else None


@lower_getattr_generic(RecordType)
def _field(context: Any, builder: Any, typ: Any, value: Any, attr: str) -> Any:
    part, start = typ.fields[attr]
    place = builder.gep(value, [ir.Constant(ir.IntType(64), WORD * start)])
    if isinstance(part, RecordType):
        return place
    if not isinstance(part, types.Array):
        return _word(builder, place, context.get_value_type(part))
    return _array(context, builder, part, place)


def _array(context: Any, builder: Any, part: Any, place: Any) -> Any:
    """An array as numba's kernels have it; nobody holds it for them."""
    array = context.make_array(part)(context, builder)
    number = ir.IntType(64)

    def word(k: int, kind: Any) -> Any:
        return _word(builder, builder.gep(place, [ir.Constant(number, WORD * k)]), kind)

    array.meminfo = array.parent = ir.Constant(cgutils.voidptr_t, None)
    array.nitems = word(2, number)
    array.itemsize = ir.Constant(number, as_dtype(part.dtype).itemsize)
    array.data = word(4, array.data.type)
    array.shape = cgutils.pack_array(builder, [word(5 + k, number) for k in range(part.ndim)])
    array.strides = cgutils.pack_array(builder, [word(5 + part.ndim + k, number) for k in range(part.ndim)])
    return array._getvalue()


def _word(builder: Any, place: Any, kind: Any) -> Any:
    """A number or an address of a record, of which the compiler may know that kernels never change it."""
    loaded = builder.load(builder.bitcast(place, ir.PointerType(kind)))
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded
