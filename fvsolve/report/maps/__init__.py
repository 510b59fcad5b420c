"""Maps in plan of basins and networks, for the page of a report and for pictures; may import all but cli."""
