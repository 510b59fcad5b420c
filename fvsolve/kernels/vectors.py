"""Vectors as calls by address take them: an address and a length. Knows numba's array layout; knows no law.

Numba passes an array as seven words, of which five are the same for all vectors; four arrays a call then cost more
than a small piece of a right-hand side does.
"""

from numba.core import cgutils, types
from numba.core.datamodel import register_default
from numba.core.datamodel.models import ArrayModel
from numba.core.imputils import lower_cast
from numba.core.types.npytypes import Array


class Vector(Array):
    """A contiguous row of numbers of one kind; an array in all but how it is passed."""

    def __init__(self, dtype: types.Type) -> None:
        super().__init__(dtype, 1, "C", name=f"vector({dtype})")


@register_default(Vector)
class VectorModel(ArrayModel):
    """An array, whose other five words are made where it arrives."""

    def get_argument_type(self) -> tuple:
        """Address and length."""
        return self._of("data").get_argument_type(), self._of("nitems").get_argument_type()

    def _of(self, field: str):
        return self.get_model(self.get_field_position(field))

    def as_argument(self, builder, value) -> tuple:
        """What is passed of an array."""
        return self.get(builder, value, "data"), self.get(builder, value, "nitems")

    def from_argument(self, builder, value):
        """The array again: uncounted, of one row without gaps."""
        data, many = value
        size = many.type(self.fe_type.dtype.bitwidth // 8)
        empty = cgutils.get_null_value(self.get_value_type())
        for field, found in (("data", data), ("nitems", many), ("itemsize", size)):
            empty = self.set(builder, empty, found, field)
        for field, found in (("shape", many), ("strides", size)):
            place = self.get_field_position(field)
            empty = builder.insert_value(empty, found, [place, 0])
        return empty


@lower_cast(Array, Vector)
@lower_cast(Vector, Array)
def as_it_is(context, builder, given, wanted, value):
    """The same words."""
    return value
