"""Check the types of the pages' JavaScript: `.venv/bin/python -m tests.builders.javascript_types`.

The types are written to `javascript/types/generated.d.ts`, which git ignores; editors read it too.
`tsc` then checks all JavaScript by `tsconfig.json`. The sources of the types are:

- requests, answers and events: the OpenAPI document;
- results of jobs, and documents that only pages receive: their Python types;
- elements: the templates.
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType, UnionType
from typing import Any, Final, get_args, get_type_hints, is_typeddict

import typing_extensions
from pydantic import TypeAdapter

ROOT: Final = Path(__file__).resolve().parent.parent.parent
OPENAPI: Final = ROOT / "docs" / "reference" / "openapi.json"
TEMPLATES: Final = ROOT / "rid_daq" / "workbench" / "templates"
GENERATED: Final = ROOT / "javascript" / "types" / "generated.d.ts"
COMPILERS: Final = ROOT / "javascript" / "node_modules" / "@typescript"

_REFERENCE: Final = "#/components/schemas/"
_NAMES: Final = {
    "string": "string",
    "integer": "number",
    "number": "number",
    "boolean": "boolean",
    "null": "null",
}
_START: Final = '""'
"""Empty first part of an address that begins with a slash."""

_HEAD: Final = "// Made by tests/builders/javascript_types.py. Do not edit.\n"
_PARTS: Final = """\
  type Parts<P extends string> = P extends `${infer Path}?${string}` ? Parts<Path>
    : P extends `${infer Head}/${infer Rest}` ? [Head, ...Parts<Rest>] : [P];
