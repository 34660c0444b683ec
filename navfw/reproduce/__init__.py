"""The paper's experiments again (sec 4.3 and 6): Tables 2 and 3, the metrics, the timings."""
