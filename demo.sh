#!/usr/bin/env bash
# The main job on the bundled simulated cell, from nothing to a report. Arguments go to `rid-daq demo`.
set -euo pipefail
cd "$(dirname "$0")"
. ./environment.sh
rid_daq_environment --no-dev
exec .venv/bin/rid-daq demo "$@"
