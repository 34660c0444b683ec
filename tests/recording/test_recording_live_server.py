"""The live server: it shows the run to those who know its address, and takes two commands."""

import json
import signal
import socket
import struct
import threading
import time
from collections import defaultdict
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from cli_calls import invoke, refusal
from live_browser import live_browser, serving
from report_browser import CONTRAST
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from navfw.errors import InputError
from navfw.missions import prepare
from navfw.missions.pilot import watcher_of
from navfw.missions.session import Session
from navfw.numerics import Image
from navfw.recording import channel_list as topics
from navfw.recording import deserialize_cdr
from navfw.recording.live_server import LiveServer
from navfw.report import live_page
from navfw.signals import Pose

WANTED = (topics.COMMAND, topics.READING, topics.CAMERA_IMAGE, topics.WORLD)
PAGE, FOXGLOVE = Subprotocol("navfw.live.v1"), Subprotocol("foxglove.sdk.v1")


def session(seconds: float) -> Session:
    overrides = [f"mission.timeout={seconds}"]
    return prepare("paper-room", "through-the-door", seed=3, overrides=overrides)


def address(server: LiveServer) -> str:
    return server.url.replace("http", "ws", 1)


def port_of(server: LiveServer) -> int:
    return int(server.url.split(":")[2].split("/")[0])


def page_of(shown: Session) -> str:
    return live_page("a run", shown.seen, [(goal.x, goal.y) for goal in shown.mission.goals])


@pytest.fixture(scope="module")
def idle() -> Session:
    return prepare("empty", "straight")


class Viewer:
    """A client that subscribes to channels, and keeps what it receives by topic."""

    def __init__(self, url: str) -> None:
        self.received: dict[str, list[tuple[float, bytes]]] = defaultdict(list)
        self.advertised: dict[str, dict[str, Any]] = {}
        self.status = ""
        self.thread = threading.Thread(target=self._view, args=(url,), daemon=True)
        self.thread.start()

    def _view(self, url: str) -> None:
        with connect(url, subprotocols=[FOXGLOVE]) as connection, suppress(ConnectionClosed):
            for data in connection:
                if isinstance(data, bytes):
                    if data[0] == 1:
                        number, stamp = struct.unpack_from("<IQ", data, 1)
                        self.received[WANTED[number]].append((1e-9 * stamp, data[13:]))
                    continue
                message = json.loads(data)
                if message["op"] == "advertise":
                    self.advertised = {c["topic"]: c for c in message["channels"]}
                    wanted = [
                        {"id": number, "channelId": self.advertised[topic]["id"]}
                        for number, topic in enumerate(WANTED)
                    ]
                    connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                self.status = message.get("message", "")


def test_a_client_receives_the_run_and_changes_no_command() -> None:
    watched = session(4.0)
    plain = watched.run()
    server = LiveServer(watched.seen, port=0, page=page_of(watched))
    viewer = Viewer(address(server))
    while not server._open[WANTED[-1]].has_sinks():
        server.serve(0.01)
    with closing(socket.create_connection(("127.0.0.1", port_of(server)))) as reader:
        reader.sendall(request(server))
        result = watched.run(watcher_of(server.observe))
        server.end(f"{result.outcome}: {result.reason}")
        assert reader.recv(99).startswith(b"HTTP/1.1 200 OK")
    viewer.thread.join(10)
    assert not viewer.thread.is_alive(), "the server ends with the run"
    assert viewer.status.startswith("timeout: ")
    assert result.log.command_hash == plain.log.command_hash
    assert result.faults == ()

    assert set(viewer.advertised) == set(topics.CHANNELS)
    schemas = {topic: channel["schemaName"] for topic, channel in viewer.advertised.items()}
    assert schemas == {info: info.schema for info in topics.CHANNELS}
    log = result.log
    commands = dict(zip(log.time.tolist(), map(tuple, log.commands.tolist()), strict=True))
    rows = [
        deserialize_cdr(data, topics.SCHEMA_NAME) for _, data in viewer.received[topics.READING]
    ]
    assert {row.time: (row.v, row.w) for row in rows} == commands
    leaders = {json.loads(data)["leader"] for _, data in viewer.received[topics.COMMAND]}
    assert leaders <= set(log.leaders)
    assert 40 <= len(viewer.received[topics.CAMERA_IMAGE]) <= 42  # the first may come twice
    assert viewer.received[topics.WORLD]


