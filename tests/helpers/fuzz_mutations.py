"""Mutations of inputs: structure, bytes, recordings. All drawn from one seed."""
# ruff: noqa: S608 - the tables are those of a sample

import contextlib
import copy
import json
import re
import sqlite3
from collections.abc import Callable
from itertools import count
from random import Random
from typing import Any, TypeAlias
from xml.etree import ElementTree

from mcap_rewriting import rewritten

Path: TypeAlias = tuple[Any, ...]
Mutator: TypeAlias = Callable[[bytes, Random], bytes]


def _nested(depth: int, inner: Any = 1) -> Any:
    for _ in range(depth):
        inner = [inner]
    return inner


VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, -(2**63), 2**64, 10**400, 10**5000),
    *(1e308, -1e308, 1e-308, 0.1, float("nan"), float("inf"), -float("inf")),
    *("", " ", "x" * 300, "a\0b", "\u202e\U0001f916", "\ud800", "1.5", "yes", "2001-01-01"),
    *("../../../etc/passwd", "/dev/zero", "/proc/self/mem", ".", "a" * 100_000, "%s{0}", "*&!"),
    *([], {}, [[]], [None], {"": 1}, {"x": {"y": {"z": 1}}}, _nested(70), list(range(3000))),
    *([1e308] * 3, [float("nan")] * 2, {"place": "nowhere"}, {"unknown": []}),
)
"""What a value is replaced with."""


def mutate_data(data: Any, random: Random) -> Any:
    """``data``, of mappings, lists and scalars, with one to three changes of its structure."""
    data = copy.deepcopy(data)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        places = list(_places(data, ()))
        if not places:
            return random.choice(VALUES)
        path = random.choice(places)
        _change(_parent(data, path), path[-1], random)
    return data


def _places(data: Any, path: Path) -> Any:
    listed = data[:200] if isinstance(data, list) else ()
    items = data.items() if isinstance(data, dict) else enumerate(listed)
    for key, value in items:
        yield (*path, key)
        if len(path) < 12:
            yield from _places(value, (*path, key))


def _parent(data: Any, path: Path) -> Any:
    for step in path[:-1]:
        data = data[step]
    return data


def _change(parent: Any, key: Any, random: Random) -> None:
    old = parent[key]
    match random.randrange(9):
        case 0:
            del parent[key]
        case 1 if isinstance(parent, list):
            parent.insert(key, copy.deepcopy(old))
        case 1:
            parent[f"{key}-2"] = copy.deepcopy(old)
        case 2 if isinstance(parent, dict):
            parent[random.choice(("unknown", "", "x" * 300, "\0", str(key).upper()))] = old
            del parent[key]
        case 3 if isinstance(old, int | float) and abs(old) < 1e300:
            parent[key] = random.choice((-old, old * 10, old * 1e6, old + 1, old / 1e6, str(old)))
        case 4 if isinstance(old, list) and old:
            parent[key] = random.choice((old[:-1], old * 2, old * 500, old[::-1], old[0]))
        case 5:
            parent[key] = [old]
        case 6 if isinstance(parent, dict):
            parent.update({f"key-{number}": number for number in range(random.choice((3, 2000)))})
        case _:
            parent[key] = copy.deepcopy(random.choice(VALUES))


TOKENS = (
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\r\n", b"\t", b"---\n", b"...", b"!!python/object:os"),
    *(b"&a [*a]", b"<<: *a", b"? ", b": ", b"- ", b"{", b"[" * 3000, b"]", b"'", b'"', b"\\u0000"),
    *(b"<!DOCTYPE x [<!ENTITY e 'x'>]>", b"<?xml version='1.0' encoding='no-such'?>", b"]]>"),
    *(b"9" * 5000, b"1e999", b"-", b".nan", b"\xf0\x9f\xa4\x96", b"#", b",", b"\x80" * 40, b"%"),
)
"""What is inserted into bytes."""


def mutate_bytes(content: bytes, random: Random) -> bytes:
    """``content`` with one to four changes of its bytes."""
    data = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 4))):
        at = random.randrange(len(data) + 1)
        size = random.choice((1, 2, 8, 64, 1000))
        match random.randrange(8):
            case 0 | 1 if at < len(data):
                data[at] ^= 1 << random.randrange(8)
            case 2 if at < len(data):
                data[at] = random.randrange(256)
            case 3:
                del data[at:]
            case 4:
                del data[at : at + size]
            case 5:
                data[at:at] = data[at : at + size] * random.choice((1, 2, 100))
            case 6:
                data[at : at + size] = bytes(min(size, len(data) - at))
            case _:
                data[at:at] = random.choice(TOKENS)
    return bytes(data)


