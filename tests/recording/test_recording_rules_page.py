"""The page for rules: it says what the rules say, and saves, drives and tests what was edited."""

import base64
import json
import math
import re
import shutil
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from cli_calls import invoke, refusal
from live_browser import LiveBrowser, live_browser, serving
from report_browser import CONTRAST
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from navfw import default_registry
from navfw.config.lookup import shipped_folder
from navfw.config.yaml_text import read_yaml_text, scalar_spans
from navfw.errors import InputError
from navfw.mofis.rules import BehaviorRules
from navfw.recording import read_result
from navfw.recording.recorded_decisions import RecordedDecisions
from navfw.recording.rules_file import ChangedFileError, RulesFile, find_rules
from navfw.recording.rules_run import RulesRun
from navfw.recording.rules_server import RulesServer, drive_words
from navfw.recording.rules_view import read_rules, view_of
from navfw.report.report_page import render_page
from navfw.robot import RobotModel

RULES = [*(shipped_folder() / "behaviors").glob("*.yaml")]
PAGE = Subprotocol("navfw.rules.v1")
AVOID = shipped_folder() / "behaviors" / "avoid.yaml"
CHANGE = "-0", "+8"
FIRST = "  - IF reserve IS short THEN prohibit IS yes, desire IS none\n"
GO_TO = AVOID.with_name("go_to_xy.yaml")


@pytest.fixture
def project(workdir: Path) -> Path:
    """A project without files, in the working folder."""
    (workdir / "navfw.toml").touch()
    return workdir


# --- what is drawn --------------------------------------------------------------------------------


@pytest.mark.parametrize("file", RULES, ids=lambda file: str(file.stem))
def test_a_number_is_where_its_span_says(file: Path) -> None:
    text = file.read_text()
    data, _ = read_yaml_text(text)
    spans = scalar_spans(text)
    for path, (begin, end) in spans.items():
        value = data
        for step in path:
            value = value[step]
        if isinstance(value, float | int):
            assert float(text[begin:end]) == value
    numbers = [path for path in spans if "terms" in path]
    assert len(numbers) == sum(
        len(corners)
        for section in ("inputs", "outputs")
        for one in data[section].values()
        for shape in one["terms"].values()
        for corners in shape.values()
    )


@pytest.mark.parametrize("file", RULES, ids=lambda file: str(file.stem))
def test_the_view_is_what_the_rules_say(file: Path) -> None:
    rules, text = BehaviorRules(file), file.read_text()
    values = {name: one.low + 0.3 * (one.high - one.low) for name, one in rules.base.inputs.items()}
    view = view_of(rules, text, values, {})
    result = rules.fis.evaluate_one(values)
    assert [rule["strength"] for rule in view["rules"]] == result.firing[0].tolist()
    for output in view["outputs"]:
        crisp = result.crisp(output["name"])[0]
        assert output["value"] == (None if np.isnan(crisp) else crisp)
        assert [term["degree"] for term in output["terms"]] == result.activations(output["name"])
    surface, names = view["surface"], [*rules.base.inputs]
    x = np.linspace(rules.base.inputs[names[0]].low, rules.base.inputs[names[0]].high, 41)
    along = rules.fis.evaluate({**{n: values[n] for n in names}, names[0]: x})
    if len(names) == 1:
        expected = np.round(along.crisp(surface["output"]), 4)
        assert np.array(surface["z"], dtype=float) == pytest.approx(expected, nan_ok=True)
    assert all(one["bare"] == [] for one in view["inputs"])
    json.dumps(view, allow_nan=False)


