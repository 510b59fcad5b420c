"""EPANET files as cases. Knows both sides' words; runs nothing of fvsolve."""

from fvsolve.epanet.importing import Imported, import_network

__all__ = ["Imported", "import_network"]
