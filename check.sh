#!/usr/bin/env bash
# Run all checks, and all tests that are not marked slow, long or alone: see CONTRIBUTING.md.
set -euo pipefail
cd "$(dirname "$0")"
. ./environment.sh
rid_daq_environment
unset PYTHONDONTWRITEBYTECODE # the tests start hundreds of processes, which start faster from compiled files
bin=.venv/bin
step() { printf '\n== %s\n' "$*"; "$@"; }
lines="" # folder for the line counts; empty if only some tests run
tests() { step env RID_DAQ_LINES="$lines" $bin/python -m pytest -q -m "not slow and not alone and not long" "$@"; }
step $bin/ruff format --check .
step $bin/ruff check .
step $bin/lint-imports --no-cache
step nice $bin/pyright & # both run at the same time as the tests
pyright=$!
step nice $bin/mypy &
mypy=$!
if [ $# = 0 ]; then
    lines=$(mktemp -d)
    trap 'rm -rf "$lines"' EXIT
    # One process compiles the kernels first, because several would each compile all of them; it also parses the sources
    # once for all tests of their structure. If the tests are not compiled, it collects, and so compiles, all of them.
    first=(tests/dynamics tests/compensation/online tests/mock_hw/plant tests/mock_hw/amplifier
        tests/config/test_error_codes.py tests/guards tests/test_*.py)
    if [ -z "$(find tests -name '*.pyc' -print -quit)" ]; then
        tests "${first[@]/#/--only=}"
    else
        tests "${first[@]}"
    fi
    set -- --durations 20 "${first[@]/#/--ignore=}"
fi
# Five processes on two cores, because many tests wait for simulated drives, heartbeats and other programs.
tests -n 5 --dist loadfile --no-loadscope-reorder "$@"
wait $pyright
wait $mypy
[ -z "$lines" ] || step $bin/python -m tests.builders.measured_lines "$lines" --worst 20
