"""Every run of a mission in these tests fails its test where a plugin faults uninvited."""

from typing import Any

import pytest

from navfw.missions import MissionResult
from navfw.missions.session import Session


@pytest.fixture(autouse=True)
def no_plugin_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check the faults of every ``Session.run``; those that the mission injects are left out."""
    run = Session.run

    def checked(session: Session, *args: Any, **kwargs: Any) -> MissionResult:
        result = run(session, *args, **kwargs)
        assert not result.session.uninvited(result.faults)
        return result

    monkeypatch.setattr(Session, "run", checked)
