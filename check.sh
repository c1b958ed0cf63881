#!/usr/bin/env bash
# Every check, and every test that is not marked as slow, long or to be run alone: see CONTRIBUTING.md.
set -euo pipefail
cd "$(dirname "$0")"
. ./environment.sh
rid_daq_environment
unset PYTHONDONTWRITEBYTECODE # the tests start hundreds of processes; compiled once, they start fast
bin=.venv/bin
step() { printf '\n== %s\n' "$*"; "$@"; }
step $bin/ruff format --check .
step $bin/ruff check .
step $bin/lint-imports --no-cache
step $bin/pyright & # both take one core
pyright=$!
step $bin/mypy
wait $pyright
step $bin/python -m pytest -q -m "not slow and not alone and not long" -n 3 \
    --dist loadfile --no-loadscope-reorder --durations 20 "$@"