def test_the_view_from_behind_takes_a_bounded_share_of_the_time() -> None:
    watched, sent = session(4.0), []

    class Sink:
        has_sinks = staticmethod(lambda: True)

        def log(self, data: bytes, log_time: int) -> None:
            sent.append((data, log_time))

    def chase(pose: Pose, movers: topics.Discs) -> Image:
        del pose, movers
        time.sleep(0.03)
        return np.zeros((9, 16, 3), np.uint8)

    server = LiveServer(replace(watched.seen, chase=chase), port=0)
    server._open[topics.CHASE_IMAGE] = cast(Any, Sink())
    begun = time.perf_counter()
    watched.run(watcher_of(server.observe))
    spent, wall = 0.03 * len(sent), time.perf_counter() - begun
    server.end()
    assert len(sent) >= 2
    assert spent < 0.2 * wall
    image = deserialize_cdr(sent[0][0], topics.IMAGE_SCHEMA)
    assert (image.format, bytes(image.data[:2])) == ("jpg", b"\xff\xd8")


def request(server: LiveServer, *, token: str = "", lines: str = "") -> bytes:
    """A request for the page, with the token and the Host of the printed address by default."""
    host, _, path = server.url.removeprefix("http://").partition("/")
    path = path if not token else f"?token={token}"
    return f"GET /{path} HTTP/1.1\r\n{lines or f'Host: {host}'}\r\n\r\n".encode()


def test_only_this_machine_its_page_and_who_has_the_token_are_answered(idle: Session) -> None:
    origins = ("https://app.foxglove.dev",)
    with serving(
        LiveServer(idle.seen, 0, page="<p>secret", origins=origins), LiveServer.end
    ) as server:
        port = port_of(server)
        own = f"Host: 127.0.0.1:{port}"
        answered = {
            "": 200,
            f"Host: localhost:{port}": 200,
            f"{own}\r\nOrigin: http://localhost:{port}": 200,
            f"{own}\r\nOrigin: https://app.foxglove.dev": 200,
            f"{own}\r\nOrigin: https://foxglove.dev": 403,
            f"{own}\r\nOrigin: null": 403,
            f"{own}\r\nOrigin: http://127.0.0.1:{port + 1}": 403,
            f"{own}\r\nOrigin: http://127.0.0.1:{port}\r\nOrigin: http://x.org": 403,
            "Host: rebound.example.org": 403,
            f"Host: rebound.example.org:{port}": 403,
            f"{own}\r\nHost: rebound.example.org": 403,
            "Accept: */*": 403,
        }
        requests = [(request(server, lines=lines), code) for lines, code in answered.items()]
        requests += [(request(server, token=token), 403) for token in ("x", "%C3%A9", "&token=")]
        requests += [(b"GET /other" + request(server)[5:], 403), (b"\x00\xff\r\n\r\n", 0)]
        cut = b"HTTP/1.1\r\n" + b"X: 1\r\n" * 300
        requests += [(b"GET " + path + cut + b"\r\n", 0) for path in (b"//[::1 ", b"", b"* ")]
        for sent, code in requests:
            with closing(socket.create_connection(("127.0.0.1", port))) as reader:
                reader.sendall(sent)
                answer = b"".join(iter(partial(reader.recv, 4096), b""))
            assert answer.startswith(f"HTTP/1.1 {code} ".encode() if code else b""), (sent, answer)
            assert (b"secret" in answer) == (code == 200)
        with connect(address(server), subprotocols=[FOXGLOVE], origin=Origin(origins[0])):
            pass


