"""The pages' JavaScript has no type errors; wrong names of the service's API are type errors."""

from __future__ import annotations

import json
from pathlib import Path

from tests.builders.javascript_types import ROOT, type_errors, write_types

STATIC = ROOT / "rid_daq" / "workbench" / "static"
MISTAKES = f"""\
import {{ find }} from "{STATIC}/dom.js";
import {{ JobPanel }} from "{STATIC}/job_panel.js";
import {{ CELL, ask, on }} from "{STATIC}/service.js";
const status = await ask("GET", CELL);
find("now").textContent = status.not_ready_because;
find("now").textContent = status.not_ready_becaus;
find("now").textContent = (await ask("GET", `${{CELL}}/preflght`)).problem;
await ask("POST", `${{CELL}}/lease`, {{ note: "", second: 15 }});
new JobPanel(find("job")).begin("jog", {{ hom: true }});
on("event", (_, event) => event.kind === "said" && event.txt);
find("nwo").hidden = true;
new JobPanel(find("job"), {{ ended: (job) => job.kind === "loop" && job.document?.run }});
new JobPanel(find("job"), {{ ended: (job) => job.kind === "loop" && job.document?.feedforward }});
new JobPanel(find("job"), {{ ended: (job) => job.document?.run }});
"""
WRONG_NAMES = {
    6: "not_ready_becaus",
    7: "problem",
    8: "second",
    9: "hom",
    10: "txt",
    11: "nwo",
    13: "feedforward",
    14: "run",
}
"""Wrong name in each wrong line of `MISTAKES`.

In line 7, the answer to the misspelt address has no fields; in lines 13 and 14, the kind of job has
no such result.
"""


def test_the_javascript_has_no_type_errors() -> None:
    write_types()
    assert type_errors() == ""


def test_misspelt_names_of_the_service_are_type_errors(tmp_path: Path) -> None:
    write_types()
    (tmp_path / "mistakes.js").write_text(MISTAKES, encoding="utf-8")
    types = str(ROOT / "javascript" / "types" / "*.d.ts")
    project = {"extends": str(ROOT / "tsconfig.json"), "include": ["mistakes.js", types]}
    (tmp_path / "tsconfig.json").write_text(json.dumps(project), encoding="utf-8")
    lines = type_errors(tmp_path).splitlines()
    found = [each for each in lines if each.startswith("mistakes.js")]
    assert len(found) == len(WRONG_NAMES)
    for (number, name), line in zip(WRONG_NAMES.items(), found, strict=True):
        assert line.startswith(f"mistakes.js({number},")
        assert f"'{name}'" in line or f'"{name}"' in line
