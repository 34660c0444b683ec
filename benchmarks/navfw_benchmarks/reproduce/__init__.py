"""The paper's experiments repeated (sec 4.3 and 6): Tables 2 and 3, region metrics, timings."""
