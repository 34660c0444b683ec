"""Damaged bags: their storage, or of folders sometimes their metadata."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

from fuzz_mutations import mutate_bytes


def damaged_bags(bags: Sequence[Path], count: int, seed: int = 0) -> Iterator[Path]:
    """The ``bags`` in turn, each time damaged anew, ``count`` times."""
    files = [[bag] if bag.is_file() else sorted(bag.iterdir()) for bag in bags]
    contents = [{file: file.read_bytes() for file in one} for one in files]
    for number in range(count):
        which = number % len(bags)
        random = Random(count * seed + number)
        changed = random.choice(files[which]) if random.random() < 0.3 else files[which][0]
        for file, content in contents[which].items():
            file.write_bytes(mutate_bytes(content, random) if file == changed else content)
        yield bags[which]
