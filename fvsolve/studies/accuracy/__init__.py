"""How fast errors fall, and what accuracy costs. Knows runs and errors; knows no stability."""
