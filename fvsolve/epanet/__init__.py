"""EPANET files: import as cases, and export of cases."""

from fvsolve.epanet.exporting import network_text
from fvsolve.epanet.importing import Imported, import_network

__all__ = ["Imported", "import_network", "network_text"]