def test_what_no_rule_covers_is_shown_with_the_message_of_check() -> None:
    text = AVOID.read_text().replace(
        "  - IF reserve IS short THEN prohibit IS yes, desire IS none\n", ""
    )
    read = read_rules(text, "avoid.yaml")
    assert read.rules is not None
    assert "no rule concludes about 'prohibit' where reserve is in [0, 0.9]" in read.problem
    view = view_of(read.rules, text, {"pace": 0.3}, {"output": "prohibit"})
    bare = {one["name"]: one["bare"] for one in view["inputs"]}
    assert bare["reserve"] == [[0.0, 0.9]]
    assert bare["pace"] == []
    columns = np.unique(np.array(view["surface"]["bare"]) % 41)
    assert columns.tolist() == [*range(13)]  # up to 0.9 of 3
    assert view["surface"]["z"][0] is None


def test_a_weight_is_where_it_is_written_or_can_be() -> None:
    text = AVOID.read_text().replace("desire IS much\n", "desire IS much WITH 0.8  # é 𝄞\n", 1)
    text = "# 𝄞\n" + text.replace("prohibit IS no\n", "prohibit IS no WITH .5 WEIGHT\n")
    last = "IF clearance IS touching OR pace IS standing THEN desire IS none"
    text = text.replace(last, f"'{last}'")
    rules = read_rules(text, "avoid.yaml").rules
    assert rules is not None
    units = text.encode("utf-16-le")
    for number, rule in enumerate(view_of(rules, text, {}, {})["rules"]):
        begin, end = rule["at"]
        assert (begin == end) == (rule["weight"] == 1.0)
        new = " WITH 0.25" if begin == end else "0.25"
        changed = units[: 2 * begin] + new.encode("utf-16-le") + units[2 * end :]
        again = BehaviorRules.parse(changed.decode("utf-16-le")).base.rules
        assert [n for n, one in enumerate(again) if one.weight == 0.25] == [number]


def test_the_lines_of_a_problem_are_those_of_check(project: Path) -> None:
    text = AVOID.read_text().replace("IF reserve IS short", "IF reserv IS short")
    text = text.replace("clearance IS clear", "clearance IS cleer")
    (project / "behaviors").mkdir()
    (project / "behaviors" / "r.yaml").write_text(text)
    read = read_rules(text, "behaviors/r.yaml")
    assert read.rules is None
    assert read.lines == [50, 56]
    done = invoke("check", "behaviors/r.yaml")
    assert done.stdout.startswith(read.problem)


# --- the file -------------------------------------------------------------------------------------


def test_saving_keeps_the_lines_and_refuses_what_has_changed(project: Path) -> None:
    file = project / "behaviors" / "mine.yaml"
    file.parent.mkdir()
    file.write_bytes(AVOID.read_bytes().replace(b"\n", b"\r\n"))
    first, second = RulesFile(file), RulesFile(file)
    read = first.read()
    changed = read.replace("0.9, 1.3]", "0.8, 1.3]")
    assert first.save(changed, read) == "saved: behaviors/mine.yaml"
    assert file.read_bytes() == changed.encode().replace(b"\n", b"\r\n")
    with pytest.raises(ChangedFileError, match="has changed since this page read it") as refused:
        second.save(read.replace("1.3, 2.0", "1.3, 2.5"), read)
    assert refused.value.now == changed
    assert "-      short: {trapezoid: [0, 0, 0.8, 1.3]}" in refused.value.difference
    assert "+      short: {trapezoid: [0, 0, 0.9, 1.3]}" in refused.value.difference
    assert "+      tight: {triangle: [0.9, 1.3, 2.5]}" in refused.value.difference
    assert first.read() == changed


