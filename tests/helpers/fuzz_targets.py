"""What is fuzzed: each kind of input with a valid sample, and the command that reads it."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from architecture_sources import ROOT
from navfw_benchmarks.results.result_file import load_results
from suite_samples import row
from typer.testing import CliRunner

from navfw.cli import app
from navfw.errors import InputError
from navfw.fuzzy import load_rule_base
from navfw.meshes import read_triangles
from navfw.meshes.mesh_file import MAX_TRIANGLES
from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.plugins import default_registry
from navfw.recording import RunFolder
from navfw.robot import load_robot
from navfw.stack import load_stack
from navfw.suite import load_suite
from navfw.suite.run_row import RunJournal
from navfw.suite.suite_plan import plan_runs
from navfw.topomap.map_formats import load_any_map, save_map
from navfw.tune.stack_study import open_study

Read = Callable[[Path], object]
Prepare = Callable[[Path], object]

WORLD = """\
name: sample
x: [0, 8]
y: [0, 6]
rooms: [{name: hall, x: [0, 8], y: [0, 6], floor: carpet, walls: plaster}]
walls:
  - name: outside
    points: [[0, 0], [8, 0], [8, 6], [0, 6], [0, 0]]
  - name: middle
    points: [[4, 0], [4, 6]]
    openings: [{name: gap, at: [4, 3], width: 1.2}]
doors: [{name: gap-door, opening: gap, state: open}]
boxes: [{name: crate, at: [2, 1], size: [0.4, 0.5, 0.6], yaw: 0.3}]
cylinders: [{name: post, at: [6, 5], radius: 0.2}]
movers: [{name: walker, path: [[5, 1], [7, 1]], speed: 0.4}]
landmarks: [{name: sign, id: 3, at: [0.05, 3], yaw: 0, size: 0.3}]
drops: [{name: pit, x: [6.5, 7.5], y: [3, 4], depth: 0.5}]
textures: {grain: {style: wood, seed: 4}}
light: {direction: [0.2, 0.3, 1], ambient: 0.7}
"""

MISSION = """\
description: Through the gap.
start: [1, 3, 0.0]
goals: [{x: 5.5, y: 4.5}]
timeout: 20
robot: {radius: 0.2, camera: {width: 160, height: 120}, landmark_camera: {rate: 1}}
sensors: {preset: good, slip: 0.01}
drops: [{name: shaft, x: [2, 3], y: [4.5, 5.5]}]
events:
  - {at: 2, lasting: 1, camera: black}
  - {near: {x: 3, y: 3, within: 1}, gyro: {bias_step: 0.01}}
  - {at: 4, door: {name: gap-door, state: closed}}
  - {at: 1, obstacle: {name: thing, at: [6, 2], size: [0.2, 0.2]}}
"""

CALIBRATION = """\
image_width: 160
image_height: 120
camera_matrix: {rows: 3, cols: 3, data: [90, 0, 80, 0, 90, 60, 0, 0, 1]}
distortion_model: rational_polynomial
distortion_coefficients: {rows: 1, cols: 8, data: [-0.2, 0.05, 0, 0, 0.01, 0.05, 0, 0]}
"""

SUITE = """\
description: A sample.
entries:
  - {world: paper-room, missions: [through-the-door], set: {avoid.spare: 0.1}}
  - {family: rooms, difficulty: [0.1, 0.4], expect: arrival}
