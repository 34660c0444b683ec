"""Control systems of scikit-fuzzy become rules files, and rules files control systems."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzzy_samples import BOUNDED, rule_bases, small
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.config.yaml_text import write_yaml_text
from navfw.errors import RuleBaseError, UnknownNameError
from navfw.fuzzy import CompiledFis, RuleBase, parse_rule_base
from navfw.fuzzy.skfuzzy_exchange import control_system_of, from_control_system, to_control_system

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import skfuzzy
    from skfuzzy import control

pytestmark = pytest.mark.filterwarnings("ignore")

EVEN = np.arange(0, 11, 1), np.arange(0, 26, 1)
UNEVEN = np.array([0, 0.5, 3, 5, 7.2, 10]), np.array([0, 1, 2.5, 4, 9, 13, 14, 20, 25])


class Tip:
    """The tipping problem of scikit-fuzzy's documentation, with names that navfw cannot have."""

    def __init__(self, given: Any = EVEN[0], wanted: Any = EVEN[1], method: str = "centroid"):
        self.quality = control.Antecedent(given, "quality")
        self.service = control.Antecedent(given, "service level")
        self.tip = control.Consequent(wanted, "tip", method)
        self.quality.automf(3)
        self.service.automf(3)
        self.tip["low"] = skfuzzy.trimf(wanted, [0, 0, 13])
        self.tip["medium"] = skfuzzy.gaussmf(wanted, 13, 4)
        self.tip["very high"] = skfuzzy.trapmf(wanted, [13, 20, 25, 25])

    def rules(self, **settings: Any) -> list[Any]:
        good = self.service["good"] | (self.quality["good"] & ~self.service["poor"])
        poor = self.quality["poor"] | self.service["poor"]
        return [
            control.Rule(poor, self.tip["low"], **settings),
            control.Rule(self.service["average"], self.tip["medium"] % 0.5, **settings),
            control.Rule(good, (self.tip["very high"] % 0.8, self.tip["medium"] % 0.2), **settings),
        ]


def outputs_of(system: Any, inputs: dict[str, float]) -> dict[str, float]:
    simulation = control.ControlSystemSimulation(system)
    simulation.inputs(inputs)
    simulation.compute()
    return dict(simulation.output)


@pytest.mark.parametrize("and_func", [np.fmin, np.multiply])
@pytest.mark.parametrize(("given", "wanted"), [EVEN, UNEVEN])
def test_a_control_system_and_its_rules_file_give_the_same(
    given: Any, wanted: Any, and_func: Callable[..., Any], tmp_path: Path
) -> None:
    system = control.ControlSystem(Tip(given, wanted).rules(and_func=and_func))
    fis = CompiledFis(from_control_system(system, tmp_path / "tip.yaml"))
    back = to_control_system(tmp_path / "tip.yaml")
    for quality, service in np.random.default_rng(1).uniform(0, 10, (60, 2)).tolist():
        theirs = outputs_of(system, {"quality": quality, "service level": service})
        ours = {"quality": quality, "service_level": service}
        assert fis.evaluate(ours).outputs["tip"][0] == pytest.approx(theirs["tip"], abs=1e-6)
        assert outputs_of(back, ours)["tip"] == pytest.approx(theirs["tip"], abs=1e-6)


def test_triangles_and_trapezoids_are_found_again(tmp_path: Path) -> None:
    simulation = control.ControlSystemSimulation(control.ControlSystem(Tip().rules()))
    from_control_system(simulation, tmp_path / "tip.yaml")
    text = (tmp_path / "tip.yaml").read_text()
    assert "triangle: [5.0, 10.0, 10.0]" in text
    assert "trapezoid: [13.0, 20.0, 25.0, 25.0]" in text
    assert text.count("points: [") == 1
    assert "- IF service_level IS average THEN tip IS medium WITH 0.5\n" in text
    assert "THEN tip IS very_high WITH 0.8\n" in text
    assert "THEN tip IS medium WITH 0.2\n" in text


