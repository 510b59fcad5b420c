"""Energy accounts of masses and bodies, see `model.energy_accounts`, and their energy at the start."""

from fvsolve.core.assembly.lowering import rows_in


def energies_at_start(motion) -> dict[str, float]:
    """Energy of masses, springs and stops at the start [J], above that at rest without forces : name -> energy."""
    case, energies = motion.case, {}
    for name, row in zip(motion.mass_names, motion.mass_table, strict=False):
        if row["y"] >= 0:
            energies[name] = 0.5 * row["velocity"] ** 2 / row["lightness"]
    for (name, *_), row in zip(rows_in(case, "brace"), motion.brace_table, strict=True):
        if row["stiffness"] > 0.0:
            energies[name] = 0.5 * row["force"] ** 2 / row["stiffness"]
    for (name, *_), row in zip(rows_in(case, "stop"), motion.stop_table, strict=True):
        energies[name] = 0.5 * row["stiffness"] * min(0.0, row["below"], row["above"]) ** 2
    return energies


def mass_accounts(motion, accounts) -> None:
    """Add accounts of masses, springs, dampers, forces, stops and pistons."""
    names = [*motion.mass_names, *[""] * (len(motion.mass_table) - len(motion.mass_names))]
    for name, row in zip(names, motion.mass_table, strict=True):
        at = accounts.take(1)
        accounts.hold(name, "mass", at if row["y"] >= 0 else None)
    for name, link, lowering in rows_in(motion.case, "brace"):
        at, stores = accounts.take(1), lowering.ledger_name == "stored"
        accounts.hold(name, link.kind, at if stores else None)
        if not stores:
            accounts.add(lowering.ledger_name, name, link.kind, at)
    for name, link, _ in rows_in(motion.case, "stop"):
        at = accounts.take(2)
        accounts.contacts.append((len(accounts.accounts), len(accounts.accounts) + 1))
        accounts.hold(name, link.kind, at)
        accounts.add("dissipated", name, link.kind, at + 1)
    for name in motion.piston_names:
        at = accounts.take(3)
        accounts.add("dissipated", name, "leak", at)
        accounts.add("dissipated", name, "friction", at + 1)
        accounts.add("law", name, "cylinder", at + 2)


def body_accounts(motion, accounts) -> None:
    """Add accounts of bushings and bodies."""
    for name in motion.bushing_names:
        at = accounts.take(2)
        accounts.hold(name, "bushing", at)
        accounts.add("dissipated", name, "bushing", at + 1)
    for name, row in zip(motion.body_names, motion.body_table, strict=True):
        at = accounts.take(3)
        accounts.hold(name, "body", at)
        if row["damping"] > 0.0:
            accounts.add("dissipated", name, "joint", at + 1)
        if row["schedule"] >= 0:
            accounts.add("supplied", name, "drive", at + 2)
