"""Tools that a person runs beside the processes: the command line, the bench, chaos, replay."""
