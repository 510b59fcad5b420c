"""Notices of unusual flows at the start."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.errors import Notice, listing

MAX_VELOCITY = 60.0  # of pipe flow [m/s]: penstocks are below 10, jets of 180 m of head reach it
LAMINAR, NO_FLOW = 2000.0, 1.0  # Reynolds numbers below which a flow is laminar, or negligible
# pipes [m] and liquids [kg/m3] with normally turbulent flow: water mains, not oil hydraulics
WIDE_PIPE, WATER_DENSITIES = 0.05, (950.0, 1050.0)


def flow_notices(draft: Any) -> list[Notice]:
    """Notices of high velocity and of laminar flow of water, at most one of each kind, for the worst pipe or column."""
    moving = _flows(draft)
    return [*_fast_flow(draft, *moving), *_laminar_flow(draft, *moving)]


def _flows(draft: Any) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Pipes and rigid columns of the case file : (names, flows at the start [kg/s], areas [m2])."""
    tables = ((draft.pipe_names, draft.pipe_table), (draft.column_names, draft.column_table))
    rows = [(name, row["flow"], row["area"]) for names, table in tables for name, row in zip(names, table, strict=True)
            if name in draft.case.links]  # fmt: skip
    return [row[0] for row in rows], *np.array([row[1:] for row in rows]).reshape(-1, 2).T


def _fast_flow(draft: Any, names: list[str], flow: np.ndarray, area: np.ndarray) -> list[Notice]:
    speed = np.abs(flow) / (draft.fluid.density * area)
    if not (speed > MAX_VELOCITY).any():
        return []
    worst = int(np.argmax(speed))
    fastest, limit = (draft.case.amount(velocity, "velocity") for velocity in (speed[worst], MAX_VELOCITY))
    text = (f"{_listed(names, speed > MAX_VELOCITY)}: {fastest} at the start in {names[worst]}, above "
            f"{limit}; check the units of flow and diameter")  # fmt: skip
    return [Notice("range", f"links.{names[worst]}", text, "flow", float(speed[worst]), MAX_VELOCITY)]


def _laminar_flow(draft: Any, names: list[str], flow: np.ndarray, area: np.ndarray) -> list[Notice]:
    """List with a notice if water flows in wide pipes with laminar Reynolds numbers only; else empty.

    The probable cause is a wrong unit of flow or viscosity.
    """
    fluid = draft.fluid
    if not names or not fluid.viscosity or not WATER_DENSITIES[0] <= fluid.density <= WATER_DENSITIES[1]:
        return []
    bore = np.sqrt(4.0 / np.pi * area)
    reynolds = np.where(bore >= WIDE_PIPE, np.abs(flow) * bore / (area * fluid.viscosity), 0.0)
    worst = int(np.argmax(reynolds))
    if not NO_FLOW < reynolds[worst] < LAMINAR:
        return []
    text = (f"{names[worst]}: Reynolds number {reynolds[worst]:.4g} at the start, laminar, which is unusual for "
            f"water in pipes this wide; check the flow, {draft.case.amount(abs(flow[worst]) / fluid.density, 'flow')}, "
            f"and the viscosity, {fluid.viscosity:.4g} Pa s")  # fmt: skip
    return [Notice("range", f"links.{names[worst]}", text, "reynolds", float(reynolds[worst]), LAMINAR)]


def _listed(names: list[str], chosen: np.ndarray) -> str:
    return listing([name for name, included in zip(names, chosen, strict=True) if included], 6)
