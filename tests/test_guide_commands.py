"""Commands and options in README, guides and tutorials exist in the program."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import yaml

from config.errors import RidDaqError
from rid_daq.command_line import operation_command
from rid_daq.command_line.operation_command import OperationCommand
from rid_daq.command_line.root import Root, command_words
from rid_daq.operations.catalogue import operation
from tests.builders.code_lines import ROOT
from tests.builders.console_blocks import (
    PROGRAM,
    console_steps,
    program_arguments,
    require_shown,
)

GUIDES = sorted((ROOT / "docs" / "guide").glob("*.md"))
README = ROOT / "README.md"
PAGES = [README, *GUIDES, *sorted((ROOT / "docs" / "tutorial").glob("*.md"))]
EACH_GUIDE = pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.stem)
EACH_PAGE = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
MOST_WORDS = 5
"""Maximum words of a text in a data file that a guide shows; longer texts mark an output."""
PARTS = ("What you need", "What can go wrong", "Next")
OF_A_SCRIPT = {"--unsigned"}
"""Options on the pages that belong to scripts in the repository, not to rid-daq."""
NO_COMMANDS = ("rid-daq re", "rid-daq points 1")
"""Texts on the pages that are no commands: a word to complete, and a line of a protocol."""


@pytest.fixture
def root(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Root:
    """Return the command line with commands that check their arguments and do nothing."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHELL", "/bin/bash")  # --show-completion and --install-completion read it
    (tmp_path / "motion.yaml").touch()  # some options apply to motion files only
    for function in ("perform", "send", "require_memory"):
        monkeypatch.setattr(operation_command, function, lambda *_arguments: None)
    return Root()


def check_command(root: Root, arguments: list[str]) -> None:
    """Check a command line; `--help` and similar options end it before the command runs."""
    with root.make_context(PROGRAM, arguments) as context:
        root.invoke(context)


def inline(page: Path) -> Iterator[str]:
    """Yield the code in a page's sentences, without its blocks."""
    text = re.sub(r"^    .*$", "", without_blocks(page), flags=re.M)
    for found in re.findall(r"`([^`]+)`", text):
        yield " ".join(found.split())


def options() -> set[str]:
    root = Root()
    found: list[click.Command] = [
        root, *(OperationCommand(operation(" ".join(words))) for words in command_words())
    ]  # fmt: skip
    parameters = [each for command in found for each in command.get_params(click.Context(command))]
    return {name for each in parameters for name in (*each.opts, *each.secondary_opts)}


def without_blocks(page: Path) -> str:
    """Return a page without its fenced blocks."""
    text = page.read_text(encoding="utf-8")
    return re.sub(r"^ *```.*?^ *```$", "", text, flags=re.M | re.S)


def comparisons(test: str) -> set[tuple[str, str]]:
    """Return page and command of each output that a test compares with a guide."""
    file, *names = test.split("::")
    module = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    body: ast.AST = module
    for name in names:
        body = next(each for each in ast.walk(body) if getattr(each, "name", "") == name)
    texts = {
        target.id: str(node.value.value)
        for node in (*module.body, *ast.walk(body))
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }

    def text(argument: ast.expr) -> str:
        if isinstance(argument, ast.Name):
            return texts[argument.id]
        return str(ast.literal_eval(argument))

    return {
        (text(call.args[0]), text(call.args[1]))
        for call in ast.walk(body)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "assert_shown"
    }


