#!/usr/bin/env bash
# Create a release of the checked-out commit: release/release.sh FOLDER
#
# The release contains sdist and wheel (built twice; both builds must be identical), the locked requirements
# with hashes, the same as constraints without hashes (pip would require a hash of the wheel, too), a bill of
# materials (CycloneDX), the licences of all installed packages, and checksums. The checksums are signed with
# the SSH key in RID_DAQ_SIGNING_KEY. `--unsigned` makes a trial release of the last commit.
set -euo pipefail
usage="usage: RID_DAQ_SIGNING_KEY=FILE release/release.sh [--unsigned] FOLDER"
signed=yes
if [ "${1:-}" = --unsigned ]; then
    signed=no
    shift
fi
[ $# = 1 ] || { echo "$usage" >&2; exit 2; }
if [ $signed = yes ] && [ ! -f "${RID_DAQ_SIGNING_KEY:-}" ]; then
    echo "RID_DAQ_SIGNING_KEY must name the SSH key for the signature; $usage" >&2
    exit 2
fi
mkdir -p "$1"
out=$(cd "$1" && pwd)
[ -z "$(ls -A "$out")" ] || { echo "$out is not empty; name a new folder" >&2; exit 2; }
cd "$(dirname "$0")/.."
if [ $signed = yes ] && [ -n "$(git status --porcelain)" ]; then
    echo "There are uncommitted changes: commit them first." >&2
    exit 2
fi
. ./environment.sh
rid_daq_environment
uv=$(rid_daq_uv)
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for build in first second; do
    git archive --prefix=source/ HEAD | tar -x -C "$work"
    .venv/bin/python docs/site/build.py "$work/source/rid_daq/site"
    "$uv" build --out-dir "$work/$build" "$work/source"
    rm -rf "$work/source" "$work/$build/.gitignore"
done
diff -r "$work/first" "$work/second" || { echo "The two builds differ: the release is not reproducible." >&2; exit 1; }
cp "$work"/first/* "$out"

"$uv" export --quiet --frozen --no-dev --no-emit-project --output-file "$out/requirements.txt" >/dev/null
"$uv" export --quiet --frozen --no-dev --no-emit-project --no-hashes --no-header --no-annotate \
    --output-file "$out/constraints.txt" >/dev/null
"$uv" export --quiet --frozen --no-dev --format cyclonedx1.5 --preview-features sbom-export \
    --output-file "$out/rid-daq.cdx.json" >/dev/null
.venv/bin/python release/third_party.py "$out/rid-daq.cdx.json"
.venv/bin/python release/third_party.py "$out/THIRD-PARTY-LICENCES.txt"
cp release/Containerfile release/80-rid-daq.rules release/rid-daq-limits.conf "$out"
(cd "$out" && sha256sum -- * >"$work/SHA256SUMS" && mv "$work/SHA256SUMS" .)
if [ $signed = yes ]; then
    ssh-keygen -q -Y sign -f "$RID_DAQ_SIGNING_KEY" -n rid-daq "$out/SHA256SUMS"
fi
echo "$out:"
ls "$out"
