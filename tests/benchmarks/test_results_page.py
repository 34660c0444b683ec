"""Stored results and the page written from them: schema, tables, staleness, located errors."""

import json
import re
from pathlib import Path

import pytest
from cli_calls import invoke, refusal
from navfw_benchmarks.results.result_file import StoredResult, load_results, save_result
from navfw_benchmarks.results.results_page import SENTENCES, TEMPLATE, current_pages, fill
from results_samples import MACHINE, REVISION, bench_result, suite_result

from navfw.errors import ConfigError, InputError, UnknownNameError

ROOT = Path(__file__).parents[2]


def filled(template: str, *results: StoredResult) -> str:
    return fill(template, results, Path("template.md"))


# --- files ---------------------------------------------------------------------------------------


def test_results_come_back_as_they_were(tmp_path: Path) -> None:
    suite = suite_result(variant="bare", p=0.25, against="default")
    results: list[StoredResult] = [bench_result(), suite]
    for result in results:
        save_result(tmp_path, result)
    assert load_results(tmp_path) == results


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"format": 0}, r"rooms-0-4\.json:2: format: expected 1, got 0; add the result anew"),
        ({"format": None}, "format: expected 1, got None"),
        ({"reviewer": "me"}, "reviewer: unknown key"),
        ({"revision": ""}, "revision"),
        ({"name": "other"}, "name: expected 'rooms-0-4' as the file is called, got 'other'"),
        ({"machine": {}}, "machine.processor"),
        ({"kind": "guess"}, "kind"),
        ({"seeds": 3}, "seeds"),
    ],
)
def test_a_result_that_breaks_the_schema_is_told_with_its_line(
    change: dict[str, object], says: str, tmp_path: Path
) -> None:
    file = save_result(tmp_path, suite_result())
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}, indent=1))
    with pytest.raises(ConfigError, match=says):
        load_results(tmp_path)
    file.write_text('{"format": 1,\n "name": ')
    with pytest.raises(ConfigError, match=r"rooms-0-4\.json"):
        load_results(tmp_path)


def test_two_results_share_no_runs(tmp_path: Path) -> None:
    save_result(tmp_path, suite_result())
    paper = "navfw suite rooms --seeds 3:9 --stack paper"
    save_result(tmp_path, suite_result("rooms-3-9-paper", seeds="3:9", command=paper))
    assert len(load_results(tmp_path)) == 2
    wider = suite_result("rooms-3-9", seeds="3:9", command="navfw suite rooms --seeds 3:9")
    save_result(tmp_path, wider)
    with pytest.raises(
        ConfigError, match=r"rooms-0-4\.json: seeds: has seeds in common with rooms"
    ):
        load_results(tmp_path)


def test_only_a_result_of_the_same_command_is_replaced(tmp_path: Path) -> None:
    file = save_result(tmp_path, suite_result())
    save_result(tmp_path, suite_result(revision="newer"))
    assert load_results(tmp_path)[0].revision == "newer"
    with pytest.raises(InputError, match="holds the result of `navfw suite rooms --seeds 0:4`"):
        save_result(tmp_path, suite_result(command="navfw suite rooms --seeds 0:4 --stack paper"))
    file.write_text("{")
    save_result(tmp_path, suite_result())  # a damaged file is no result
    assert len(load_results(tmp_path)) == 1


# --- placeholders --------------------------------------------------------------------------------


def test_rows_have_figures_and_origin() -> None:
    text = filled("{{suites rooms}}", suite_result())
    assert (
        "| rooms | 0:4 | 3 of 4 (75.0 %, 30.0 to 95.0) | 1 (1) | 0.70 | 0.50 | 20.0 s"
        " | 0.05, 0.20 m | collided: slow 1 |\n\nAll rows: revision 012345678, machine A."
    ) in text
    changed = suite_result(revision=f"{REVISION}-dirty", command="navfw suite rooms --seeds 0:4 -x")
    assert "| rooms `-x` |" in filled("{{suites rooms}}", changed)
    assert "revision 012345678-dirty, machine A." in filled("{{suites rooms}}", changed)
    both = filled("{{suites rooms}}", suite_result(), changed)
    assert "| 012345678 |\n" in both
    assert "| 012345678-dirty |\n" in both
    assert "All rows: machine A." in both


