"""Recording: the run folder, the log of a run, its picture, sensor readings and their replay."""
