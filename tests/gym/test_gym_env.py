"""Environments: Gymnasium's own checks, seeds, vectors of them, and who knows the truth."""

import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from architecture_sources import ROOT, names, tree_of

import navfw
from navfw.errors import ConfigError, InputError, MissingExtraError, UnknownNameError

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra gym: uv sync --extra gym")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from navfw.gym import IDS, MissionEnv  # noqa: E402
from navfw.gym.agent_spaces import KINDS, AgentChoice  # noqa: E402

TRUTH = {"true_pose", "plan", "session", "result", "world", "simulator", "contacts"}
STRAIGHT: dict[str, Any] = {"world": "empty", "mission": "straight", "changes": {"warmup": 0.3}}
AHEAD = np.array([1.0, 0.0], np.float32)
LEFT = np.array([0.0, 1.0], np.float32)


@pytest.fixture(scope="module")
def env() -> Iterator[MissionEnv]:
    made = MissionEnv(**STRAIGHT)
    yield made
    made.close()


def steps(env: Any, action: AgentChoice, count: int) -> list[tuple[Any, float, bool, bool, Any]]:
    made = [env.step(action)]
    while len(made) < count and not (made[-1][2] or made[-1][3]):
        made.append(env.step(action))
    return made


@pytest.mark.thorough
@pytest.mark.parametrize("observation", KINDS)
def test_gymnasium_finds_no_fault_with_any_kind_of_observation(observation: str) -> None:
    action = "weights" if observation == "percept" else "twist"
    options = {**STRAIGHT, "stack": "balance", "observation": observation, "action": action}
    check_env(gymnasium.make("navfw/Mission-v0", **options).unwrapped)  # warnings are errors here


@pytest.mark.slow
@pytest.mark.parametrize("observation", KINDS)
@pytest.mark.parametrize("name", [name for name in IDS if "Mission" not in name])
def test_gymnasium_finds_no_fault_with_any_id(name: str, observation: str) -> None:
    check_env(gymnasium.make(name, observation=observation).unwrapped)


def test_a_seed_gives_its_episode_and_without_one_it_is_drawn_from_the_range(
    env: MissionEnv,
) -> None:
    def maps(seed: int) -> list[Any]:
        first = env.reset(seed=seed)[0]["local_map"]
        return [first.tolist(), *(step[0]["local_map"].tolist() for step in steps(env, AHEAD, 8))]

    first, other = maps(4), maps(5)
    assert first == maps(4) != other
    made = MissionEnv(**STRAIGHT, seeds="7:9")
    made.reset(seed=1)
    drawn = [made.reset()[1]["seed"] for _ in range(6)]
    made.close()
    assert set(drawn) == {7, 8}


def test_the_twist_is_driven_and_the_reward_counts_the_way(env: MissionEnv) -> None:
    _, start = env.reset(seed=2)
    ended = steps(env, AHEAD, 100)
    observation = ended[10][0]
    assert observation["twist"][0] == pytest.approx(0.5, abs=0.05)
    assert abs(observation["twist"][1]) < 0.1
    progress = sum(step[4]["reward_terms"]["progress"] for step in ended)
    final = ended[-1][4]
    assert progress == pytest.approx(start["remaining_m"] - final["remaining_m"])
    assert progress == pytest.approx(final["true_pose"][0] - start["true_pose"][0], abs=0.05)
    assert final["outcome"] == "reached"
    assert final["reward_terms"]["reached"] == 10.0
    assert ended[-1][2:4] == (True, False)


def test_without_drawing_steps_are_marked_as_oracle_and_use_noisy_flow() -> None:
    made = MissionEnv(**STRAIGHT, observation="percept", drawn=False)
    assert made.behaviors[0] == "go_to_xy"

    def seen(by: MissionEnv) -> Any:
        by.reset(seed=2)
        return steps(by, AHEAD, 100)

    first, *_ = seen(made), made.reset(seed=3), made.reset(seed=3), made.reset(seed=4)
    other = MissionEnv(**STRAIGHT, observation="percept", drawn=False)
    for again in (seen(made), seen(other)):
        pairs = zip(first, again, strict=True)
        assert all(np.array_equal(a[0]["nearness"], b[0]["nearness"]) for a, b in pairs)
    other.close()
    assert first[-1][4]["outcome"] == "reached"
    assert 0.3 < (first[15][0]["confidence"] > 0.0).mean() < 0.9
    made.close()


