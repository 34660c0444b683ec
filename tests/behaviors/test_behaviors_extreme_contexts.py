"""No shipped behaviour, composite or fusion fails, whatever valid context it gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import REGISTRY, behavior_of, composite_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_contexts import COMMANDS, ROBOT, conflicts, contexts, drives, layers

from navfw.context import Context
from navfw.guard import check_proposal
from navfw.interfaces import Fusion
from navfw.signals import Conflicts, Proposal, Twist
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene

BASELINES = {"navground"}
"""Behaviours that need the simulator's truth and another package."""
PLAIN = contexts_of(BehaviorScene("open floor", Twist(0.3, 0.0)))[-1]
MANY = settings(suppress_health_check=[HealthCheck.too_slow])


def shipped(kind: str) -> list[str]:
    return sorted(
        plugin["name"]
        for plugin in REGISTRY.listing(kind)
        if plugin["status"] == "ok" and plugin["name"] not in BASELINES
    )


@pytest.mark.parametrize("name", shipped("behavior"))
@settings(MANY, max_examples=8)
@given(drive=drives())
def test_every_shipped_behavior_proposes_in_every_context(name: str, drive: list[Context]) -> None:
    behavior = behavior_of(name)
    for context in drive:
        proposal = behavior.propose(context)
        check_proposal(proposal, COMMANDS.shape)
        assert len(proposal.reason.splitlines()) == 1


@pytest.mark.parametrize("name", shipped("composite"))
@settings(MANY, max_examples=8)
@given(drive=drives())
def test_every_shipped_composite_weighs_in_every_context(name: str, drive: list[Context]) -> None:
    composite = composite_of(name)
    for context in drive:
        assert all(0.0 <= weight <= 1.0 for weight in composite.weigh(context).values())
        composite.explain()


@st.composite
def proposals(draw: st.DrawFn) -> Proposal:
    """Any valid proposal, none and all commands prohibited included."""
    layer = layers(COMMANDS.shape, 0.0, 1.0)
    degree = st.sampled_from((0.0, 1e-12, 1.0)) | st.floats(0.0, 1.0)
    return Proposal(draw(degree), draw(layer), draw(layer), "any")


@pytest.mark.parametrize("name", shipped("fusion"))
@settings(MANY, max_examples=10)
@given(
    context=contexts(),
    given_=st.dictionaries(st.sampled_from(("avoid", "give_way", "go_to_xy")), proposals()),
)
def test_every_shipped_fusion_gives_a_command_for_every_proposal(
    name: str, context: Context, given_: dict[str, Proposal]
) -> None:
    fusion = REGISTRY.get("fusion", name)(ROBOT)
    assert isinstance(fusion, Fusion)
    twist = fusion.fuse(context, given_).twist
    assert COMMANDS.v[0] - 1e-9 <= twist.v <= COMMANDS.v[-1] + 1e-9
    assert abs(twist.w) <= COMMANDS.max_w + 1e-9


@settings(MANY, max_examples=100)
@given(found=conflicts())
def test_give_way_always_leaves_a_command(found: Conflicts) -> None:
    proposal = behavior_of("give_way").propose(replace(PLAIN, conflicts=found))
    check_proposal(proposal, COMMANDS.shape)
    assert proposal.prohibition.min() < 0.5


def test_what_no_command_avoids_counts_against_none() -> None:
    # the robot rolls towards an obstacle close by: braking alone approaches it by 0.05 m
    approach = np.broadcast_to(0.05 + 0.2 * np.maximum(COMMANDS.v, 0.0)[:, None], COMMANDS.shape)
    distance = np.broadcast_to(0.15 - 0.3 * np.maximum(COMMANDS.v, 0.0)[:, None], COMMANDS.shape)
    found = Conflicts(distance, np.full(COMMANDS.shape, 0.5), approach, 0.1)
    proposal = behavior_of("give_way").propose(replace(PLAIN, conflicts=found))
    fast, standing = COMMANDS.nearest(Twist(0.5, 0.0)), COMMANDS.nearest(Twist(0.0, 0.0))
    assert proposal.prohibition[fast] > 0.8
    assert proposal.prohibition[standing] < 0.2
    assert proposal.desirability[standing] > proposal.desirability[fast]