def texts_in(value: object) -> Iterator[str]:
    """Yield the texts in the values of a file."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from texts_in(each)


def is_data(text: str) -> bool:
    """Return True for Python code, and for YAML or JSON without long texts."""
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError:
        found = None
    if isinstance(found, dict | list):
        return all(len(each.split()) <= MOST_WORDS for each in texts_in(found))
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


@EACH_PAGE
def test_a_command_on_a_page_is_accepted_by_the_program(page: Path, root: Root) -> None:
    for step in console_steps(page):
        for arguments in program_arguments(step.command):
            try:
                check_command(root, arguments)
            except click.exceptions.Exit:
                continue
            except (click.ClickException, RidDaqError) as error:
                raise AssertionError(f"{step.place}: {step.command}") from error


@EACH_PAGE
def test_a_command_in_a_sentence_has_existing_words_and_options(page: Path, root: Root) -> None:
    for text in inline(page):
        if not re.match(rf"{PROGRAM} [a-z-]", text) or text in NO_COMMANDS:
            continue
        for arguments in program_arguments(text.replace("…", "")):
            try:
                check_command(root, arguments)
            except (click.MissingParameter, click.BadOptionUsage, click.exceptions.Exit):
                continue  # a sentence may omit values
            except (click.ClickException, RidDaqError) as error:
                raise AssertionError(f"{page.name}: {text}") from error


@EACH_PAGE
def test_an_option_in_a_sentence_exists(page: Path) -> None:
    named = {
        word
        for text in inline(page)
        if text.startswith("--")
        for word in re.findall(r"(?<!\S)--[a-z][a-z0-9-]*", text)
    }
    assert not named - options() - OF_A_SCRIPT


@EACH_PAGE
def test_commands_are_in_console_blocks(page: Path) -> None:
    commands = rf"^ {{4,}}(?:\$ |(?:\S*/)?{PROGRAM} ).*$"
    assert not re.findall(commands, without_blocks(page), re.M)


@pytest.mark.parametrize("page", [README, *GUIDES], ids=lambda page: page.stem)
def test_an_output_names_the_test_that_compares_it(page: Path) -> None:
    """Tutorials need not name their test, because `tests/test_tutorials.py` runs them all."""
    for step in console_steps(page):
        if step.shown:
            assert step.test, f"{step.place}: name the test that compares this output"
            assert (page.stem, step.command) in comparisons(step.test), step.place


@EACH_GUIDE
def test_a_named_test_stands_directly_before_its_block(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not re.findall(r"^ *<!-- shown by .*\n(?! *```console\n)", text, re.M)


@EACH_GUIDE
def test_an_indented_block_is_no_output(page: Path) -> None:
    for block in re.findall(r"(?:^ {4,}.*\n|^\n(?= {4}))+", without_blocks(page), re.M):
        assert is_data(textwrap.dedent(block)), block


@pytest.mark.parametrize(
    ("shown", "printed"),
    [
        ("mass 9.58 kg", "mass 9.59 kg"),
        ("settled after 4 periods", "settled after 4 cycles"),
        ("Passed", "Warning\nPassed"),
        ("first\n…\nlast", "first"),
        ("second\nfirst", "first\nsecond"),
    ],
)
def test_an_output_that_differs_is_found(shown: str, printed: str) -> None:
    with pytest.raises(AssertionError):
        require_shown(shown.splitlines(), printed, "guide.md:1", same_numbers=True)


def test_paths_runs_and_on_request_numbers_may_differ() -> None:
    shown = ["Report: /home/anna/runs/01M8FBPNY744RHWHGCP4CFPHBD/report.html", "…", "9.58 kg"]
    printed = "Report: /tmp/01M8FBR81CXDKMV4X5XK5PM7G9/report.html\nof run 1\n-9.6  kg\nNext"
    assert require_shown(shown, printed, "guide.md:1") == "Next"


@EACH_GUIDE
def test_a_guide_has_the_required_sections(page: Path) -> None:
    titles = re.findall(r"^## (.+)$", page.read_text(encoding="utf-8"), re.M)
    parts = [part for title in titles for part in PARTS if title.split(":")[0] == part]
    assert parts == list(PARTS)
    assert titles[-1] == "Next"


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("recrod ir361 motion.yaml", click.UsageError),
        ("record ir361 motion.yaml --paec 1", click.NoSuchOption),
        ("record ir361 motion.yaml --pace fast", RidDaqError),
    ],
)
def test_a_mistake_in_a_command_is_detected(root: Root, line: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        check_command(root, line.split())
