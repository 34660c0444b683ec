"""Data files: find them by name, read them safely, validate them with file and line of each error.

``lookup`` finds files by name, ``document`` reads YAML, ``overrides`` combines values, ``yamlfile``
validates against a pydantic model and words the errors.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
