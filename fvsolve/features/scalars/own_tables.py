"""Tables of scalars of a draft or a model, for functions of Python."""

from fvsolve.core.assembly.features import with_slot
from fvsolve.features.scalars.kernels.tables import EMPTY, SLOT, ScalarTables


def scalar_tables(owner) -> ScalarTables:
    """Tables of the scalars of a draft or a model; without rows if its case has none."""
    feature = with_slot(owner.features, SLOT)
    return EMPTY if feature is None else feature.tables()
