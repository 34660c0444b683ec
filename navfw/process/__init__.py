"""What owns a run and its output: atomic files, locks, interruption, watchdog, progress."""
