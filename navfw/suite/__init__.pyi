from .suitefile import load_suite as load_suite
