"""Run-up on shores: greatest surface at the highest wet cell, by direction about a point or along a line."""

from dataclasses import dataclass

import numpy as np

TURN = 360.0  # [deg]


@dataclass(frozen=True)
class RunUpTable:
    """Run-up in the sectors about a point, or in the parts of a line; NaN where no cell became wet.

    along : "angle" (anticlockwise from the x axis) or "distance" (from the start of the line); unit : "deg" or "m"
    places : float64[sectors]  angles [deg] or distances [m] of the middles of the sectors
    run_up : float64[sectors]  greatest level of the surface above the level of the basin at rest [m]
    points : float64[sectors, 2]  centres of the cells with these values [m]
    """

    along: str
    unit: str
    places: np.ndarray
    run_up: np.ndarray
    points: np.ndarray

    @property
    def greatest(self) -> int:
        """Index of the sector with the greatest run-up; 0 if no cell became wet."""
        return int(np.argmax(np.where(np.isnan(self.run_up), -np.inf, self.run_up)))

    def value(self, function: str, place: float | None) -> float:
        """Value of `max`, `min` or `at` in `[expect]` [m]; place : angle [deg] or distance [m], for `at`"""
        if function == "at":
            return float(
                self.run_up[sector_of(np.array(place), self.along == "angle", self.places)]
            )
        known = self.run_up[~np.isnan(self.run_up)]
        return float(known.max() if function == "max" else known.min()) if known.size else np.nan

    def plain(self) -> dict:
        """Entry of the summary, in m and degrees."""
        at = self.greatest
        columns = {
            self.along: self.places,
            "run_up": self.run_up,
            "x": self.points[:, 0],
            "y": self.points[:, 1],
        }
        return {"greatest": self.run_up[at], f"greatest_{self.along}": self.places[at], **columns}


def sector_of(place: np.ndarray, turns: bool, places: np.ndarray) -> np.ndarray:
    """Numbers of the sectors with given angles [deg] (if `turns`) or distances [m]; places : middles of all sectors"""
    if turns:
        return np.floor(place * (places.size / TURN) + 0.5).astype(int) % places.size
    return np.clip(np.floor(place / (2.0 * places[0])).astype(int), 0, places.size - 1)


def run_up_table(spec, basin, surface: np.ndarray) -> RunUpTable:
    """Run-up of a basin: in each sector, the greatest surface over the level at rest in the highest cell that was wet.

    spec : `RunUp` of the case; surface : greatest elevation of the surface in each cell, NaN where never wet [m]
    """
    centre = basin.mesh.centre
    number = np.arange(spec.sectors)
    wet = ~np.isnan(surface)
    if spec.about is not None:
        x, y = (centre - spec.about).T
        places = TURN / spec.sectors * number
        along = "angle"
        unit = "deg"
        sector = sector_of(np.degrees(np.arctan2(y, x)), True, places)
        wet &= np.hypot(x, y) <= (np.inf if spec.radius is None else spec.radius)
    else:
        start, direction = np.array(spec.from_), np.subtract(spec.to, spec.from_) / spec.length
        places = spec.length / spec.sectors * (number + 0.5)
        along = "distance"
        unit = "m"
        distance = (centre - start) @ direction
        aside = np.abs((centre - start) @ (-direction[1], direction[0]))
        sector = sector_of(distance, False, places)
        wet &= (
            (distance >= 0.0)
            & (distance <= spec.length)
            & (aside <= (np.inf if spec.width is None else spec.width))
        )
    run_up = np.full(spec.sectors, np.nan)
    points = np.full((spec.sectors, 2), np.nan)
    cells = np.flatnonzero(wet)
    # rising bed; of equal beds the highest surface last, then the highest x, then y
    order = cells[np.lexsort((*centre[cells].T[::-1], surface[cells], basin.bed[cells]))]
    run_up[sector[order]] = surface[order] - (basin.part.elevation or 0.0) - basin.part.level
    points[sector[order]] = centre[order]
    return RunUpTable(along, unit, places, run_up, points)
