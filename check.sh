#!/usr/bin/env bash
# Every check, and every test that is not marked as slow, long or to be run alone: see CONTRIBUTING.md.
set -euo pipefail
cd "$(dirname "$0")"
. ./environment.sh
rid_daq_environment
unset PYTHONDONTWRITEBYTECODE # the tests start hundreds of processes; compiled once, they start fast
bin=.venv/bin
step() { printf '\n== %s\n' "$*"; "$@"; }
lines="" # where the lines that tests reach are counted; nowhere if only some of the tests run
tests() { step env RID_DAQ_LINES="$lines" $bin/python -m pytest -q -m "not slow and not alone and not long" "$@"; }
step $bin/ruff format --check .
step $bin/ruff check .
step $bin/lint-imports --no-cache
step nice $bin/pyright & # beside the tests that one process runs, and behind them
pyright=$!
step nice $bin/mypy &
mypy=$!
if [ $# = 0 ]; then
    lines=$(mktemp -d)
    trap 'rm -rf "$lines"' EXIT
    # One process compiles the tests, if they are not yet, and the kernels: three would each do the others' work too.
    if [ -z "$(find tests -name '*.pyc' -print -quit)" ]; then
        collected=$(step $bin/python -m pytest --collect-only -qq) || { echo "$collected"; exit 1; }
    fi
    kernels=(tests/dynamics tests/compensation/online tests/mock_hw/plant tests/mock_hw/amplifier)
    tests "${kernels[@]}"
    set -- --durations 20 "${kernels[@]/#/--ignore=}"
fi
wait $pyright
wait $mypy
tests -n 3 --dist loadfile --no-loadscope-reorder "$@"
[ -z "$lines" ] || step $bin/python -m tests.builders.measured_lines "$lines" --worst 20