"""
_TAGS: Final = {
    "a": "HTMLAnchorElement",
    "button": "HTMLButtonElement",
    "datalist": "HTMLDataListElement",
    "details": "HTMLDetailsElement",
    "form": "HTMLFormElement",
    "input": "HTMLInputElement",
    "output": "HTMLOutputElement",
    "select": "HTMLSelectElement",
    "textarea": "HTMLTextAreaElement",
}
_ELEMENT: Final = re.compile(r'<(\w+)\b(?:\{[{%].*?[%}]\}|[^<>])*?\sid="([\w-]+)"')
_MACRO: Final = re.compile(r'work\.(choice|field)\("([\w-]+)"')
_MACRO_TAGS: Final = {"choice": "select", "field": "input"}


def generated_types() -> str:
    """Return the declarations of all types that are made from the service and its templates."""
    document = json.loads(OPENAPI.read_text(encoding="utf-8"))
    own = document["components"]["schemas"]
    results = _result_types(own["JobKind"]["enum"])
    documents = {each for kinds in results.values() for each in kinds if is_typeddict(each)}
    found = [*_page_documents(), *map(_with_resolved_names, documents)]
    schemas: dict[str, Any] = {**own, **_schemas_of(found)}
    partial = _request_schemas(document, schemas) | {each.__name__ for each in documents}
    lines = [_HEAD, "declare namespace Api {\n", _PARTS]
    for name, schema in sorted(schemas.items()):
        lines.append(_declaration(name, schema, is_partial=name in partial))
    lines.append("  interface Requests {\n")
    lines += [f"    {kind}: {_identifier(f'Request-{kind}')};\n" for kind in results]
    lines.append("  }\n  interface Results {\n")
    lines += [f"    {kind}: {_result_type(types)};\n" for kind, types in results.items()]
    lines += ["  }\n", *_routes(document), "}\n\n", "interface PageElements {\n"]
    for name, tags in sorted(element_tags().items()):
        types = " | ".join(sorted({_TAGS.get(tag, "HTMLElement") for tag in tags}))
        lines.append(f'  "{name}": {types};\n')
    return "".join([*lines, "}\n"])


def element_tags() -> dict[str, set[str]]:
    """Return the tags of all elements of the templates that have an id, by the id."""
    found: dict[str, set[str]] = {}
    for path in sorted(TEMPLATES.glob("*.html")):
        text = path.read_text(encoding="utf-8")
        tags = [(tag, name) for tag, name in _ELEMENT.findall(text)]
        tags += [(_MACRO_TAGS[macro], name) for macro, name in _MACRO.findall(text)]
        for tag, name in tags:
            found.setdefault(name, set()).add(tag)
    return found


def write_types() -> None:
    GENERATED.write_text(generated_types(), encoding="utf-8")


def type_errors(project: Path = ROOT) -> str:
    """Return the errors that `tsc` finds in the JavaScript of a project folder.

    Raises:
        FileNotFoundError: The build has not installed TypeScript.
    """
    words = (_compiler(), "--project", project, "--pretty", "false")
    return subprocess.run(words, capture_output=True, text=True, check=False, cwd=project).stdout


def compiled_scripts(scripts: Mapping[str, str], folder: Path) -> dict[str, str]:
    """Return scripts as `tsc` rewrites them: without comments, and with its own line breaks.

    Args:
        scripts: Texts by file name.
        folder: Empty folder for the files.
    """
    for name, text in scripts.items():
        (folder / name).write_text(text, encoding="utf-8")
    made = folder / "compiled"
    words = (
        *("--allowJs", "--noCheck", "--noResolve", "--ignoreConfig", "--removeComments"),
        *("--target", "es2024", "--module", "esnext", "--outDir", made),
    )
    # `tsc` also writes a script with a syntax error; then its exit code is not 0
    subprocess.run((_compiler(), *words, *scripts), capture_output=True, check=False, cwd=folder)
    return {path.name: path.read_text(encoding="utf-8") for path in made.iterdir()}


def _compiler() -> Path:
    found = sorted(COMPILERS.glob("typescript-*/lib/tsc"))
    if not found:
        raise FileNotFoundError(
            "TypeScript is not installed: delete rid_daq/workbench/bundled, and run `uv sync`"
        )
    return found[0]


def assert_declared(document: Mapping[str, object], interface: str) -> None:
    """Assert that a document fits a hand-written interface.

    The document must have all required keys and no undeclared key.
    """
    text = "".join(path.read_text(encoding="utf-8") for path in GENERATED.parent.glob("*.d.ts"))
    (body,) = re.findall(
        rf"^interface {interface} \{{\n(.*?)\n\}}$", text, re.DOTALL | re.MULTILINE
    )
    keys = re.findall(r"^  (\w+)(\??):", body, re.MULTILINE)
    assert (
        {key for key, optional in keys if not optional} <= {*document} <= {key for key, _ in keys}
    )


def _page_documents() -> tuple[type, ...]:
    """Return the types of documents that only pages receive; the API does not list them."""
    from rid_daq.robot_view.scene_encoding import SceneDocument
    from rid_daq.workbench.data_check import DataCheck
    from rid_daq.workbench.files.pose_list import PoseList
    from rid_daq.workbench.files.pose_routes import MotionText
    from rid_daq.workbench.payload_sessions import CellSessions
    from rid_daq.workbench.view.resting_pose import RestingPose

    return (SceneDocument, RestingPose, PoseList, MotionText, DataCheck, CellSessions)


def _schemas_of(types: Iterable[Any]) -> dict[str, Any]:
    adapters: list[Any] = [(each.__name__, "serialization", TypeAdapter(each)) for each in types]
    _, found = TypeAdapter.json_schemas(adapters, ref_template=_REFERENCE + "{model}")
    definitions: dict[str, Any] = found["$defs"]
    return definitions


def _result_types(kinds: Iterable[str]) -> dict[str, tuple[Any, ...]]:
    """Return the types of the documents that the operation of each kind of job returns."""
    from rid_daq.operations.catalogue import OF_KINDS, operation

    found: dict[str, tuple[Any, ...]] = {}
    for kind in kinds:
        results = _returned(operation(OF_KINDS[kind]).run)
        found[kind] = tuple(each for result in results for each in _returned(result.document))
    return found


def _returned(function: Any) -> tuple[Any, ...]:
    """Return the types that a function is declared to return."""
    module = sys.modules[function.__module__]
    found = eval(function.__annotations__["return"], _names_of(module))
    return get_args(found) if isinstance(found, UnionType) else (found,)


def _names_of(module: ModuleType) -> dict[str, Any]:
    """Return the names of a module, including those that it imports for type checkers only."""
    for node in ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            exec(compile(ast.Module(node.body, []), "", "exec"), vars(module))
    return vars(module)


def _with_resolved_names(document: Any) -> Any:
    """Return the same `TypedDict` in the form that pydantic needs before Python 3.12."""
    hints = get_type_hints(document, _names_of(sys.modules[document.__module__]), None, True)
    return typing_extensions.TypedDict(document.__name__, hints)  # type: ignore[operator]


def _result_type(types: tuple[Any, ...]) -> str:
    """Return the type of a result; any key can be absent if one of `types` is no `TypedDict`."""
    declared = " | ".join(sorted(each.__name__ for each in types if is_typeddict(each)))
    if not declared:
        return "Record<string, unknown>"
    return declared if all(map(is_typeddict, types)) else f"Partial<{declared}>"


def _request_schemas(document: Mapping[str, Any], schemas: Mapping[str, Any]) -> set[str]:
    """Return the names of the schemas of requests and of the schemas that they reference.

    In them, a field with a default can be absent.
    """
    waiting = [name for name in schemas if name.startswith("Request-")]
    for verbs in document["paths"].values():
        for operation in verbs.values():
            waiting += _references(operation.get("requestBody", {}))
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _references(schemas[name])
    return found


def _references(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if isinstance(reference := schema.get("$ref"), str):
            yield reference.removeprefix(_REFERENCE)
        schema = list(schema.values())
    if isinstance(schema, list):
        for each in schema:
            yield from _references(each)


def _declaration(name: str, schema: Mapping[str, Any], *, is_partial: bool) -> str:
    """Return the declaration of a schema; if `is_partial`, optional keys can be absent."""
    if "properties" not in schema:
        return f"  type {_identifier(name)} = {_type(schema)};\n"
    required = schema.get("required", ()) if is_partial else schema["properties"]
    lines = [
        f'    "{key}"{"" if key in required else "?"}: {_type(each)};\n'
        for key, each in schema["properties"].items()
    ]
    return "".join([f"  interface {_identifier(name)} {{\n", *lines, "  }\n"])


def _identifier(name: str) -> str:
    return re.sub(r"\W", "_", name)


def _type(schema: Mapping[str, Any]) -> str:
    """Return the TypeScript type of a JSON schema."""
    if "$ref" in schema:
        return _identifier(schema["$ref"].removeprefix(_REFERENCE))
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " | ".join(_type(each) for each in schema[key])
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(map(json.dumps, schema["enum"]))
    if "prefixItems" in schema:
        return f"[{', '.join(_type(each) for each in schema['prefixItems'])}]"
    kind = schema.get("type")
    if kind == "array":
        item = _type(schema.get("items", {}))
        fixed = schema.get("minItems")
        if fixed is not None and fixed == schema.get("maxItems"):
            return f"[{', '.join([item] * fixed)}]"
        return f"Array<{item}>"
    if kind == "object":
        values = schema.get("additionalProperties", True)
        return f"Record<string, {_type(values) if isinstance(values, dict) else 'unknown'}>"
    return _NAMES.get(str(kind), "unknown")


def _routes(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the declarations of the types `AnswerTo` and `BodyOf`.

    Their parameters are a method and the parts of an address.
    """
    answers, bodies = {}, {}
    for path, verbs in document["paths"].items():
        if not path.startswith("/api/v1/"):
            continue
        parts = path.removeprefix("/api/v1").split("/")
        for verb, operation in verbs.items():
            key = (verb.upper(), *("" if part.startswith("{") else part for part in parts[1:]))
            good = [each for code, each in operation["responses"].items() if code[0] == "2"]
            answers[key] = _content(good[0]) if good else "unknown"
            bodies[key] = _content(operation.get("requestBody", {}), "Record<string, never>")
    for name, types, other in (("AnswerTo", answers, "never"), ("BodyOf", bodies, "unknown")):
        yield f"  type {name}<M extends string, P extends string[]> =\n"
        for key in sorted(types, key=lambda key: (key.count(""), key)):
            method, *parts = [json.dumps(part) if part else "string" for part in key]
            yield f"    [M, ...P] extends [{', '.join([method, _START, *parts])}]"
            yield f" ? {types[key]} :\n"
        yield f"    {other};\n"


def _content(part: Mapping[str, Any], absent: str = "null") -> str:
    content = part.get("content")
    return absent if content is None else _type(content["application/json"]["schema"])


def main() -> int:
    """Write the types, print the errors, and return 1 if there are any."""
    write_types()
    errors = type_errors()
    sys.stdout.write(errors)
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
