"""Energy accounts of basins and moving walls."""

from fvsolve.core.model.energy_accounts import Account
from fvsolve.errors import listing


def energy_refusal(case, feature) -> str:
    """Reason why the energy of a case with basins cannot be computed; "" if it can. feature : the basins of the case"""
    basins, sources = feature.meshed, feature.sources
    if any(basin.part.on is not None and basin.opening for basin in basins):
        text = "the energy of a basin on a body with an open side is not supported; expected closed sides"
        return f"{text}, or a basin that no body carries"
    if sources:
        text = f"the energy of rain and infiltration ({listing(sources)}) is not supported"
        return f"{text}; expected a basin without them"
    if driven := [f"{basin.name}.{name}" for basin in basins for name in basin.closed]:
        text = f"the energy of water through driven patches ({listing(driven)}) is not supported"
        return f"{text}; expected walls, open sides, or links"
    if conduits := [name for name, link in case.links.items() if link.kind == "conduit"]:
        return (
            f"the energy of conduits ({listing(conduits)}) is not supported; expected other links"
        )
    if basins and not case.law.linear:
        return 'the energy of basins is computed for law = "linear" only; expected this density law'
    return ""


def end_accounts(accounts, own) -> None:
    """Add the accounts of moving walls, then those of basins, in the order of `energy_rows`. own : the feature"""
    basins = own.meshed
    names = [f"{basin.name}.{patch}" for basin in basins for patch in basin.walls]
    for name, row in zip(names, own.walls, strict=True):
        at = accounts.take(2)
        if row["mass"] < 0 and row["body"] < 0:
            accounts.add("supplied", name, "wall", at)
        accounts.add("law", name, "wall", at + 1)
    for basin in basins:
        at = accounts.take(5)
        accounts.add("dissipated", basin.name, "patches", at + 1)
        accounts.add("dissipated", basin.name, "friction", at + 2)
        accounts.hold(basin.name, "basin", at + 3)
        if basin.part.on is not None:
            accounts.add("law", basin.name, "basin", at + 4)
        accounts.accounts.append(
            Account("scheme", basin.name, "basin", tuple(range(at, at + 5)), (1, *[-1] * 4))
        )
