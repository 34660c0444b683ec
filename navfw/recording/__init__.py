"""Recording: what a run leaves behind - the run folder, the picture, the sensor readings."""
