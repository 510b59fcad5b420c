"""Energy balance of a run: supplied, stored and dissipated energy, and energy changed by the numerical method."""

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fvsolve.errors import CaseError, FvsolveError, did_you_mean
from fvsolve.model.energy_accounts import Account, available_energy, datum_of
from fvsolve.schemes import SCHEMES
from fvsolve.solve import initial_state
from fvsolve.studies.energy.passivity import AUTO, check_names, method_names
from fvsolve.studies.energy.step_energy import EnergyRun
from fvsolve.studies.outcome import RowSink, end_if_interrupted, refusal_text, study_model
from fvsolve.studies.result_cache import ResultCache
from fvsolve.studies.result_table import Column
from fvsolve.validation import FUNCTION, TABLE, TEXT, validated

ROUNDING = 1e-12  # fraction of the energy throughput below which a remainder is rounding
IMPLIED_KINDS = ("valve", "pump", "damper", "pipe", "chamber", "tank")  # kinds omitted in names of ledger lines


@dataclass(frozen=True)
class Port:
    """Passivity at a port: the network may not return more energy than it had at the start and received elsewhere.

    Condition (2) of docs/course.md: E0 + W + O >= 0 at the end of every step. E0 is the available energy at the start,
    W the energy supplied at the port, and O the energy supplied by other ports. Heights are measured from the port.
    W is the integral over time of p q under the density law `linear`, with the gauge pressure p and the flow q into the
    network. Under other density laws it is that of M (h - h_ambient), with the mass flow M and the enthalpy h.
    node : name of the port; at_start : E0 [J]
    work : least value of W [J], reached at `time` [s]
    margin : least value of E0 + W + O [J], reached at `t_margin` [s]; others : O at that time [J]
    passive : True if the condition holds up to rounding
    course, bound : float64[k]  W and -(E0 + O) [J] at the times `Energy.t`
    text : verdict as a sentence, in the units of `[output]`
    """

    node: str
    work: float
    time: float
    at_start: float
    others: float
    margin: float
    t_margin: float
    passive: bool
    course: np.ndarray
    bound: np.ndarray
    text: str = ""

    def plain(self) -> dict:
        """Plain values for JSON, without the arrays."""
        return {name: value for name, value in vars(self).items() if np.ndim(value) == 0}