def test_what_ships_is_copied_into_the_project_and_used_there(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = AVOID.read_text()
    file = find_rules("avoid")
    assert file.path == AVOID
    changed = before.replace("0.9, 1.3]", "0.8, 1.3]")
    other = find_rules("avoid")
    assert "a copy for this project" in file.save(changed, before)
    with pytest.raises(ChangedFileError):
        other.save(before.replace("0.6, 1.2]", "0.5, 1.2]"), before)
    assert AVOID.read_text() == before
    assert (project / "behaviors" / "avoid.yaml").read_text() == changed
    assert invoke("check").stdout.startswith("1 checked, 0 wrong")
    cls: Any = default_registry().get("behavior", "avoid")

    def corner() -> float:
        return float(cls(RobotModel()).rules.base.inputs["reserve"].terms["short"].places[2])

    assert corner() == 0.8
    assert find_rules("avoid").path == project / "behaviors" / "avoid.yaml"
    (project / "behaviors" / "avoid.py").write_text("")  # then it is that plugin's file
    assert corner() == 0.9
    monkeypatch.chdir(shipped_folder())
    assert corner() == 0.9


def test_without_a_project_nothing_is_saved(workdir: Path) -> None:
    loose = workdir / "mine.yaml"
    loose.write_text(AVOID.read_text())
    for file in (RulesFile(AVOID), RulesFile(loose)):
        with pytest.raises(InputError, match="there is no project here: navfw new project DIR"):
            file.save("x", file.read())
    assert loose.read_text() == AVOID.read_text()


def test_a_copy_that_nothing_would_read_is_not_made(project: Path) -> None:
    file = find_rules(str(files("navfw") / "offis" / "rules" / "situation.yaml"))
    with pytest.raises(InputError, match="no behaviour would read a copy"):
        file.save(file.read() + "\n", file.read())
    assert not (project / "behaviors").exists()


def test_rules_that_there_are_not_are_refused(workdir: Path) -> None:
    assert "did you mean 'avoid'?" in refusal("rules", "avoyd")
    assert "no rules in a YAML file" in refusal("rules", "look_around")
    assert "there is no such file" in refusal("rules", "behaviors/none.yaml")
    assert "is not a run folder" in refusal("rules", "avoid", "--run", workdir)


# --- a run ----------------------------------------------------------------------------------------


def test_the_recorded_rules_give_the_recorded_commands_and_others_differ(folder: Path) -> None:
    rules = BehaviorRules(GO_TO)
    run, recorded = RulesRun(folder, rules), RecordedDecisions(folder)
    for index in (3, 40, 12):
        told, _ = run.moment(float(recorded.times[index]), rules, index)
        twist = told["command"]["v"], told["command"]["w"]
        assert twist == pytest.approx(recorded.commands[index].tolist())
        assert "picture" not in told
        assert told["index"] == index
    told, values = run.moment(3.0, None, -1)
    assert told["picture"].startswith("data:image/png;base64,")
    assert values.keys() == rules.base.inputs.keys()
    assert run.differences([*run.replaced(rules)])["where"] == []
    assert run.about()["others"] == []

    other = BehaviorRules.parse(GO_TO.read_text().replace("speed IS full", "speed IS slow"))
    assert run.differences([*run.replaced(other)])["where"]
    assert run.moment(3.0, other, -1)[0]["command"]["v"] < told["command"]["v"]


def test_rules_that_are_others_than_the_recorded_are_listed(folder: Path, project: Path) -> None:
    before = GO_TO.read_text()
    find_rules("go_to_xy").save(before.replace("[-20, 0, 20]", "[-20, 8, 20]"), before)
    run = RulesRun(folder, BehaviorRules(project / "behaviors" / "go_to_xy.yaml"))
    lines = [
        f"go_to_xy: {sign}      ahead: {{triangle: [-20, {x}, 20]}}" for sign, x in ("-0", "+8")
    ]
    assert run.about()["others"] == lines
    assert run.differences([*run.replaced(BehaviorRules(GO_TO))])["where"] == []


def test_a_behaviour_that_fails_is_drawn_without_desires(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = RulesRun(folder, BehaviorRules(GO_TO))
    about, behaviors = run.about(), run._decisions.mofis.behaviors
    failing = Mock(side_effect=KeyError("door 7"))
    monkeypatch.setattr(type(behaviors["peek"]), "propose", failing)
    decided, _ = run.moment(about["times"][5], None, -1)
    layers = np.frombuffer(base64.b64decode(decided["desirability"]), np.uint8)
    layers = layers.reshape(len(about["grid"]["names"]), -1)
    assert not layers[[*behaviors].index("peek")].any()
    assert layers[[*behaviors].index("go_to_xy")].any()


def test_a_moment_outside_and_rules_of_no_run_are_refused(folder: Path) -> None:
    rules = BehaviorRules(AVOID)
    run = RulesRun(folder, rules)
    with pytest.raises(InputError, match=r"99 s is outside of the run: 0\.6 to"):
        run.moment(99.0, rules, -1)
    renamed = BehaviorRules.parse(AVOID.read_text().replace("name: avoid", "name: avoit"))
    with pytest.raises(InputError, match="did you mean 'avoid'"):
        RulesRun(folder, renamed)
    with pytest.raises(InputError, match="did you mean 'avoid'"):
        run.moment(2.0, renamed, -1)


def test_a_file_that_the_stack_does_not_read_is_not_driven(folder: Path, project: Path) -> None:
    run, copy = RulesRun(folder, BehaviorRules(AVOID)), project / "behaviors" / "avoid.yaml"
    other = project / "mine.yaml"
    run.check_drivable(AVOID)
    with pytest.raises(InputError, match="is not what avoid reads"):
        run.check_drivable(other)
    find_rules("avoid").save(AVOID.read_text() + "\n", AVOID.read_text())
    run.check_drivable(copy)
    with pytest.raises(InputError, match=r"mine.yaml: is not .* reads: behaviors/avoid.yaml; edit"):
        run.check_drivable(other)


def test_a_value_that_is_none_is_drawn_in_the_middle() -> None:
    view = view_of(BehaviorRules(AVOID), AVOID.read_text(), {"pace": math.nan, "reserve": 9.0}, {})
    assert [one["value"] for one in view["inputs"]] == [3.0, 1.5, 0.25, 0.25]


def test_a_run_is_driven_again_by_the_words_that_drove_it(folder: Path) -> None:
    words = ["run", "paper-room", "through-the-door", "--seed", "3"]
    words += ["--stack", str(folder / "stack.yaml"), "--set", "mission.timeout=6"]
    assert drive_words(folder) == words


# --- the server -----------------------------------------------------------------------------------


def test_a_foreign_origin_and_unreadable_messages_are_refused(project: Path) -> None:
    with serving(RulesServer(RulesFile(AVOID)), RulesServer.close) as server:
        address = server.url.replace("http", "ws", 1)
        for url, origin in ((address, Origin("https://evil.example")), (address[:-3], None)):
            with pytest.raises(InvalidStatus, match="403"):
                connect(url, subprotocols=[PAGE], origin=origin)
        damaged = [
            "{}",
            "\x00",
            "[" * 60000,
            '{"op": "look", "number": 1, "text": "", "time": "x"}',
        ]
        damaged.append(json.dumps({"op": "look", "number": 1, "text": AVOID.read_text()}))
        for text in damaged:
            with connect(address, subprotocols=[PAGE]) as page:
                assert json.loads(page.recv(timeout=5))["op"] == "file"
                page.send(text)
                if text != damaged[3]:
                    with pytest.raises(ConnectionClosed):
                        page.recv(timeout=5)
        with connect(address, subprotocols=[PAGE]) as page:
            page.recv(timeout=5)
            page.send(json.dumps({"op": "save", "text": "name: x", "read": AVOID.read_text()}))
            answer = json.loads(page.recv(timeout=5))
    assert answer["op"] == "refused"
    assert "inputs: missing" in answer["message"]
    with serving(
        RulesServer(RulesFile(Path(shutil.copy(AVOID, project)))), RulesServer.close
    ) as server:
        (project / AVOID.name).unlink()
        address, gone = server.url.replace("http", "ws", 1), "there is no such file"
        with (
            connect(address, subprotocols=[PAGE]) as page,
            pytest.raises(ConnectionClosed, match=gone),
        ):
            page.recv(timeout=5)
    assert not (project / "behaviors").exists()


def test_the_page_is_served_until_ctrl_c(workdir: Path) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    answers: list[bytes] = []

    def interrupt() -> None:
        while not answers:
            try:
                with closing(socket.create_connection(("127.0.0.1", port))) as reader:
                    reader.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
                    answers.append(reader.recv(999))
            except OSError:
                continue
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    done = invoke("rules", "avoid", "--port", port)
    assert answers[0].startswith(b"HTTP/1.1 403 ")  # without the token, which is printed
    assert (done.exit_code, done.stdout) == (0, "")
    served, note = done.stderr.splitlines()
    assert re.fullmatch(rf"rules: http://127\.0\.0\.1:{port}/\?token=[\w-]+", served)
    assert note.startswith("note: nothing can be saved: ")  # here is no project


# --- in a browser ---------------------------------------------------------------------------------


class Page:
    """The page in a browser."""

    def __init__(self, browser: LiveBrowser, url: str) -> None:
        self.browser = browser
        browser.open(url)
        self.wait("document.body.dataset.answered")

    def wait(self, script: str, patience: float = 20.0) -> Any:
        return self.browser.wait_for(script, patience)

    def says(self, part: str) -> str:
        return str(self.browser.evaluate(f"document.getElementById('{part}').textContent"))

    def wait_says(self, part: str, text: str, patience: float = 20.0) -> None:
        words = json.dumps(text)
        self.wait(f"document.getElementById('{part}').textContent.includes({words})", patience)

    def click(self, part: str) -> None:
        self.browser.evaluate(f"document.getElementById('{part}').click()")

    @property
    def text(self) -> str:
        return str(self.browser.evaluate("document.getElementById('text').value"))

    def write(self, text: str) -> None:
        area = "document.getElementById('text')"
        self.browser.evaluate(f"{area}.value = {json.dumps(text)}; {area}.oninput()")

    def drag(self, key: str, by: float, steps: int) -> None:
        """Move a handle by the mouse [px]."""
        handle = f"""document.querySelector('[data-key="{key}"]')"""
        self.browser.evaluate(f"{handle}.scrollIntoView({{block: 'center'}})")
        box = self.browser.evaluate(f"{handle}.getBoundingClientRect().toJSON()")
        x, y = box["left"] + box["width"] / 2, box["top"] + box["height"] / 2
        where = {"y": y, "button": "left", "buttons": 1, "clickCount": 1}
        self.browser.call("Input.dispatchMouseEvent", type="mousePressed", x=x, **where)
        for step in range(steps):
            at = x + by * (step + 1) / steps
            self.browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=at, **where)
        self.browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + by, **where)

    def focus(self, key: str) -> None:
        self.browser.evaluate(f"""document.querySelector('[data-key="{key}"]').focus()""")