variants: {default: {}, still: {set: {local_map.memory: false}}}
"""

SDF = """\
<sdf version="1.6"><world name="w">
<model name="a"><static>1</static><pose>1 2 0 0 0 0.3</pose><link name="l"><collision name="c">
<geometry><box><size>0.5 0.4 1</size></box></geometry></collision></link></model>
<model name="b"><static>true</static><link name="l"><pose>3 1 0.5 0 0 0</pose><collision name="c">
<geometry><cylinder><radius>0.2</radius><length>1</length></cylinder></geometry></collision></link>
</model></world></sdf>
"""


COLLADA = """\
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">
0 0 0 1 0 0 0 1 0 0 0 1</float_array><technique_common><accessor source="#a" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>
</vertices><triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 1 2 3 2 0 3</p></triangles></mesh></geometry></library_geometries>
<library_nodes><node id="n"><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s"><node id="m"><instance_node url="#n"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
STL = """\
solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""

URDF = """\
<robot name="r"><link name="base_link"><inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1"
ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.4 0.3 0.1"/></geometry>
</collision></link><link name="camera"/><joint name="c" type="fixed"><parent link="base_link"/>
<child link="camera"/><origin xyz="0.1 0 0.2" rpy="0 0 0"/></joint>
<link name="lw"><collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>
</link><link name="rw"><collision><geometry><cylinder radius="0.1" length="0.05"/></geometry>
</collision></link><joint name="left" type="continuous"><parent link="base_link"/><child link="lw"/>
<origin xyz="0 0.2 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint><joint name="right"
type="continuous"><parent link="base_link"/><child link="rw"/><origin xyz="0 -0.2 0"
rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint></robot>
"""


@dataclass(frozen=True)
class Target:
    """A kind of input: the name of its file, its form, how it is read, and how often it is drawn.

    ``prepare`` writes a valid input, and what it needs beside it, into a folder; ``read`` gets the
    folder. ``allowed`` are the exit codes by which its command may end.
    """

    file: str
    form: str
    prepare: Prepare
    read: Read
    weight: int = 10
    allowed: frozenset[int] = field(default=frozenset({0, 2}))


def outcome_of(target: Target, folder: Path) -> tuple[int, str]:
    """Exit code and message of reading the input in ``folder``.

    Any other exception than InputError is raised.
    """
    try:
        result = target.read(folder)
    except InputError as error:
        return 2, str(error)
    return result if isinstance(result, tuple) else (0, "")


def _command(*words: str) -> Read:
    """Run ``navfw`` with these words; a word with a slash is a path inside the folder."""

    def read(folder: Path) -> tuple[int, str]:
        args = [str(folder / word[2:]) if word.startswith("./") else word for word in words]
        result = CliRunner().invoke(app, args)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.stderr

    return read


def _text(name: str, content: str) -> Prepare:
    return lambda folder: (folder / name).write_text(content)


def _copy(name: str, *source: str) -> Prepare:
    return lambda folder: shutil.copy(ROOT.joinpath(*source), folder / name)


def _world(folder: Path) -> None:
    (folder / "world.yaml").write_text(WORLD)
    (folder / "missions").mkdir(exist_ok=True)
    (folder / "missions" / "cross.yaml").write_text(MISSION)


def _map_as(suffix: str) -> Prepare:
    source = ROOT / "maps" / "paper-room.yaml"
    return lambda folder: save_map(load_any_map(source), folder / f"map{suffix}")


def _recorded(folder: Path) -> None:
    """A run folder with a recording of 2.2 s."""
    session = prepare("paper-room", "through-the-door", overrides=["mission.timeout=2.2"])
    with RunFolder(folder / "run") as target:
        write_run(session.run(record=True), target)


def _prepare_mission(folder: Path) -> object:
    return prepare(str(folder), str(folder / "missions" / "cross.yaml"))


def _plan_suite(folder: Path) -> object:
    return plan_runs(load_suite(folder / "suite.yaml"), range(1), default_registry())


def _images(folder: Path) -> None:
    (folder / "images").mkdir(exist_ok=True)
    noise = np.random.default_rng(1).integers(0, 255, (60, 80), dtype=np.uint8)
    picture = cv2.resize(noise, (160, 120))
    for number in range(3):
        shifted = np.roll(picture, 2 * number, axis=1)
        cv2.imwrite(str(folder / "images" / f"{number}.png"), np.asarray(shifted))
    cv2.imwrite(str(folder / "images" / "3.jpg"), picture)
    rows = [f"{0.01 * tick:.2f},{0.001 * tick:.4f}" for tick in range(60)]
    (folder / "gyro.csv").write_text("\n".join(["time,yaw_rate", *rows]))
    poses = [f"{0.05 * k:.2f},1,2,{0.01 * k:.2f},0.6,0,0,0.8" for k in range(20)]
    (folder / "poses.txt").write_text("\n".join(poses))
    (folder / "camera.yaml").write_text(CALIBRATION)
    names = ["0.png", "1.png", "2.png", "3.jpg"]
    (folder / "times.csv").write_text(
        "time,file\n" + "".join(f"{k / 10},{n}\n" for k, n in enumerate(names))
    )


def _journal(folder: Path) -> None:
    """The folders of two suites."""
    for name in ("a", "b"):
        (folder / name).mkdir()
        (folder / name / "suite.json").write_text('{"content": {}, "current": ["aa"]}')
        journal = RunJournal(folder / name / "journal.sqlite")
        journal.create()
        journal.add("aa", *map(row, range(4)))


def _study(folder: Path) -> None:
    open_study(folder, {}, resume=False, seed=0)


def _read_mesh(name: str) -> Read:
    return lambda folder: read_triangles(folder / name, MAX_TRIANGLES, convex=True)


DIFFERING = frozenset({0, 1, 2})
"""Of commands that end with 1 where they find a difference or problem, as documented."""

TARGETS: dict[str, Target] = {
    "world": Target("world.yaml", "data", _world, _prepare_mission, 6),
    "mission": Target("missions/cross.yaml", "data", _world, _prepare_mission, 7),
    "stack": Target("stack.yaml", "data", _copy("stack.yaml", "navfw/stack/stacks/paper.yaml"),
                    lambda folder: load_stack(folder / "stack.yaml", default_registry()), 5),
    "map": Target("map.yaml", "data", _map_as(".yaml"),
                  _command("map", "check", "./map.yaml"), 8, DIFFERING),
    "graphml": Target("map.graphml", "xml", _map_as(".graphml"),
                      _command("map", "convert", "./map.graphml", "./out.yaml"), 20),
    "geojson": Target("map.geojson", "data", _map_as(".geojson"),
                      _command("map", "plan", "./map.geojson", "east", "0,0"), 15),
    "suite": Target("suite.yaml", "data", _text("suite.yaml", SUITE), _plan_suite, 1),
    "rules": Target("rules.yaml", "data", _copy("rules.yaml", "behaviors/avoid.yaml"),
                    lambda folder: load_rule_base(folder / "rules.yaml"), 8),
    "recording": Target("run/run.mcap", "recording", _recorded,
                        _command("replay", "./run"), 6, DIFFERING),
    "result": Target("run/result.json", "data", _recorded,
                     _command("explain", "./run", "--at", "2.1"), 2),
    "journal": Target("a/journal.sqlite", "database", _journal,
                      _command("report", "--text", "./a", "./b"), 20),
    "resumed": Target("a/journal.sqlite", "database", _journal,
                      lambda folder: RunJournal(folder / "a/journal.sqlite").create(), 20),
    "study": Target("study.db", "database", _study,
                    lambda folder: open_study(folder, {}, resume=True, seed=0), 3),
    "robot": Target("robot.yaml", "data", _copy("robot.yaml", "navfw/robot/robots/default.yaml"),
                    lambda folder: load_robot(folder / "robot.yaml"), 8),
    "collada": Target("a.dae", "xml", _text("a.dae", COLLADA), _read_mesh("a.dae"), 10),
    "obj": Target("a.obj", "numbers", _text("a.obj", OBJ), _read_mesh("a.obj"), 10),
    "stl": Target("a.stl", "numbers", _text("a.stl", STL), _read_mesh("a.stl"), 10),
    "urdf": Target("a.urdf", "xml", _text("a.urdf", URDF),
                   lambda folder: load_robot(folder / "a.urdf"), 8),
    "times": Target("times.csv", "cells", _images,
                    _command("perceive", "./images", "--times", "./times.csv"), 5),
    "stored": Target("rooms-1000-1050.json", "data",
                     _copy("rooms-1000-1050.json", "benchmarks/results/rooms-1000-1050.json"),
                     load_results, 15),
    "image": Target("images/1.png", "bytes", _images, _command("perceive", "./images"), 3),
    "photo": Target("images/3.jpg", "bytes", _images, _command("perceive", "./images"), 3),
    "gyro": Target("gyro.csv", "cells", _images,
                   _command("perceive", "./images", "--gyro", "./gyro.csv", "--fps", "10"), 8),
    "poses": Target("poses.txt", "cells", _images,
                    _command("perceive", "./images", "--poses", "./poses.txt", "--fps", "10"), 4),
    "calibration": Target("camera.yaml", "data", _images,
                          _command("perceive", "./images", "--calibration", "./camera.yaml"), 6),
    "sdf": Target("a.world", "xml", _text("a.world", SDF),
                  _command("world", "import", "./a.world", "--out", "./made", "--start", "0,0,0",
                           "--goal", "5,3", "--skip-unsupported"), 20),
}  # fmt: skip