def mutate_xml(content: bytes, random: Random) -> bytes:
    """An XML document with changed elements, attributes, texts or declaration."""
    root = ElementTree.fromstring(content)
    for _ in range(random.choice((1, 1, 2, 3))):
        element = random.choice(list(root.iter()))
        value = str(random.choice(VALUES[:36])).replace("\0", "").replace("\ud800", "")
        match random.randrange(8):
            case 0 if len(element):
                element.remove(random.choice(list(element)))
            case 1 if len(element):
                element.extend([copy.deepcopy(random.choice(list(element)))] * 2)
            case 2 if element.attrib:
                element.attrib[random.choice(list(element.attrib))] = value
            case 3 if element.attrib:
                del element.attrib[random.choice(list(element.attrib))]
            case 4:
                element.tag = random.choice(("x", "node", "edge", "graph", "model", "include"))
            case 5:
                for _ in range(random.choice((1, 70))):
                    element = ElementTree.SubElement(element, element.tag)
            case _:
                element.text = value
    text = ElementTree.tostring(root, encoding="unicode")
    encoding = random.choice(("", "utf-8", "utf-8", "utf-16", "latin-1", "no-such", "cp037"))
    head = f'<?xml version="1.0" encoding="{encoding}"?>\n' if encoding else ""
    return (head + text).encode("utf-8", "replace")


def mutate_recording(content: bytes, random: Random) -> bytes:
    """An MCAP file with missing, repeated or damaged messages, schemas or profile, or cut off."""
    chosen = random.randrange(300)
    number = count()

    def change(topic: str, data: bytes) -> bytes | None:
        if next(number) != chosen:
            return data
        return random.choice((None, b"", data + bytes(1), mutate_bytes(data, random)))

    match random.randrange(6):
        case 0:
            return content[: random.randrange(len(content))]
        case 1:
            profile = random.choice(("", "ros1", "navfw-", "navfw-0", "navfw-" + "9" * 40, "\0"))
            return rewritten(content, profile=profile)
        case 2:
            damaged = rewritten(content, schema=lambda schema: mutate_bytes(schema.data, random))
        case 3:
            damaged = rewritten(content, lambda topic, data: None if "image" in topic else data)
        case _:
            damaged = rewritten(content, change, chunk_size=random.choice((100, 10_000, 1 << 20)))
    return mutate_bytes(damaged, random) if random.random() < 0.2 else damaged


def _structure(content: bytes, random: Random) -> bytes:
    from navfw.config.document import parse_yaml

    data = mutate_data(parse_yaml(content.decode()).data, random)
    # JSON is YAML, too
    return json.dumps(data, ensure_ascii=False).encode("utf-8", "surrogatepass")


def _cells(content: bytes, random: Random) -> bytes:
    rows = [line.split(",") for line in content.decode().splitlines()]
    changed = mutate_data(rows, random)
    lines = (",".join(map(str, row)) if isinstance(row, list) else str(row) for row in changed)
    return "\n".join(lines).encode("utf-8", "surrogatepass")


NUMBERS = (
    *("1e308", "-1e308", "1e-320", "nan", "inf", "-inf"),
    *("9" * 400, "1e999", "-0.0", "1e19", ""),
)
"""What a number in a text is replaced with."""


def mutate_numbers(content: bytes, random: Random) -> bytes:
    """A text in which one to five numbers are extreme, or none."""
    parts = re.split(r"(-?\d[\d.]*(?:e-?\d+)?)", content.decode())
    for _ in range(random.choice((1, 1, 2, 5))):
        parts[random.randrange(1, len(parts), 2)] = random.choice(NUMBERS)
    return "".join(parts).encode()


_SCHEMAS = ("CREATE TABLE {t} (a REAL, b, c, d)", "CREATE TABLE {t} (a, b, c)")
"""What stands in the place of a table: other columns."""

_CELLS = (None, -1, 2**62, 1e308, "", "{}", '["e", 1]', "[" * 5000, "\x1b[31m", b"\xff")
"""Values of a column."""


def mutate_database(content: bytes, random: Random) -> bytes:
    """An SQLite file with something else in the place of a table, or other values in a column."""
    database = sqlite3.connect(":memory:")
    database.deserialize(content)
    tables = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
    table = random.choice(tables)[0]
    if random.random() < 0.5:
        database.execute(f'ALTER TABLE "{table}" RENAME TO "{table}-old"')
        database.execute(random.choice(_SCHEMAS).format(t=f'"{table}"'))
    else:
        columns = database.execute(f'PRAGMA table_info("{table}")').fetchall()
        change = f'UPDATE "{table}" SET "{random.choice(columns)[1]}" = ?'
        with contextlib.suppress(sqlite3.Error):  # where it must not be NULL
            database.execute(change, (random.choice(_CELLS),))
    database.commit()
    return database.serialize()


MUTATORS: dict[str, tuple[Mutator, ...]] = {
    "data": (_structure, _structure, mutate_bytes),
    "xml": (mutate_xml, mutate_numbers, mutate_bytes),
    "cells": (_cells, mutate_numbers, mutate_bytes),
    "recording": (mutate_recording, mutate_recording, mutate_bytes),
    "bytes": (mutate_bytes,),
    "numbers": (mutate_numbers, mutate_numbers, mutate_bytes),
    "database": (mutate_database, mutate_database, mutate_bytes),
}
"""By the form of an input: what changes it."""
