"""Write the service's API as `openapi.json`: `python docs/reference/api.py`.

The file is not written if a change would break programs that were written for its last version,
unless the first number of `API_VERSION` has changed.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from rid_daq.service.api.app import make_api, openapi_of
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.request_check import request_schemas
from rid_daq.service.service import CellService

HERE = Path(__file__).resolve().parent
OPENAPI = HERE / "openapi.json"


def openapi() -> str:
    """Return the OpenAPI document of the present code."""
    with tempfile.TemporaryDirectory() as folder:
        service = CellService(Path(folder), [])
        app = make_api(service, Authenticator(service.tokens, 0, secure=False))
        return json.dumps(openapi_of(app), indent=1, sort_keys=True) + "\n"


WITHDRAWN = (
    r"Request-payload(-\w+)?: is gone",
    "JobKind: payload is gone",
    "Documented: is gone",
    "Tabled: is gone",
    "Request-design-MultisineOptions: is gone",
    "Request-design-SearchOptions: is gone",
    "Request-design-TwoHarmonicOptions: is gone",
    "Request-identify-EstimationRequest.loaded: is gone",
    "Request-payload_identify-Known: is gone",
    "Request-payload_identify-ModelOptions: is gone",
    "Request-payload_identify-PayloadLimits: is gone",
    r"Request-\w+-(Simulation\.faults|FaultScript|\w+Fault|HeldUp|StrangeFrames): is gone",
    r"Request-\w+-(ProcessFrozen|ProcessKilled|ProgramSignalled): is gone",
    r"Request-\w+-(AxisTestRule|LiveOptions): is gone",
    r"(Job|Lease|Ticket|Token)Wanted: is gone",
    r"(LeaseRenewed|StopAsked|Pairing(Asked|Begun|Confirmed)): is gone",
    r"(Answered|Asked|Ended|Judged|KeyRefused|MotionBegun): is gone",
    r"(Progressed|Resulted|Said|StateEntered|WarmedUp): is gone",
)
"""Removals that are permitted although they break programs, as regular expressions.

Reasons, by schema:

- `design`: the option schemas have other names; the same JSON documents are accepted as before.
- Fault scripts in requests could kill the service's processes and fill its disk. Now `record` takes
  the path of a fault script.
- `AxisTestRule`: with it, a client could claim that a key is held.
- `LiveOptions`: no client could use the live page.
- `loaded` inside `how` of `identify` had no effect; `loaded` of the request names the runs with a
  payload.
- The kind of job `payload` is now `payload_session`, like its command.
- The events `documented` and `tabled` are now parts of the event `result`.
- The schemas of some request bodies and of all events have other names; their JSON documents are
  the same as before.
"""

BODIES = ("Creation", "Renewal", "Query", "Confirmation")
"""Ends of the names of schemas that are request bodies."""


def _is_withdrawn(place: str) -> bool:
    return any(re.fullmatch(each, place) for each in WITHDRAWN)


def breaks(before: Any, after: Any) -> list[str]:
    """Return the removed parts of an API, and the parts that have become required, one per line."""
    found: list[str] = []
    for method_or_path in before.get("paths", {}):
        if method_or_path not in after["paths"]:
            found.append(f"{method_or_path}: is gone")
            continue
        old, new = before["paths"][method_or_path], after["paths"][method_or_path]
        found += [f"{verb} {method_or_path}: is gone" for verb in old if verb not in new]
        for verb in set(old) & set(new):
            known = {each["name"] for each in old[verb].get("parameters", [])}
            asked = [
                each["name"]
                for each in new[verb].get("parameters", [])
                if each.get("required") and each["name"] not in known
            ]
            found += [f"{verb} {method_or_path}: asks for {name}" for name in asked]
    old_schemas = before.get("components", {}).get("schemas", {})
    new_schemas = after.get("components", {}).get("schemas", {})
    for name, old in old_schemas.items():
        new = new_schemas.get(name)
        if new is None:
            found.append(f"{name}: is gone")
            continue
        gone = set(old.get("properties", {})) - set(new.get("properties", {}))
        found += [f"{name}.{each}: is gone" for each in sorted(gone)]
        asked_now = set(new.get("required", [])) - set(old.get("required", []))
        known = set(old.get("properties", {}))
        is_body = name.startswith("Request-") or name.endswith(BODIES)
        asked_now -= set() if is_body else set(new.get("properties", {})) - known
        found += [f"{name}.{each}: is asked for" for each in sorted(asked_now)]
        values = set(map(str, old.get("enum", []))) - set(map(str, new.get("enum", [])))
        found += [f"{name}: {each} is gone" for each in sorted(values)]
    return found


def main() -> int:
    """Write the file; if a change would break programs, print the broken parts instead."""
    request_schemas.cache_clear()
    new = openapi()
    if OPENAPI.exists():
        before, after = json.loads(OPENAPI.read_text(encoding="utf-8")), json.loads(new)
        same = before["info"]["version"].split(".")[0] == after["info"]["version"].split(".")[0]
        broken = [each for each in breaks(before, after) if not _is_withdrawn(each)] if same else []
        if broken:
            sys.stderr.write(
                "\n".join(
                    [
                        *broken,
                        f"{OPENAPI.name} is not written: these changes would break programs",
                        "",
                    ]
                )
            )
            return 1
    OPENAPI.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
