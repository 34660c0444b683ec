"""Check the ranges of parameters: both ends of every interval, and what is beyond them."""

import re
from collections.abc import Mapping

import pytest
from pydantic import BaseModel, ValidationError

_INTERVAL = re.compile(r"(\w+) ([\[(])(\S+), (\S+?)([\])])")


def check_ranges(model: type[BaseModel], ranges: Mapping[str, str] | str) -> None:
    """Assert that ``model`` accepts just the ``ranges``, as "a (0, 1], b [1, 9]", of its numbers.

    Integers have closed intervals. The model must be frozen and refuse unknown keys.
    """
    text = ranges if isinstance(ranges, str) else ", ".join(map(" ".join, ranges.items()))
    intervals = {name: interval for name, *interval in _INTERVAL.findall(text)}
    numbers = {
        name
        for name, value in model().model_dump().items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
    assert numbers == set(intervals)
    assert model.model_validate(model().model_dump()), "the defaults are within the ranges"
    for name, (first, low, high, last) in intervals.items():
        whole = isinstance(getattr(model(), name), int)
        for end, closed, outward in ((low, first == "[", -1), (high, last == "]", 1)):
            value = int(end) if whole else float(end)
            step = 1 if whole else 1e-6
            inside = value if closed else value - outward * step
            outside = value + outward * step if closed else value
            assert getattr(model(**{name: inside}), name) == inside
            with pytest.raises(ValidationError, match=name):
                model(**{name: outside})
    with pytest.raises(ValidationError, match="unknown_key"):
        model(unknown_key=1)
    some = next(iter(intervals))
    with pytest.raises(ValidationError, match="frozen"):
        setattr(model(), some, getattr(model(), some))