@settings(BOUNDED, max_examples=15)
@given(data=st.data())
def test_random_rule_bases_survive_the_exchange(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rule_base: RuleBase = data.draw(rule_bases(implication="min"))
    path = tmp_path_factory.mktemp("exchange") / "rules.yaml"
    defaults = {name: v.default for name, v in rule_base.outputs.items() if v.default is not None}
    again = CompiledFis(from_control_system(control_system_of(rule_base), path, defaults))
    rng = np.random.default_rng(3)
    inputs = {name: rng.uniform(v.low, v.high, 40) for name, v in rule_base.inputs.items()}
    ours = CompiledFis(rule_base).evaluate(inputs)
    theirs = again.evaluate({name: inputs[name] for name in again.rule_base.inputs})
    for name, variable in rule_base.outputs.items():
        width = variable.high - variable.low
        np.testing.assert_allclose(
            theirs.outputs[name], ours.outputs[name], rtol=0, atol=1e-6 * max(width, 1.0)
        )


def chained(tip: Tip) -> list[Any]:
    other = control.Consequent(EVEN[0], "joy")
    other.automf(3)
    return [*tip.rules(), control.Rule(tip.tip["low"], other["poor"])]


def mixed(tip: Tip) -> list[Any]:
    both = tip.quality["poor"] & tip.service["poor"]
    return [*tip.rules(), control.Rule(both, tip.tip["low"], and_func=np.multiply)]


def joined(tip: Tip) -> list[Any]:
    tip.tip.accumulation_method = np.add
    return tip.rules()


def twice(tip: Tip) -> list[Any]:
    tip.tip["very_high"] = tip.tip["low"].mf
    return tip.rules()


REFUSED: list[tuple[Callable[[Tip], list[Any]], str]] = [
    (lambda tip: tip.rules(and_func=lambda a, b: a * b / 2), "neither the minimum nor the product"),
    (lambda tip: tip.rules(or_func=np.add), "or_func is not the maximum"),
    (
        lambda tip: [control.Rule(tip.quality["poor"], tip.tip["low"] % 2.0)],
        "0 to 1, got 2",
    ),
    (chained, r"tip\[low\] is an output"),
    (mixed, "others the product"),
    (joined, "tip: its accumulation_method is not the maximum"),
    (twice, "are one name"),
]


@pytest.mark.parametrize(("rules", "message"), REFUSED)
def test_what_would_differ_is_refused(
    rules: Callable[[Tip], list[Any]], message: str, tmp_path: Path
) -> None:
    system = control.ControlSystem(rules(Tip()))
    with pytest.raises(RuleBaseError, match=message):
        from_control_system(system, tmp_path / "tip.yaml")
    assert not (tmp_path / "tip.yaml").exists()


@pytest.mark.parametrize("method", ["bisector", "mom", "som", "lom"])
def test_other_crisp_values_than_the_centroid_are_refused(method: str, tmp_path: Path) -> None:
    system = control.ControlSystem(Tip(method=method).rules())
    with pytest.raises(RuleBaseError, match=f"tip: defuzzify_method '{method}', .* 'centroid'"):
        from_control_system(system, tmp_path / "tip.yaml")


def test_only_systems_and_their_simulations_become_rules(tmp_path: Path) -> None:
    with pytest.raises(RuleBaseError, match="expected a ControlSystem or its simulation, got IF"):
        from_control_system(Tip().rules()[0], tmp_path / "tip.yaml")


def test_sparse_rules_need_a_default(tmp_path: Path) -> None:
    tip = Tip()
    system = control.ControlSystem([control.Rule(tip.quality["poor"], tip.tip["low"])])
    with pytest.raises(RuleBaseError, match=r"no rule concludes about 'tip' .*quality is in"):
        from_control_system(system, tmp_path / "tip.yaml")
    with pytest.raises(UnknownNameError, match="'tips'"):
        from_control_system(system, tmp_path / "tip.yaml", {"tips": 1.0})
    rule_base = from_control_system(system, tmp_path / "tip.yaml", {"tip": 1.0})
    assert CompiledFis(rule_base).evaluate({"quality": 9.0}).outputs["tip"][0] == 1.0


def test_scaled_conclusions_have_no_control_system(tmp_path: Path) -> None:
    file = tmp_path / "rules.yaml"
    file.write_text(write_yaml_text(small(implication="prod")))
    with pytest.raises(RuleBaseError, match=r"implication: scikit-fuzzy only clips"):
        to_control_system(file)


@pytest.mark.parametrize(
    ("shape", "advice"),
    [
        ("trimf: [0, 1, 2]", r"write triangle: \[0, 1, 2\]$"),
        ("Trapezoidal: [0, 1, 2, 2]", r"write trapezoid: \[0, 1, 2, 2\]$"),
        ("singleton: [0.5]", r"write triangle: \[0.5, 0.5, 0.5\]$"),
        ("spike: [0.5, 1]", r"write triangle: \[0.5, 0.5, 0.5\]$"),
        ("gaussmf: [1, 0.2]", r"gauss: \[1, 0.2\], or, .*MATLAB, gauss: \[0.2, 1\]$"),
        ("sigmf: [1, 4]", r"sigmoid: \[1, 4\], or, .*\[slope, centre\].* sigmoid: \[4, 1\]$"),
        ("gbellmf: [0.5, 2, 1]", r"trapezoid: \[0.25, 0.75, 1.25, 1.75\], the nearest"),
        ("zmf: [0.5, 1]", r"points: \[0.5, 1, 1, 0\], the nearest"),
        ("linsmf: [0.5, 1]", r"points: \[0.5, 0, 1, 1\]$"),
        ("rectangle: [0.5, 1]", r"trapezoid: \[0.5, 0.5, 1, 1\]$"),
        ("triangel: [0, 1, 2]", "did you mean 'triangle'"),
    ],
)
def test_shapes_of_other_tools_are_named(shape: str, advice: str) -> None:
    text = write_yaml_text(small()).replace("trapezoid: [0.0, 0.0, 0.5, 1.0]", shape, 1)
    text = text.replace("trapezoid: [0, 0, 0.5, 1]", shape, 1)
    assert shape in text
    with pytest.raises(RuleBaseError, match=rf"unknown shape .*{advice}"):
        parse_rule_base(text)
