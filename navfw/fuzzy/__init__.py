"""Fuzzy inference: rule bases as data, a compiled evaluator, and scikit-fuzzy as its reference.

``rulebase`` is the plain data with its grammar, ``rulespec`` the schema of its file, ``coverage``
the check that rules cover all inputs, and ``rulefile`` loads. ``compiled_fis`` evaluates in
missions; ``fis_benchmark`` evaluates the same rule base through scikit-fuzzy, in tests and
benchmarks. Names are imported on first access: to read and check a rule base neither is needed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
