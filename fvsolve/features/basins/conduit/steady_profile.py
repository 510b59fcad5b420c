"""Gradually varied flow in a conduit, for the water at the start.

The energy E = h + Q^2 / (2 g A^2) changes by the slope of the invert minus that of friction, from step to step by the
trapezoidal rule. Subcritical depths follow from the depth at the lower end, at least the critical depth, and
supercritical depths from the critical depth at the upper end. The greater specific force Q^2 / A + g I prevails, so a
hydraulic jump stands between both (Chow 1959).

Common arguments: section : `SlottedSection`; rough : of the wall, see `drag_per_flow`; flow : Q above 0, along x
[m3/s]; fall : of the invert over the conduit [m]; length [m]; end : depth at the lower end that its node gives [m]
depths : float64[cells + 2]  depths at the upper end, at the centres of cells, and at the lower end [m]
"""

from math import sqrt

from fvsolve.features.basins.conduit.conduit_cells import drag_per_flow
from fvsolve.jit import njit
from fvsolve.parts.conduit.law_section import celerity, section_at_depth

HALVINGS = 60  # of an interval that contains a root


@njit
def critical_flow(section, h):
    """Flow A c at a depth h [m3/s], at most that of Torricelli, A sqrt(2 g h)."""
    area, width, _ = section_at_depth(section, h)
    return area * min(celerity(section, width, area), sqrt(2.0 * section.g * max(h, 0.0)))


@njit
def critical_depth_of(section, flow):
    """Depth [m] at which a flow has the speed of waves."""
    low, high = 0.0, section.depth
    for _ in range(HALVINGS):
        h = 0.5 * (low + high)
        area, width, _ = section_at_depth(section, h)
        low, high = (h, high) if area * celerity(section, width, area) < flow else (low, h)
    return high


@njit
def energy_beyond(section, rough, flow, h, way):
    """Energy [m] at a depth h, plus `way` [m] times the slope of friction there."""
    area = section_at_depth(section, h)[0]
    slope = drag_per_flow(section, rough, h, area) * flow * flow / (section.g * area)
    return h + flow * flow / (2.0 * section.g * area * area) + way * slope


@njit
def depth_at_energy(section, rough, flow, energy, critical, way):
    """Depth at which `energy_beyond` is `energy`: subcritical for a way below 0, else supercritical; else critical."""
    low, high = (critical, critical + max(energy, 0.0)) if way < 0.0 else (0.0, critical)
    for _ in range(HALVINGS):
        h = 0.5 * (low + high)
        is_low = (energy_beyond(section, rough, flow, h, way) < energy) == (way < 0.0)
        low, high = (h, high) if is_low else (low, h)
    return low if way < 0.0 else high


@njit
def put_profile(section, flow, rough, fall, length, end, depths):
    """Write gradually varied depths; return the subcritical depth at the upper end [m], which the lower end gives."""
    count, critical = depths.size, critical_depth_of(section, flow)
    dx, h = length / (count - 2), max(end, critical)
    depths[count - 1] = h
    for i in range(count - 2, -1, -1):
        half = 0.25 * dx if i == count - 2 or i == 0 else 0.5 * dx
        energy = energy_beyond(section, rough, flow, h, half) - 2.0 * half * fall / length
        h = depth_at_energy(section, rough, flow, energy, critical, -half)
        depths[i] = h
    upper, h = depths[0], critical
    for i in range(count):
        half = 0.0 if i == 0 else 0.25 * dx if i == 1 or i == count - 1 else 0.5 * dx
        if half > 0.0:
            energy = energy_beyond(section, rough, flow, h, -half) + 2.0 * half * fall / length
            h = depth_at_energy(section, rough, flow, energy, critical, half)
        (area, _, thrust), (wet, _, force) = (
            section_at_depth(section, h),
            section_at_depth(section, depths[i]),
        )
        if flow * flow / area + section.g * thrust > flow * flow / wet + section.g * force:
            depths[i] = h
    return upper
