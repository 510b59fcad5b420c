"""Import of EPANET files as cases."""

from fvsolve.epanet.importing import Imported, import_network

__all__ = ["Imported", "import_network"]