def test_parts_show_what_passes() -> None:
    figures = suite_result().figures
    stop = figures.model_copy(update={"expect": "stop", "passed": 4, "causes": {}})
    result = suite_result(parts={"dark": stop, "lit": figures})
    text = filled("{{parts rooms}}", result)
    assert "| dark | 0:4 | passed 4 of 4 |" in text
    assert "| lit | 0:4 | 3 of 4 (" in text
    assert "| rooms | 0:4 |" in filled("{{parts rooms}}", suite_result())


def test_variants_stand_beside_the_first() -> None:
    figures = suite_result().figures
    shared = {"parts": {"maze": figures}}
    first = suite_result("rooms-z", variant="zero", **shared)
    other = suite_result("rooms-a", variant="bare", p=0.0312, against="zero", **shared)
    head, _, *rows, _, origin = filled("{{variants rooms}}", other, first).splitlines()
    assert origin == "All rows: revision 012345678, machine A."
    assert "| p | maze |" in head
    assert [row.split(" | ")[0] for row in rows] == ["| zero", "| bare"]
    assert "| 0.031 | 3 of 4 |" in rows[1]
    assert filled("{{suites rooms}}", first) == "not measured"


def test_sizing_extrapolates_the_processor_time_of_runs() -> None:
    measured = suite_result()
    assert filled("{{sizing rooms}}", measured) == "not measured", "of an older version"
    figures = measured.figures.model_copy(update={"cpu_time_s": 4.5, "memory_mb": 380.4})
    sized = measured.model_copy(update={"figures": figures, "disk_kb": 9.27})
    row = "| rooms | 4 | 800 | 12.5 h | 380 MB | 9.3 kB |"
    assert row in filled("{{sizing rooms}}", sized)


def test_values_runs_and_machines() -> None:
    other = bench_result(
        "office-tour-3-default",
        kind="run",
        stacks=("default",),
        seeds="3",
        machine=MACHINE.model_copy(update={"cores": 8}),
        values={
            "world": "office",
            "mission": "tour",
            "outcome": "reached",
            "path_length_m": 12.34,
            "sim_time_s": 40.0,
            "collisions": 0,
            "localized_after_s": None,
            "estimate_error_p95_m": 0.0421,
            "estimate_error_max_m": 0.1,
        },
    )
    text = filled(
        '{{values bench-loop\n "loop = all"=loop_over_render:.2f\n laps=spread.loop_over_render}}',
        bench_result(),
    )
    assert "| loop = all | 1.23 |\n| laps | 1.1 to 1.3 |\n\nRevision 012345678" in text
    text = filled("{{runs office-*}}", bench_result(), other)
    assert (
        "| office `tour` | 3 | default | reached | 12.3 m | 40.0 s | 0.042 m, 0.100 m |  | 0 |"
        "\n\nAll rows: revision 012345678, machine B."
    ) in text
    assert "| B | Kettle 3000 | 8 |" in filled("{{machines}}", bench_result(), other)


def test_numbers_stand_in_sentences() -> None:
    paper = "navfw suite rooms --seeds 0:4 --stack paper"
    results = [suite_result(), suite_result("rooms-4-8", seeds="4:8", revision="abc")]
    results.append(suite_result("rooms-paper", command=paper))
    text = "{{value rooms reached}} of {{value rooms runs}}, {{seeds rooms}}, {{revision rooms}}"
    assert filled(text, *results) == "6 of 8, 0:4, 4:8, 012345678, abc"
    assert filled("{{value rooms-paper spl .1f}}", *results) == "0.7"
    assert filled("{{value bench-loop loop_over_render .1f}}", bench_result()) == "1.2"
    with pytest.raises(ConfigError, match="only counts can be added up"):
        filled("{{value rooms spl}}", *results)