@dataclass(frozen=True)
class Energy:
    """Energy balance of a run: energies since the start of the run [J], at k times.

    reason : reason for the end of the run; ok : True if the run reached its end time
    t : float64[k]  start of the run, then ends of steps, at least a thousandth of the run apart except the last [s]
    supplied, stored, dissipated : {"PART" or "PART KIND": float64[k]}; stored energy is the change since the start
    scheme : {"PART": float64[k]}  energy removed by the discretisation of a pipe or basin in space, or by a delay line
    law : {"PART": float64[k]}  energy removed by a law of a part that conserves energy only approximately
    step : float64[k]  energy removed by the time steps; newton : float64[k]  energy of Newton residuals
    remainder : float64[k]  supplied - stored - dissipated, the sum of scheme, law, step and newton; positive if the
    numerical method dissipates energy, negative if it creates energy
    at_start : {"PART": available energy at the start [J]}; datum : elevation of zero height [m]
    settings : scheme, method, step control and number of cells of the run; steps : number of steps
    marks : texts on conditions outside the validity of the model, with the times from which on energies are not
    reliable
    port : passivity at a port, if checked
    """

    reason: str
    ok: bool
    t: np.ndarray
    supplied: dict[str, np.ndarray]
    stored: dict[str, np.ndarray]
    dissipated: dict[str, np.ndarray]
    scheme: dict[str, np.ndarray]
    law: dict[str, np.ndarray]
    step: np.ndarray
    newton: np.ndarray
    remainder: np.ndarray
    at_start: dict[str, float]
    datum: float
    settings: dict[str, object]
    steps: int
    marks: list[str]
    port: Port | None = None

    @property
    def throughput(self) -> float:
        """Energy throughput [J]: greatest sum, at any time, of the energy supplied by ports and released by parts."""
        total = np.zeros(len(self.t))
        for values in self.supplied.values():
            total += np.maximum(values, 0.0)
        for values in self.stored.values():
            total += np.maximum(-values, 0.0)
        return float(total.max(initial=0.0))

    @property
    def numerical_remainder(self) -> np.ndarray:
        """Energy removed by scheme, law and time steps, without Newton residuals : float64[k] [J]."""
        return self.remainder - self.newton

    @property
    def relative(self) -> float:
        """Magnitude of `numerical_remainder` at the end of the run over `throughput` [-]; 0 without throughput."""
        return 0.0 if self.throughput == 0.0 else float(abs(self.numerical_remainder[-1]) / self.throughput)

    @property
    def newton_counts(self) -> bool:
        """True if the energy of Newton residuals exceeds rounding errors at any time."""
        return bool(np.max(np.abs(self.newton)) > ROUNDING * self.throughput)

    @property
    def verdict(self) -> str:
        """Effect of the numerical method on the energy at the end of the run: dissipates, creates, or rounding only.

        Newton residuals do not count, because they are not a property of scheme and method.
        """
        if self.relative <= ROUNDING:
            return "rounding"
        return "the numbers dissipate" if self.numerical_remainder[-1] > 0.0 else "the numbers create energy"

    def numerical(self) -> dict[str, np.ndarray]:
        """Remainder by cause, as float64[k] [J]: "scheme", "law", "step", "newton", and their sum "remainder".

        Causes that are always zero are left out, as is "newton" if it never exceeds rounding errors.
        """
        zeros = np.zeros(len(self.t))
        causes = {"scheme": sum(self.scheme.values(), zeros), "law": sum(self.law.values(), zeros), "step": self.step,
                  "newton": self.newton if self.newton_counts else zeros}  # fmt: skip
        return {name: values for name, values in causes.items() if values.any()} | {"remainder": self.remainder}

    def plain(self) -> dict:
        """Plain values for JSON: energies at the end of the run, verdict, settings, and passivity at the port."""
        lines = {json_name: {name: float(values[-1]) for name, values in getattr(self, kind).items()}
                 for kind, json_name in JSON_NAMES.items()}  # fmt: skip
        port = None if self.port is None else self.port.plain()
        return {
            "reason": self.reason, "ok": self.ok, "t": float(self.t[-1]), "steps": self.steps, **self.settings, **lines,
            "step_loss": float(self.step[-1]), "newton_loss": float(self.newton[-1]),
            "remainder": float(self.remainder[-1]), "through": self.throughput, "relative": self.relative,
            "verdict": self.verdict, "datum": self.datum, "at_start": self.at_start, "marks": self.marks, "port": port,
        }  # fmt: skip


JSON_NAMES = {"supplied": "supplied", "stored": "stored", "dissipated": "dissipated", "scheme": "scheme_loss",
         "law": "law_loss"}  # fmt: skip


@validated(set=TABLE, port=TEXT, progress=FUNCTION)
def energy(case, set=None, port: str | None = None, progress=None) -> Energy:
    """Run a case with changed keys and compute its energy balance; `case` as for `run`, or a Model.

    port : a reservoir, inflow or junction, at which condition (2) of passivity is checked (see `Port`)
    set : key -> value, ignored for a Model; progress : called as progress(t, seconds, steps)
    A run that fails or is interrupted gives the balance up to its end. Raises CaseError for an invalid case, and
    FvsolveError for an unknown port and for a case whose energy is not computed (see `Accounts`).
    """
    model = study_model(case, set) if not hasattr(case, "tables") else case
    check_port(model.case, port)
    settings = model.tables.settings.copy()
    settings["datum"] = datum_of(model, port)
    model = replace(model, tables=model.tables._replace(settings=settings))
    run = EnergyRun(model, initial_state(model), RowSink(), progress)
    summary = run.go()
    if run.times[-1] < run.loop.t:
        run.add_row()
    return ledger(run, summary, port)


