"""Network of a case: parts of rotation, electricity and heat, whose flows and potentials are solved together."""

from __future__ import annotations

import copy
from collections.abc import Iterator

import numpy as np

from fvsolve.core.assembly.features import Feature, FeatureRun
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.errors import listing
from fvsolve.features.networks import lower, start
from fvsolve.features.networks.elimination import NetworkError
from fvsolve.features.networks.kernels import tables
from fvsolve.features.networks.network import Network

PACKAGE = "fvsolve.features.networks.kernels"
SHAFTS = RhsTerms(prepare="networks: turn_shafts", package=PACKAGE)
DRIVEN_SHAFTS = RhsTerms(decide="networks: drive_shafts", package=PACKAGE)
GIVEN = RhsTerms(events="networks: sources_for_events", package=PACKAGE)
FOLLOWED = RhsTerms(events="networks: sources_again", package=PACKAGE)
TERMS = RhsTerms(
    rate_limits="networks: known_sources",
    move="networks: network_rates",
    observe="networks: observe_networks",
    events="networks: switch_events",
    power="networks: power_networks",
    stored="networks: stored_networks",
    package=PACKAGE,
)
EXCHANGERS = RhsTerms(
    outlet_values="networks: node_temperatures",
    scalar_rates="networks: network_rates",
    package=PACKAGE,
)


class Networks(
    Feature,
    slot=3,
    wakes="domain rotational, domain electrical, domain thermal, element of a network",
):
    """Network of a case.

    network : its equations and numbers of its rows; None before it is lowered, or if no part has elements
    start_speeds : column of the network -> speed found for the start
    begun : steady start with which that of the network was computed, and can be computed again
    known : steady start, and the potentials that are known before its nodes are solved
    shafts : places whose speeds laws of devices read; other arrays : see `kernels.tables`
    """

    single_thread_reason = "parts of rotation, electricity and heat read the whole state"

    def __init__(self, case, given_up=()) -> None:
        super().__init__(case, given_up)
        self.network: Network | None = None
        self.start_speeds: dict[int, float] = {}
        self.begun = None
        self.known: tuple = (None, {})
        self.source_table, self.rates = (
            np.zeros(0, tables.NETWORK_INPUT),
            np.zeros(0, tables.NETWORK_RATE),
        )
        self.elements, self.switches = (
            np.zeros(0, tables.NETWORK_ELEMENT),
            np.zeros(0, tables.NETWORK_SWITCH),
        )
        self.settings = np.zeros(1, tables.NETWORK_SETTINGS)
        self.shafts: list[str] = []
        self.turned = self.turned_devices = self.thermal_rows = np.zeros(0, dtype=np.int64)

    # build ----------

    def lower_behind_meshes(self, draft) -> None:
        self.network = lower.lower_network(self, draft)

    def probe(self, draft, probe, row) -> bool:
        case = draft.case
        if (
            probe.name not in case.network_places
            or probe.name in case.places
            or probe.name in case.nodes
        ):
            return False
        # a place of the network alone: PUMP.shaft
        self.network.fill_node_probe(draft, row, probe.name, False)
        return True

    def rate(self, draft) -> float:
        return 0.0 if self.network is None else lower.network_rate(self.network)

    def reserve(self, draft) -> None:
        draft.sizes.out("shaft", len(self.shafts))
        draft.sizes.out("network", len(self.source_table))

    def placed(self, draft) -> None:
        self.settings[0]["inputs"] = draft.sizes.offsets["network"]

    # start ----------

    def prepare_start(self, draft, trial) -> None:
        if any(device.turns_with(part) is not None for _, part, device in draft.devices):
            from fvsolve.features.networks.speeds import balanced_speeds

            self.start_speeds = balanced_speeds(self, draft, trial)

    def potentials(self, begun) -> dict[str, float]:
        """Potentials of nodes that stores and schedules give at the start; begun : the steady start."""
        if self.known[0] is not begun:
            self.known = begun, start.known_potentials(self, begun.draft, begun)
        return self.known[1]

    def begin_motion(self, draft, begun) -> list[str]:
        if self.network is None:
            return []
        self.begun = begun
        return start.start_network(self, draft, begun)

    def accelerations(self, draft) -> dict[str, float]:
        return {} if self.begun is None else start.accelerations_of_masses(self, draft, self.begun)

    def copy_for(self, case) -> Networks:
        own = copy.copy(self)
        own.case, own.start_speeds, own.known = case, dict(self.start_speeds), (None, {})
        own.source_table, own.elements, own.switches = (
            self.source_table.copy(),
            self.elements.copy(),
            self.switches.copy(),
        )
        return own

    def close(self, draft) -> None:
        self.begun, self.known = None, (None, {})
        for array in (self.source_table, self.rates, self.elements, self.switches, self.settings):
            array.flags.writeable = False

    # model ----------

    def terms(self, model, cast) -> list[tuple[str, RhsTerms]]:
        if self.network is None:
            return []
        found = [("given", GIVEN), ("followed", FOLLOWED), ("devices", TERMS)]
        if self.shafts:
            found.append(("first", SHAFTS))
            # schedules that features set after `prepare`
            if (model.tables.schedules["pieces"] == 0).any():
                found.append(("pipes", DRIVEN_SHAFTS))
        return found + ([("carried", EXCHANGERS)] if len(self.thermal_rows) else [])

    def run(self, run_data) -> FeatureRun:
        return FeatureRun(self, run_data) if self.network is None else NetworkRun(self, run_data)

    def pattern(self, couplings):
        from fvsolve.features.networks.pattern import NetworkCouplings

        return (
            super().pattern(couplings)
            if self.network is None
            else NetworkCouplings(self, couplings)
        )

    def add_accounts(self, accounts) -> None:
        from fvsolve.features.networks.energy import add_accounts

        if self.network is not None:
            add_accounts(self.network, accounts)

    def energy_rows(self, model) -> Iterator[tuple[str, dict[int, float]]]:
        from fvsolve.features.networks.energy import norm_rows

        return iter(()) if self.network is None else norm_rows(self.network)

    def facts(self, model) -> dict:
        return {} if self.network is None else {"network": self.network.facts()}

    def check_texts(self, model, facts: dict) -> list[str]:
        return [] if self.network is None else network_texts(facts["network"])

    def remedy(self, event: str) -> str:
        switches = (
            []
            if self.network is None
            else [item.part.partition(".")[2] for item in self.network.switches]
        )
        return "give it more resistance or inertia" if event in switches else ""


