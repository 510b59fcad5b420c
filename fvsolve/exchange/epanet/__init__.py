"""EPANET files: import as cases, and export of cases."""

from fvsolve.exchange.epanet.exporting import network_text
from fvsolve.exchange.epanet.importing import Imported, import_network

__all__ = ["Imported", "import_network", "network_text"]
