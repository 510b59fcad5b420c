"""Arrays without reference counts, for the length of one compiled call. Knows numba's array layout.

Every array that passes from one compiled function to another is counted, atomically; with the tables of a
model that costs microseconds a step. The caller of the loop holds all arrays anyway, so the loop may borrow them.
"""

import os

if os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    def _uncounted(context, builder, kind, value):
        from numba.np.arrayobj import make_array

        array = make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()

    @intrinsic
    def borrow(typingctx, what):
        """The same array, or tuple of arrays, without a reference count; valid while the caller holds it."""

        def generate(context, builder, signature, args):
            kind = signature.args[0]
            if isinstance(kind, types.Array):
                return _uncounted(context, builder, kind, args[0])
            values = [
                _uncounted(context, builder, k, builder.extract_value(args[0], i)) for i, k in enumerate(kind.types)
            ]
            return context.make_tuple(builder, kind, values)

        return what(what), generate
else:

    def borrow(what):
        """The same: nothing is counted where nothing is compiled."""
        return what
