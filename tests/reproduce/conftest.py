from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest

from navfw.reproduce import compare_metrics, paper_tables, reproduction


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    """Few views in the comparison of metrics, which has tests of its own; few repeats of times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            reproduction, "compare_metrics", lambda _, seed, report: compare_metrics(4, seed)
        )
        patch.setattr(reproduction, "timings", partial(paper_tables.timings, repeats=2))
        yield