COUNT = """
window.seen = [];
new MutationObserver(() => seen.push(performance.now()))
  .observe(document.body, {attributes: true, attributeFilter: ["data-answered"]});
"""
"""Keeps the times of the answers [ms]."""


def edited(text: str, section: str, name: str, term: str) -> list[float]:
    """The corners of a term in a text."""
    data, _ = read_yaml_text(text)
    (corners,) = data[section][name]["terms"][term].values()
    return [float(corner) for corner in corners]


@contextmanager
def opened(tmp_path: Path, project: Path, folder: Path) -> Iterator[Page]:
    """The page for the rules of ``go_to_xy``, with the run; its console must stay empty."""
    (project / "run").symlink_to(folder)
    text = render_page("rules_page.html", title="Rules: go_to_xy")
    assert len(text) < 300_000
    run = RulesRun(project / "run", BehaviorRules(GO_TO))
    server = RulesServer(find_rules("go_to_xy"), page=text, run=run)
    with serving(server, RulesServer.close), live_browser(tmp_path / "profile") as browser:
        browser.resize(1500, 900)
        page = Page(browser, server.url)
        page.wait_says("marks", "the same commands as in the recording")
        yield page
        for width in (1500, 390):
            browser.resize(width, 900)
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
        assert browser.evaluate(CONTRAST) >= 4.5
        browser.open("about:blank")
        browser.open(f"{server.url}#t=99")
        page.wait_says("note", "99 s is outside of the run")
        assert browser.console == []