def ledger(run: EnergyRun, summary, port: str | None) -> Energy:
    """Energy balance of a finished run, from its recorded energies; summary : its `Summary`; port : as in `energy`."""
    accounts, totals, holdings = run.accounts, np.array(run.totals), np.array(run.holdings)
    kinds = ("supplied", "dissipated", "scheme", "law")
    lines = {kind: lines_by_name(accounts.accounts, kind, totals) for kind in kinds}
    stored = lines_by_name(accounts.stored_accounts, "stored", holdings)
    impact_losses = np.array(run.losses)
    for name, column in zip(run.model.column_names, impact_losses.T, strict=True):
        if column.any():
            lines["dissipated"][f"{name} stopped dead"] = column
    zeros, stored_sum = np.zeros(len(run.times)), holdings.sum(axis=1)
    supplied, dissipated = (sum(lines[kind].values(), zeros) for kind in ("supplied", "dissipated"))
    numerics = run.model.case.numerics
    settings = {key: getattr(numerics, key) for key in ("scheme", "method", "courant", "step", "rtol")}
    reason = "interrupted" if summary.reason.startswith("interrupted") else summary.reason
    return Energy(
        reason, summary.finished, np.array(run.times), lines["supplied"], stored, lines["dissipated"],
        lines["scheme"], lines["law"], totals[:, accounts.of("rate")].sum(axis=1)
        - impact_losses.sum(axis=1) - stored_sum,
        totals[:, -1], supplied - stored_sum - dissipated, available_energy(run.model),
        float(run.model.tables.settings[0]["datum"]), settings | {"cells": run.model.cells}, summary.steps,
        [f"{mark.text}: the energy balance from {run.model.case.amount(mark.time, 'time', 6)} on is not to be trusted"
         for mark in summary.marks],
        None if port is None else port_verdict(run, port),
    )  # fmt: skip


def lines_by_name(accounts: list[Account], kind: str, columns: np.ndarray) -> dict[str, np.ndarray]:
    """Energies [J] of the accounts of a category that are not always zero : "PART" or "PART KIND" -> float64[rows].

    The kind is stated for dissipated energy, except for the kinds that the part implies (`IMPLIED_KINDS`), and for flow
    over the rim. Energies of accounts with the same name are added.
    kind : category, such as "dissipated"; columns : float64[rows, accounts]  energies of all accounts [J]
    """
    lines = {}
    for k, account in enumerate(accounts):
        if account.category == kind and columns[:, k].any():
            several = kind == "dissipated" and account.kind not in IMPLIED_KINDS or account.kind == "over the rim"
            name = f"{account.place} {account.kind}" if several else account.place
            lines[name] = lines.get(name, 0.0) + columns[:, k]
    return lines


def check_port(case, port: str | None) -> None:
    """Raise FvsolveError if `port` is not a reservoir, inflow or junction of the case; None is accepted."""
    ports = [name for name, node in case.places.items() if node.driven is not None]
    if port is not None and port not in ports:
        hint = did_you_mean(port, ports) or f". Ports are {', '.join(ports)}"
        hint = hint if ports else "; the case has no such node"
        raise FvsolveError(f'no port named "{port}". Expected a reservoir, an inflow or a junction{hint}')


def port_verdict(run: EnergyRun, port: str) -> Port:
    """Check condition (2) of passivity (see `Port`) at every step of a run; port : name of the node."""
    lines, totals = run.accounts.accounts, np.array(run.step_totals)
    own_lines = [k for k, account in enumerate(lines) if account.category == "supplied" and account.place == port]
    supplied_lines = run.accounts.of("supplied")
    work = totals[:, own_lines].sum(axis=1)
    others = totals[:, supplied_lines].sum(axis=1) - work
    at_rows = np.searchsorted(run.step_times, run.times, side="right") - 1
    start = sum(available_energy(run.model).values())
    margin = start + work + others
    least, worst = int(np.argmin(work)), int(np.argmin(margin))
    size = start + np.max(np.abs(work)) + np.max(np.abs(others))
    t = run.step_times
    verdict = Port(
        port, float(work[least]), float(t[least]), start, float(others[worst]), float(margin[worst]), float(t[worst]),
        bool(margin[worst] >= -ROUNDING * size), work[at_rows], -(start + others)[at_rows],
    )  # fmt: skip
    return replace(verdict, text=port_text(verdict, run.model.case))


def port_text(port: Port, case) -> str:
    """Verdict on the passivity at a port as a sentence, in the units of `[output]` of the case."""
    energies = port.work, 0.0 - port.at_start, -(port.at_start + port.others), port.others, port.margin
    work, least, own_bound, others, margin = (case.amount(value, "energy", 6) for value in energies)
    if port.others:
        bound = f"-(E0 + others) = {own_bound} (E0: energy stored at the start; others: {others} from other ports)"
    else:
        bound = f"-E0 = {least} (E0: energy stored at the start)"
    verdict = "passive over this run" if port.passive else "NOT passive: the network supplied more energy than it had"
    time, margin_time = (case.amount(value, "time", 6) for value in (port.time, port.t_margin))
    return (f"port {port.node}: integral of p q falls to {work} at {time}, its bound is {bound}; "
            f"least margin {margin} at {margin_time}: {verdict}")  # fmt: skip


