"""Pictures of runs. The only room that imports matplotlib and PyVista; knows numbers, knows no solver."""