@pytest.mark.thorough
def test_in_a_browser_the_moment_follows_a_corner(
    tmp_path: Path, project: Path, folder: Path
) -> None:
    with opened(tmp_path, project, folder) as page:
        browser, before = page.browser, page.text
        browser.evaluate(COUNT)
        page.drag("inputs.bearing.ahead.1", 20.0, 30)
        page.wait("!document.getElementById('save').disabled")
        assert browser.evaluate("seen.length") >= 3  # while it moved; how often, is measured
        left, peak, right = edited(page.text, "inputs", "bearing", "ahead")
        assert (left, right) == (-20.0, 20.0)
        assert 8.0 <= peak <= 13.0
        assert len(page.text.splitlines()) == len(before.splitlines())
        page.wait_says("marks", "commands differ at")
        page.focus("inputs.bearing.ahead.1")
        browser.press("ArrowLeft", 37)
        assert edited(page.text, "inputs", "bearing", "ahead")[1] == round(peak - 3.6)
        page.click("undo")  # of all that was done to one corner
        page.wait_says("state", "as in the file")
        assert page.text == before

        page.write(before.replace("IF bearing IS ahead AND", "IF bearin IS ahead AND"))
        page.wait_says("problem", "rules[8]: expected an input, got 'bearin'")
        marked = page.wait("document.querySelector('#under mark').textContent")
        assert marked.startswith("- IF bearin ")
        assert page.says("rules").count("IF ") == 10  # the last valid state
        assert page.says("marks") == "not computed: the rules are refused"
        assert browser.evaluate("document.getElementById('save').disabled") is True
        page.write(before.replace("  - IF bearing IS left THEN turn IS left, speed IS slow\n", ""))
        page.wait("document.querySelectorAll('#inputs .bare').length")
        page.wait_says("marks", "not computed")