def write_table(result: Energy, path: Path) -> None:
    """Write an energy balance to the file `path` as CSV: accounts, remainders and W at the port [J] at times [s]."""
    columns = {"t [s]": result.t}
    for kind in ("supplied", "stored", "dissipated", "scheme", "law"):
        columns |= {f"{kind} {name} [J]": values for name, values in getattr(result, kind).items()}
    if result.port is not None:
        columns |= {"integral of p q [J]": result.port.course, "bound [J]": result.port.bound}
    columns |= {"step [J]": result.step, "newton [J]": result.newton, "remainder [J]": result.remainder}
    text = [",".join(columns)]
    text += [",".join(repr(float(x)) for x in row) for row in np.column_stack(list(columns.values()))]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")


PAIR_COLUMNS = (  # columns of a row
    Column("scheme"),
    Column("method"),
    Column("remainder", words=".4g", head="remainder [J]"),
    Column("scheme_loss", words=".4g", head="by the scheme [J]"),
    Column("step_loss", words=".4g", head="by the step [J]"),
    Column("newton_loss", words=".4g", head="by Newton residuals [J]"),
    Column("least", words=".4g", head="least remainder [J]"),
    Column("relative", words=".4g", head="over throughput"),
    Column("creates", head="creates energy"),
    Column("margin", words=".4g", head="margin at the port [J]"),
    Column("reason", words=lambda row: row["reason"].partition(":")[0], head="run"),
)


def measure_pairs(
    case, schemes=None, methods=None, port: str | None = None, progress=None, points=None, watch=None
) -> list[dict]:
    """Run a case with every pair of scheme and method; returns a row (dict) with the energy remainders of each pair.

    Entries of a row are those of `PAIR_COLUMNS`. remainder, scheme_loss, step_loss, newton_loss : energies at the end
    [J], see `Energy`; least : least value over time of the remainder without Newton residuals [J]
    creates : True if `least` is below zero by more than rounding, or if the run failed; None if it was refused
    margin : least margin of the passivity at the port [J], see `Port`; None without a port
    If the pair was refused, all entries except scheme, method and reason are None.

    schemes, methods : names (default those of the case); progress : called as progress(done, total, next)
    points : `ResultCache` of earlier rows; watch : called as watch(t, seconds, steps) during every run
    A pair that is refused or diverges gives a row with its reason. Raises FvsolveError for unknown names and for a case
    whose energy is not computed (see `Accounts`), and KeyboardInterrupt if a run is interrupted.
    """
    check_port(case, port)
    points = points or ResultCache()
    schemes = check_names(schemes or [case.numerics.scheme], list(SCHEMES), "scheme")
    methods = check_names(methods or [case.numerics.method], [*method_names(), AUTO], "method")
    rows, total = [], len(schemes) * len(methods)
    for scheme in schemes:
        for method in methods:
            if progress is not None:
                progress(len(rows), total, f"{scheme} with {method}")
            pair = {"scheme": scheme, "method": method}
            make = functools.partial(pair_result, case, scheme, method, port, watch)
            rows.append(pair | points.get(case, pair | {"study": "energy", "port": port}, make))
    return rows


def pair_result(case, scheme: str, method: str, port: str | None, watch=None) -> dict:
    """Row of a pair: energy remainders of a run of the case with this scheme and method, see `measure_pairs`."""
    missing = {column.key: None for column in PAIR_COLUMNS if column.key not in ("scheme", "method", "reason")}
    try:
        result = energy(case, {"numerics.scheme": scheme, "numerics.method": method}, port, watch)
    except CaseError as error:
        return missing | {"reason": refusal_text(error)}
    end_if_interrupted(result.reason)
    losses = [float(values[-1]) for values in result.scheme.values()]
    sound = result.ok and bool(np.all(np.isfinite(result.remainder)))
    least = float(np.min(result.numerical_remainder))
    return missing | {
        "remainder": float(result.remainder[-1]), "scheme_loss": sum(losses), "step_loss": float(result.step[-1]),
        "newton_loss": float(result.newton[-1]),
        "least": least, "relative": result.relative, "creates": not sound or least < -ROUNDING * result.throughput,
        "margin": None if result.port is None else result.port.margin, "reason": result.reason,
    }  # fmt: skip
