#!/usr/bin/env bash
# Run the complete workflow on the bundled simulated cell, up to the report. Arguments go to `rid-daq demo`.
set -euo pipefail
cd "$(dirname "$0")"
. ./environment.sh
rid_daq_environment --no-dev
exec .venv/bin/rid-daq demo "$@"