def test_the_page_alone_may_pause_and_nothing_else_is_taken(idle: Session) -> None:
    def state(connection: Any) -> dict[str, Any]:
        while (message := json.loads(connection.recv(timeout=5)))["op"] != "navfw":
            pass
        return dict(message)

    with serving(LiveServer(idle.seen, 0, speed=2.0), LiveServer.end) as server:
        with connect(address(server), subprotocols=[PAGE]) as page:
            assert state(page) == {"op": "navfw", "paused": False, "speed": 2.0, "ended": ""}
            page.send(json.dumps({"op": "navfw", "paused": True, "speed": 0.5}))
            assert state(page) == {"op": "navfw", "paused": True, "speed": 0.5, "ended": ""}
            with connect(address(server), subprotocols=[FOXGLOVE]) as other:
                other.send(json.dumps({"op": "navfw", "paused": False, "speed": None}))
                other.ping().wait(5)
            page.send(json.dumps({"op": "set", "v": 1.0}))
            page.send(json.dumps({"op": "navfw", "paused": True, "speed": None}))
            assert state(page) == {"op": "navfw", "paused": True, "speed": None, "ended": ""}
        damaged: list[str | bytes] = [
            '{"op": "navfw", "paused": false, "speed": 1e999}',
            "[" * 60000,
            "{}",
            "\x00",
        ]
        damaged.append('{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 999}]}')
        for text in (*damaged, b"\x00\xff", '{"op": "navfw", "paused": true, "speed": "x"}'):
            with connect(address(server), subprotocols=[PAGE]) as page:
                page.send(text)
                with pytest.raises(ConnectionClosed):
                    while True:
                        page.recv(timeout=5)


def test_a_connection_that_never_asks_is_ended_with_the_server(idle: Session) -> None:
    server = LiveServer(idle.seen, 0)
    with socket.create_connection(("127.0.0.1", port_of(server))) as opened_ahead:
        server.serve(0.1)
        before = time.perf_counter()
        server.close()
        assert time.perf_counter() - before < 0.9, "it does not wait for a request"
        opened_ahead.settimeout(2.0)
        assert opened_ahead.recv(1) == b"", "ended, not left open"


def test_a_run_is_as_fast_as_asked_for(idle: Session) -> None:
    shown = prepare("empty", "straight", overrides=["mission.timeout=2"])
    server = LiveServer(shown.seen, 0, speed=4.0)
    began = time.monotonic()
    shown.run(watcher_of(server.observe))
    server.end()
    assert time.monotonic() - began > 0.25


def test_a_port_in_use_is_told_before_the_run(idle: Session, tmp_path: Path) -> None:
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=rf"--port: port {port} cannot be served \(Address"):
            LiveServer(idle.seen, port)
        words = ("run", "empty", "straight", "--out", tmp_path / "r")
        assert f"port {port} cannot be served" in refusal(*words, "--live", "--port", port)
    assert "need --live" in refusal(*words, "--stay")
    assert list(tmp_path.iterdir()) == []


SPY = """
async function spy(url) {
  const read = [];
  for (const mode of ["cors", "no-cors"]) {
    try { read.push((await (await fetch(url, {mode})).text()).length); } catch { read.push(0); }
  }
  for (const protocol of ["navfw.live.v1", "foxglove.sdk.v1"]) {
    read.push(await new Promise((resolve) => {
      const socket = new WebSocket(url.replace("http", "ws"), [protocol]);
      socket.onmessage = (event) => resolve(event.data.length || 1);
      socket.onclose = () => resolve(0);
    }));
  }
  const frame = document.createElement("iframe");
  frame.src = url;
  document.body.append(frame);
  await new Promise((resolve) => { frame.onload = resolve; });
  try { read.push(frame.contentDocument.body.textContent.length); } catch { read.push(0); }
  return read.join(" ");
}
"""
"""What a page of another origin reads of a URL, by each way that a browser offers."""


DRAWN = """
["camera", "plan", "speeds", "turns"].map((id) => document.getElementById(id))
  .every((canvas) => canvas.toDataURL().length > 2500)
"""
"""Whether there is something in each canvas."""
TEXT = "document.getElementById('{}').textContent"


