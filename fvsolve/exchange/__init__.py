"""Files and models of other programs: EPANET networks, functional mock-up units; may import studies."""
