"""Argument type of vectors in calls by address: a memory address and a length.

Numba passes an array as seven words, of which five are equal for all vectors. Four arrays in a call then cost more than
a small function of the right-hand side.
"""

from numba.core import cgutils, types
from numba.core.datamodel import register_default
from numba.core.datamodel.models import ArrayModel
from numba.core.imputils import lower_cast
from numba.core.types.npytypes import Array


class Vector(Array):
    """Numba type of a contiguous vector of numbers; it differs from an array only in the way in which it is passed."""

    def __init__(self, dtype: types.Type) -> None:
        super().__init__(dtype, 1, "C", name=f"vector({dtype})")


@register_default(Vector)
class VectorModel(ArrayModel):
    """Data model of `Vector`: an array whose other five words are set by the called function."""

    def get_argument_type(self) -> tuple:
        """Types of the two words that are passed: address and length."""
        return self._of("data").get_argument_type(), self._of("nitems").get_argument_type()

    def _of(self, field: str):
        return self.get_model(self.get_field_position(field))

    def as_argument(self, builder, value) -> tuple:
        """Two words that are passed for an array: address and length."""
        return self.get(builder, value, "data"), self.get(builder, value, "nitems")

    def from_argument(self, builder, value):
        """Array from its two words, address and length; it has no reference count, and a single row without gaps."""
        data, count = value
        size = count.type(self.fe_type.dtype.bitwidth // 8)
        empty = cgutils.get_null_value(self.get_value_type())
        for field, word in (("data", data), ("nitems", count), ("itemsize", size)):
            empty = self.set(builder, empty, word, field)
        for field, word in (("shape", count), ("strides", size)):
            place = self.get_field_position(field)
            empty = builder.insert_value(empty, word, [place, 0])
        return empty


@lower_cast(Array, Vector)
@lower_cast(Vector, Array)
def identity_cast(context, builder, from_type, to_type, value):
    """Convert an array to a vector or back: the words are equal, so nothing is converted."""
    return value