def network_texts(facts: dict) -> list[str]:
    """Lines of `fvsolve check`: states, tied stores and passivity; facts : of `Network.facts`"""
    states = listing(facts["states"], 8) if facts["states"] else "none"
    text = (
        f"network: states {states}; {facts['eliminated']} further potentials and flows eliminated"
    )
    if facts["greatest"] is not None:
        verdict = "passive" if facts["passive"] else "not passive"
        text += f"; {verdict}, greatest eigenvalue of Q A + A' Q {facts['greatest']:.6g}"
    return [text, *(f"tied: {name} = {terms}" for name, terms in facts["tied"].items())]


class NetworkRun(FeatureRun):
    """Coefficients of a network in a run. mode : state of its switches for which they are written"""

    changes_flags = True

    def __init__(self, feature: Networks, run_data) -> None:
        super().__init__(feature, run_data)
        self.network = network = feature.network
        self.mode: tuple[bool, ...] | None = None
        count, capacity = network.rows.count, network.capacity
        self.places = np.zeros(3 * count + capacity, dtype=np.int64)
        self.factors = np.zeros(count + capacity)

    def tables(self, view: str = "") -> tables.NetworkTables:
        own = self.feature
        return tables.NetworkTables(
            own.source_table,
            own.rates,
            own.elements,
            own.switches,
            own.settings,
            own.turned,
            own.turned_devices,
            own.thermal_rows,
            self.places,
            self.factors,
        )

    def coefficients(self) -> list[np.ndarray]:
        return [self.places, self.factors]

    def follow_flags(self) -> None:
        mode = self.network.mode_of(self.run_data.armed)
        if mode == self.mode:
            return
        try:
            places, factors = self.network.arrays(mode)
        except NetworkError:  # the run ends, see `at_event`
            return
        self.places[: places.size], self.factors[: factors.size] = places, factors
        self.mode = mode

    def at_event(self, y: np.ndarray) -> str:
        """Change the coefficients, and the states that the new mode ties to others.

        Returns the text of a fault if the network has no solution, or if a switch would cut a flow. Diodes may take
        over the flow of a switch.
        """
        network, run_data = self.network, self.run_data
        if not network.switches:
            return ""
        mode = network.mode_of(run_data.armed)
        at, inputs = int(self.feature.settings[0]["inputs"]), self.feature.source_table
        sources = inputs["start"] + run_data.written.spare[at : at + len(inputs)]
        if text := network.fault_in(mode, y, sources):
            if (mode := network.commutated(mode, y, sources)) is None:
                return text
            network.set_diodes(mode, run_data.armed)
        self.follow_flags()
        network.settle(self.mode, y)
        return ""
