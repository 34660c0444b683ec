"""Fuzzy inference: rule bases as data, and a compiled evaluator.

``rulebase`` is the plain data with its grammar, ``rulespec`` the schema of its file, ``coverage``
the check that rules cover all inputs, and ``rulefile`` loads. ``compiled_fis`` evaluates. Names
are imported on first access: reading and checking a rule base needs no evaluator.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