def test_what_was_not_measured_says_so() -> None:
    for placeholder in (
        "suites rooms",
        "parts maze",
        "variants rooms",
        "runs *",
        "values x a=b",
        "value x a",
    ):
        assert filled(f"a {{{{{placeholder}}}}} b") == "a not measured b"


@pytest.mark.parametrize(
    ("placeholder", "says"),
    [
        ("suits rooms", r"template\.md:2: unknown placeholder 'suits': did you mean 'suites'"),
        ("suites romms", r"template\.md:2: unknown suite 'romms': did you mean 'rooms'"),
        ("values bench-loop a=loop_over", "unknown value 'loop_over': did you mean"),
        ("values bench-loop a=loop_over_render:.2x", "Unknown format code|Invalid format"),
        ("variants", r"template\.md:2: \{\{variants\}\}"),
        ('suites "rooms', "No closing quotation"),
    ],
)
def test_a_wrong_placeholder_is_told_with_its_line(placeholder: str, says: str) -> None:
    with pytest.raises((ConfigError, UnknownNameError), match=says):
        filled(f"first\n{{{{{placeholder}}}}}", bench_result())


# --- the pages -----------------------------------------------------------------------------------


def test_a_page_out_of_date_is_told_and_renewed(tmp_path: Path) -> None:
    folder = tmp_path / "benchmarks" / "results"
    folder.mkdir(parents=True)
    (folder / TEMPLATE).write_text("# Results\n\n{{suites rooms}}\n")
    readme = tmp_path / "README.md"
    place = "<!-- result: rooms -->{}<!-- end -->"
    readme.write_text(f"- Rooms: {place.format('old')}.\n")
    sentences = folder / SENTENCES
    sentences.write_text(place.format("{{value rooms reached}} reached"))
    save_result(folder, suite_result())
    words = ["results", "write", "--folder", str(folder)]

    def navfw(*more: str) -> tuple[int, str]:
        done = invoke(*words, *more)
        return done.exit_code, done.stdout

    code, text = navfw("--check")
    assert code == 1
    assert "results.md: out of date; run navfw results write" in text
    assert not folder.with_suffix(".md").exists()
    assert navfw()[0] == 0
    assert "| rooms | 0:4 |" in folder.with_suffix(".md").read_text()
    assert readme.read_text() == f"- Rooms: {place.format('3 reached')}.\n"
    assert navfw("--check") == (0, "up to date\n")
    more = suite_result("rooms-4-8", seeds="4:8", command="navfw suite rooms --seeds 4:8")
    save_result(folder, more)
    assert navfw("--check")[0] == 1
    sentences.write_text(place.format("{{value rooms reached}} and {{value faults passed}}"))
    navfw()
    assert readme.read_text() == f"- Rooms: {place.format('not measured')}.\n"
    sentences.write_text(place.format("\n{{value rooms won}}"))
    assert "readme.md:2: unknown value 'won'" in refusal(*words)
    (folder / TEMPLATE).unlink()
    assert navfw()[0] == 2


def test_the_page_of_this_repository_is_up_to_date() -> None:
    for page, text in current_pages(ROOT / "benchmarks" / "results").items():
        assert page.read_text(encoding="utf-8") == text, "run: uv run navfw results write"


def test_the_prose_of_the_template_has_no_measured_figures() -> None:
    text = (ROOT / "benchmarks" / "results" / TEMPLATE).read_text(encoding="utf-8")
    prose = re.sub(r"```.*?```|`[^`]*`|\{\{.*?\}\}", "", text, flags=re.DOTALL)
    assert re.findall(r"\d+\.\d+|\d+ of \d+|\d %(?! \|)", prose) == []