@pytest.mark.thorough
def test_in_a_browser_rules_are_saved_driven_and_tested(
    tmp_path: Path, project: Path, folder: Path
) -> None:
    with opened(tmp_path, project, folder) as page:
        browser, copy = page.browser, project / "behaviors" / "go_to_xy.yaml"
        changed = page.text.replace("[-0.3, 0.0, 0.3]", "[-0.3, 0.15, 0.3]")
        page.write(changed)
        page.wait_says("state", "changed, not saved")
        page.click("drive")  # saves it first
        page.wait_says("note", "saved: behaviors/go_to_xy.yaml, a copy for this project")
        assert copy.read_text() == changed
        page.wait_says("done", "the new run is in", 200)
        results = [read_result(project / name) for name in ("run", "run-edited-1")]
        assert results[0]["command_hash"] != results[1]["command_hash"]
        assert results[0]["overrides"] == results[1]["overrides"]
        for link in browser.evaluate("[...document.querySelectorAll('#compared a')].map(String)"):
            report = browser.evaluate(f"fetch('{link}').then((answer) => answer.text())")
            assert "<title>paper-room / through-the-door" in report
        page.click("test")
        page.wait_says("done", "all is well", 200)
        assert "1 checked, 0 wrong" in page.says("printed")

        copy.write_text(changed.replace("[-20, 0, 20]", "[-21, 0, 20]"))
        page.write(changed.replace("[0, 20, 45]", "[0, 21, 45]"))
        page.wait("!document.getElementById('save').disabled")
        page.click("save")
        page.wait_says("why", "has changed since this page read it")
        assert "-      ahead: {triangle: [-21, 0, 20]}" in page.says("difference")
        page.click("load")
        page.wait_says("state", "as in the file")
        assert page.text == copy.read_text()
