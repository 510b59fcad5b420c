"""Energy of networks: accounts of their elements, and rows of the energy of deviations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.core.model.energy_norm import SCALAR_WEIGHT
from fvsolve.features.networks.network import Network


def add_accounts(network: Network, accounts) -> None:
    """Add the accounts of the elements with power; accounts : `model.energy_accounts.Accounts`"""
    for item in network.booked:
        at, (group, _, name) = accounts.take(1), item.part.partition(".")
        part = getattr(accounts.model.case, group)[name]
        # such as friction of a cylinder
        loss_of_other = item.ledger == "dissipated" and not part.in_network
        kind = item.name.rpartition(".")[2] if loss_of_other else part.kind.replace("-", " ")
        stores = item.ledger == "stored"
        accounts.hold(name, kind, at if stores else None)
        if not stores and item.ledger and item.heat_to is None:
            accounts.add(item.ledger, name, kind, at)


def norm_rows(network: Network) -> Iterator[tuple[str, dict[int, float]]]:
    """Yield (name, state -> factor) of each row of L for stores, except those of pumps and masses.

    See `model.energy_norm.energy_form`.
    """
    for column, item in network.stores.items():
        if item.state_of is None:
            size = np.sqrt(0.5 * item.value * (SCALAR_WEIGHT if item.thermal else 1.0))
            terms = network.dependent.get(column, {column: 1.0})
            row = {
                network.states[c]: float(size * value * network.stores[c].unit)
                for c, value in terms.items()
            }
            yield item.part.partition(".")[2], row