def test_coarse_steps_show_the_same_world_with_fewer_ticks(env: MissionEnv) -> None:
    coarse = MissionEnv(**STRAIGHT, observation="image", coarse=True)
    (first, _), _ = coarse.reset(seed=2), env.reset(seed=2)
    assert np.abs(first["image"].astype(float) - env._image).mean() < 1.0
    (*_, (_, _, _, _, ended)), *fine = steps(coarse, AHEAD, 100), *steps(env, AHEAD, 100)
    coarse.close()
    assert (ended["outcome"], ended["time"]) == ("reached", pytest.approx(fine[-1][4]["time"], 0.1))
    assert ended["command_hash"] != fine[-1][4]["command_hash"]


def test_the_time_limit_truncates() -> None:
    made = MissionEnv(**{**STRAIGHT, "changes": {"warmup": 0.3, "mission.timeout": 1}})
    made.reset(seed=0)
    *_, (_, _, terminated, truncated, info) = steps(made, AHEAD, 20)
    assert (terminated, truncated, info["outcome"]) == (False, True, "timeout")
    assert set(info["reward_terms"]) == {"progress", "time"}


def test_with_the_weights_of_its_own_composite_the_run_is_that_of_the_stack() -> None:
    short = {"mission.timeout": 4}
    made = MissionEnv(**{**STRAIGHT, "changes": short}, action="weights", stack="balance")
    made.reset(seed=3)
    *_, (_, _, _, _, info) = steps(made, np.ones(1, np.float32), 100)
    plain = navfw.run("empty", "straight", seed=3, stack="balance", set=short)
    assert info["command_hash"] == plain.log.command_hash
    assert made.behaviors == ("balance",)


def test_the_local_map_is_turned_into_the_robots_axes(env: MissionEnv) -> None:
    seen, _ = env.reset(seed=0)
    for action, count in ((AHEAD, 25), (LEFT, 14)):
        seen = steps(env, action, count)[-1][0]
    robot = len(seen["local_map"]) // 2
    # free floor was seen on the way straight ahead; after a turn to the left it is on the right
    known = seen["local_map"] != 0.0
    assert seen["twist"][1] > 0.5
    assert known[:, robot + 10 :].sum() > 2 * known[:, : robot - 10].sum()


def test_a_vector_of_environments_steps_together() -> None:
    options = {**STRAIGHT, "vectorization_mode": "sync", "observation": "percept"}
    made = gymnasium.make_vec("navfw/Mission-v0", num_envs=2, **options)
    first, _ = made.reset(seed=0)
    for _ in range(10):
        seen, reward, *_ = made.step(np.stack([AHEAD, LEFT]))
    made.close()
    assert first["nearness"].shape == (2, 12, 16)
    (v_ahead, w_ahead), (v_left, w_left) = seen["twist"]
    assert v_ahead > 0.2 > abs(w_ahead)
    assert w_left > 0.5 > abs(v_left)
    assert reward[0] > 0.0 > reward[1]


def test_observations_and_actions_are_made_without_truth() -> None:
    used = set(names(tree_of(ROOT / "navfw" / "gym" / "agent_spaces.py")))
    assert used & TRUTH == set()


def test_the_example_of_the_docs_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs" / "gym.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    exec(compile(block, "gym.md", "exec"), {})  # noqa: S102
    assert re.search(r"after \d+ steps: \w+", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"observation": "imge"}, UnknownNameError, "observation: .*'imge'.*did you mean 'image'"),
        ({"action": "twists"}, UnknownNameError, "action: .*did you mean 'twist'"),
        ({"reward": {"progres": 1.0}}, ConfigError, "reward: progres: .*did you mean 'progress'"),
        ({"seeds": "9:3"}, InputError, "--seeds: there is no seed in '9:3'"),
        ({"family": "rooms"}, InputError, "either a family, or a world and a mission"),
        ({"world": "ofice"}, UnknownNameError, "did you mean 'office'"),
        ({"stack": "navgrond"}, UnknownNameError, "unknown stack 'navgrond'"),
        ({"drawn": False, "observation": "image"}, InputError, "no images without drawing"),
        ({"changes": {"warmpu": 1}}, ConfigError, "did you mean 'warmup'"),
    ],
)
def test_mistakes_are_told(changed: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        MissionEnv(**{**STRAIGHT, **changed})


def test_a_step_before_reset_is_told() -> None:
    made = MissionEnv(**STRAIGHT)
    with pytest.raises(InputError, match="call reset first"):
        made.step(AHEAD)
    with pytest.raises(InputError, match="seeds must be below"):
        made.reset(seed=2**33)


def test_without_gymnasium_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "navfw.gym")
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(MissingExtraError, match="uv sync --extra gym"):
        __import__("navfw.gym")


@pytest.mark.parametrize("action", [[np.nan, 0.0], [np.inf, 0.0], [1j, 0.0], [0.5], "go"])
def test_an_action_that_is_no_finite_number_is_refused(env: MissionEnv, action: Any) -> None:
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"expected an action of \(2,\) finite real numbers"):
        env.step(action)
