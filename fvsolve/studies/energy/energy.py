"""Where the energy of a run comes from, where it stays and what the numbers take. Knows runs; prints nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fvsolve.doors import CALL, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.model.energy_ledger import Account
from fvsolve.model.energy_start import available, datum_of
from fvsolve.solve import initial_state
from fvsolve.studies.energy.booking import EnergyRun
from fvsolve.studies.outcome import RowSink, prepared

ROUNDING = 1e-12  # share of what passed below which a remainder is rounding
SHORT = ("valve", "pump", "damper", "pipe", "chamber", "tank")  # kinds that a line need not name


@dataclass(frozen=True)
class Port:
    """Condition (2) at one port: E0 + integral of p q >= 0, p from ambient, heights from the port's.

    work : the integral at its least [J], at `time` [s]; at_start : E0, what the network could give at the start;
    others : what other ports had supplied at the least margin; margin : least of E0 + work + others. course, bound :
    float64[k]  the integral and -(E0 + others) at the rows of the ledger [J]; text : the verdict as a sentence, in the
    units of `[output]`.
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
        """For JSON, without its course."""
        return {name: one for name, one in vars(self).items() if np.ndim(one) == 0}


@dataclass(frozen=True)
class Energy:
    """The ledger of a run, row by row at ends of steps; cumulative since the start [J].

    t : float64[k] [s]; supplied, stored, dissipated : {"PART": float64[k]}, stored as change since the start;
    scheme, law : {"PART": float64[k]}  what the cells of a pipe, or a law that is no exact one, take up; step :
    float64[k]  what the steps take up; newton : float64[k]  what Newton leaves of its equations; remainder = supplied -
    stored - dissipated, all four together: positive where the numbers dissipate, negative where they create.
    at_start : {"PART": J} that was there to be had; datum : elevation from which heights count [m]; marks : what the
    model carried on through, from when on.
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
    def through(self) -> float:
        """Greatest energy that ports had supplied and parts had given away together [J]."""
        total = np.zeros(len(self.t))
        for one in self.supplied.values():
            total += np.maximum(one, 0.0)
        for one in self.stored.values():
            total += np.maximum(-one, 0.0)
        return float(total.max(initial=0.0))

    @property
    def made(self) -> np.ndarray:
        """The remainder without what Newton leaves: what scheme, law and step take up : float64[k] [J]."""
        return self.remainder - self.newton

    @property
    def relative(self) -> float:
        """|made| at the end over `through`; 0 where nothing passed."""
        return 0.0 if self.through == 0.0 else float(abs(self.made[-1]) / self.through)

    @property
    def newton_counts(self) -> bool:
        """Whether what Newton leaves is ever more than rounding."""
        return bool(np.max(np.abs(self.newton)) > ROUNDING * self.through)

    @property
    def verdict(self) -> str:
        """What the remainder means; what Newton leaves is no property of scheme and method and is not counted."""
        if self.relative <= ROUNDING:
            return "rounding"
        return "the numbers dissipate" if self.made[-1] > 0.0 else "the numbers create energy"

    def numerical(self) -> dict[str, np.ndarray]:
        """The remainder by cause: scheme, law, step and Newton; what is zero throughout is left out."""
        none = np.zeros(len(self.t))
        causes = {"scheme": sum(self.scheme.values(), none), "law": sum(self.law.values(), none), "step": self.step,
                  "newton": self.newton if self.newton_counts else none}  # fmt: skip
        return {name: one for name, one in causes.items() if one.any()} | {"remainder": self.remainder}

    def plain(self) -> dict:
        """For JSON; the ledger at the end, its course is in the table."""
        lines = {said: {name: float(one[-1]) for name, one in getattr(self, what).items()}
                 for what, said in PLAIN.items()}  # fmt: skip
        port = None if self.port is None else self.port.plain()
        return {
            "reason": self.reason, "ok": self.ok, "t": float(self.t[-1]), "steps": self.steps, **self.settings, **lines,
            "step_loss": float(self.step[-1]), "newton_loss": float(self.newton[-1]),
            "remainder": float(self.remainder[-1]), "through": self.through, "relative": self.relative,
            "verdict": self.verdict, "datum": self.datum, "at_start": self.at_start, "marks": self.marks, "port": port,
        }  # fmt: skip


PLAIN = {"supplied": "supplied", "stored": "stored", "dissipated": "dissipated", "scheme": "scheme_loss",
         "law": "law_loss"}  # fmt: skip


@door(set=TABLE, port=TEXT, progress=CALL)
def energy(case, set=None, port: str | None = None, progress=None) -> Energy:
    """The ledger of energy of a run of a case with keys changed; `case` as `run` takes it, or a Model.

    port : a reservoir, inflow or junction with a demand, at which (2) is judged. progress(t, seconds, steps).
    Raises CaseError where the case cannot start, FvsolveError for an unknown port.
    """
    model = prepared(case, set) if not hasattr(case, "tables") else case
    check_port(model.case, port)
    settings = model.tables.settings.copy()
    settings["datum"] = datum_of(model, port)
    model = replace(model, tables=model.tables._replace(settings=settings))
    run = EnergyRun(model, initial_state(model), RowSink(), progress)
    summary = run.go()
    if run.times[-1] < run.loop.t:
        run.keep()
    return ledger(run, summary, port)


def ledger(run: EnergyRun, summary, port: str | None) -> Energy:
    """What a run has kept, line by line."""
    accounts, totals, holdings = run.accounts, np.array(run.totals), np.array(run.holdings)
    lines = {what: by_name(accounts.accounts, what, totals) for what in ("supplied", "dissipated", "scheme", "law")}
    stored = by_name(accounts.held, "stored", holdings)
    dead = np.array(run.losses)
    for name, column in zip(run.model.column_names, dead.T, strict=True):
        if column.any():
            lines["dissipated"][f"{name} stopped dead"] = column
    none, kept = np.zeros(len(run.times)), holdings.sum(axis=1)
    supplied, dissipated = (sum(lines[what].values(), none) for what in ("supplied", "dissipated"))
    numerics = run.model.case.numerics
    settings = {key: getattr(numerics, key) for key in ("scheme", "method", "courant", "step", "rtol")}
    reason = "interrupted" if summary.reason.startswith("interrupted") else summary.reason
    return Energy(
        reason, summary.finished, np.array(run.times), lines["supplied"], stored, lines["dissipated"],
        lines["scheme"], lines["law"], totals[:, accounts.of("rate")].sum(axis=1) - dead.sum(axis=1) - kept,
        totals[:, -1], supplied - kept - dissipated, available(run.model),
        float(run.model.tables.settings[0]["datum"]), settings | {"cells": run.model.cells}, summary.steps,
        [f"{mark.text}: the ledger from {run.model.case.amount(mark.time, 'time', 6)} on is not to be trusted"
         for mark in summary.marks],
        None if port is None else judged(run, port),
    )  # fmt: skip


def by_name(accounts: list[Account], what: str, columns: np.ndarray) -> dict[str, np.ndarray]:
    """The lines of one kind that ever differ from zero, "PART" or "PART KIND" where a part has several."""
    found = {}
    for k, one in enumerate(accounts):
        if one.what == what and columns[:, k].any():
            several = what == "dissipated" and one.kind not in SHORT or one.kind == "over the rim"
            name = f"{one.place} {one.kind}" if several else one.place
            found[name] = found.get(name, 0.0) + columns[:, k]
    return found


def check_port(case, port: str | None) -> None:
    """FvsolveError where a node of a case is no port."""
    known = [name for name, node in case.places.items() if node.driven is not None]
    if port is not None and port not in known:
        hint = did_you_mean(port, known) or f"; these are {', '.join(known)}"
        hint = hint if known else ", and this case has none"
        raise FvsolveError(f'no port named "{port}": wanted a reservoir, an inflow or a junction{hint}')


def judged(run: EnergyRun, port: str) -> Port:
    """Condition (2) over a run, at every step; heights count from the port."""
    lines, totals = run.accounts.accounts, np.array(run.step_totals)
    own = [k for k, one in enumerate(lines) if one.what == "supplied" and one.place == port]
    every = run.accounts.of("supplied")
    work = totals[:, own].sum(axis=1)
    others = totals[:, every].sum(axis=1) - work
    at_rows = np.searchsorted(run.step_times, run.times, side="right") - 1
    start = sum(available(run.model).values())
    margin = start + work + others
    least, worst = int(np.argmin(work)), int(np.argmin(margin))
    size = start + np.max(np.abs(work)) + np.max(np.abs(others))
    t = run.step_times
    found = Port(
        port, float(work[least]), float(t[least]), start, float(others[worst]), float(margin[worst]), float(t[worst]),
        bool(margin[worst] >= -ROUNDING * size), work[at_rows], -(start + others)[at_rows],
    )  # fmt: skip
    return replace(found, text=said(found, run.model.case))


def said(port: Port, case) -> str:
    """The verdict at a port as a sentence."""
    work, least, own, others, margin = (
        case.amount(one, "energy", 6)
        for one in (port.work, 0.0 - port.at_start, -(port.at_start + port.others), port.others, port.margin)
    )
    bound = f"-(E0 + others) = {own}, {others} of it from other ports" if port.others else f"-E0 = {least}"
    verdict = "passive over this run" if port.passive else "NOT passive: it gave more than it had"
    when, then = (case.amount(one, "time", 6) for one in (port.time, port.t_margin))
    return (f"port {port.node}: integral of p q falls to {work} at {when}, its bound is {bound}; "
            f"least margin {margin} at {then}: {verdict}")  # fmt: skip


def write_table(one: Energy, path: Path) -> None:
    """energy.csv: time, then every line of the ledger [J], at ends of steps."""
    columns = {"t [s]": one.t}
    for what in ("supplied", "stored", "dissipated", "scheme", "law"):
        columns |= {f"{what} {name} [J]": values for name, values in getattr(one, what).items()}
    if one.port is not None:
        columns |= {"integral of p q [J]": one.port.course, "bound [J]": one.port.bound}
    columns |= {"step [J]": one.step, "newton [J]": one.newton, "remainder [J]": one.remainder}
    text = [",".join(columns)]
    text += [",".join(repr(float(x)) for x in row) for row in np.column_stack(list(columns.values()))]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
