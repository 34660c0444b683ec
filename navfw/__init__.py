"""navfw: a mobile robot with one camera finds its way by fuzzy behaviours.

All that a program, a behaviour or another plugin needs is imported from here; the rooms below are
inner ones, but for ``navfw.testing`` and ``navfw.gym``:

- ``run``, ``open_session`` and ``run_generated`` drive missions; ``open_run`` reads recordings;
- ``Stack`` drives a robot of your own: it takes a ``SensorReading`` and returns a ``Twist``;
- ``Behavior``, ``RuledBehavior`` and the other kinds of plugin, and what passes between the stages;
- ``NavfwError`` and what derives from it.

Each name is imported on first use, so that ``import navfw`` is fast; ``__init__.pyi`` lists them.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