@pytest.mark.thorough
def test_in_a_browser_the_own_page_shows_the_run_and_others_read_nothing(tmp_path: Path) -> None:
    shown = session(5.0)
    page = page_of(shown)
    assert len(page) < 300_000
    server = LiveServer(shown.seen, 0, page=page, speed=1.5, wait=True)

    def drive() -> None:
        server.end(str(shown.run(watcher_of(server.observe)).outcome))

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *words: object) -> None:
            """Print nothing."""

    (tmp_path / "spy.html").write_text(f"<body><script>{SPY}</script></body>")
    spy = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    for work in (drive, spy.serve_forever):
        threading.Thread(target=work, daemon=True).start()
    with live_browser(tmp_path / "profile") as browser:
        browser.open(server.url)
        browser.wait_for(f"parseFloat({TEXT.format('time')}) > 2.5")
        browser.press("Tab", 9)
        browser.press("Enter", 13, "\r")
        browser.wait_for(f"{TEXT.format('state')} === 'paused'")
        for width in (1400, 390):
            browser.resize(width, 900)
            browser.wait_for(DRAWN)
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
        assert browser.evaluate(CONTRAST) >= 4.5
        assert "IF" in browser.evaluate(TEXT.format("rules"))
        assert browser.evaluate(TEXT.format("P1")) != "?"
        assert browser.evaluate("document.getElementById('speed').value") == "1.5"
        assert browser.console == []

        browser.open(f"http://127.0.0.1:{spy.server_port}/spy.html")
        browser.wait_for("typeof spy === 'function'")
        for url in (server.url, server.url.partition("?")[0]):
            assert browser.evaluate(f"spy('{url}')") == "0 0 0 0 0"
        browser.open(server.url.replace("127.0.0.1", "rebound.test"))
        browser.wait_for("document.body && document.body.textContent.includes('another name')")

        browser.open(server.url)  # who joins a paused run sees it
        browser.wait_for(f"typeof {TEXT.format('state')} === 'string' && {DRAWN}")
        assert browser.evaluate(TEXT.format("state")) == "paused"
        browser.press("Tab", 9)
        browser.press("Enter", 13, "\r")
        browser.wait_for(f"{TEXT.format('state')} === 'timeout'")
    spy.shutdown()
    spy.server_close()


@pytest.mark.thorough
def test_a_page_goes_on_with_the_run_that_follows(tmp_path: Path) -> None:
    first, second = session(2.0), session(3.0)
    server = LiveServer(first.seen, 0, page=page_of(first), wait=True)

    def drive() -> None:
        result = first.run(watcher_of(server.observe))
        server.tell_end(f"{result.outcome}")
        server.follow(second.seen, page_of(second).replace("a run", "another run"))
        second.run(watcher_of(server.observe))
        server.end("both have ended", stay=True)

    threading.Thread(target=drive, daemon=True).start()
    with live_browser(tmp_path / "profile") as browser:
        browser.open(server.url)
        browser.wait_for("document.title.includes('another run')")
        browser.wait_for(f"typeof {TEXT.format('state')} === 'string' && {DRAWN}")
        browser.wait_for(f"{TEXT.format('state')} === 'both have ended'")
        assert browser.console == []


def test_viewers_of_a_run_are_sent_to_the_one_that_follows(idle: Session) -> None:
    server = LiveServer(idle.seen, 0, page="the first")
    codes: list[int] = []

    def view() -> None:
        with connect(address(server), subprotocols=[PAGE]) as connection:
            with suppress(ConnectionClosed):
                while True:
                    connection.recv()
            codes.append(connection.close_code or 0)

    viewer = threading.Thread(target=view, daemon=True)
    viewer.start()
    while not server._server.connections:
        server.serve(0.01)
    server.tell_end("reached: there")
    server.follow(idle.seen, "the second")
    viewer.join(10)
    assert codes == [1012]
    with closing(socket.create_connection(("127.0.0.1", port_of(server)))) as reader:
        reader.sendall(request(server))
        server.serve(0.2)
        assert reader.recv(9999).endswith(b"the second")
    after = Viewer(address(server))
    while not server._open[WANTED[0]].has_sinks():
        server.serve(0.01)
    server.close()
    after.thread.join(10)
    assert set(after.advertised) == set(topics.CHANNELS)
    assert after.status == ""


def test_a_run_that_stays_is_served_until_ctrl_c(tmp_path: Path) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    answers: list[bytes] = []

    def interrupt() -> None:
        while not (tmp_path / "r" / "result.json").is_file():
            time.sleep(0.05)
        with closing(socket.create_connection(("127.0.0.1", port))) as reader:
            reader.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            answers.append(reader.recv(999))
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    words = ("--set", "mission.timeout=1", "--live", "--port", port, "--stay", "--json")
    done = invoke("run", "empty", "straight", *words, "--out", tmp_path / "r")
    assert answers[0].startswith(b"HTTP/1.1 403 ")  # without the token, which is printed
    assert "/?token=" in done.stderr
    result = json.loads(done.stdout)
    assert (result["outcome"], done.exit_code, result["faults"]) == ("timeout", 1, [])
