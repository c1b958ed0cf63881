# Sourced by demo.sh and check.sh: makes or refreshes .venv from uv.lock, with what it needs itself.
# Needs Python 3.11 or newer; uses uv where it is installed, else a copy of its own under .uv/.
# Arguments are handed to `uv sync`.

rid_daq_python() {
    for candidate in python3 python3.14 python3.13 python3.12 python3.11 python; do
        if command -v "$candidate" >/dev/null 2>&1 &&
            "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return 0
        fi
    done
    echo "rid-daq needs Python 3.11 or newer on the PATH; found none." >&2
    return 1
}

# Prints the path of uv: the installed one, else a copy under .uv/ that is made here.
rid_daq_uv() {
    local python
    if command -v uv; then
        return 0
    fi
    python=$(rid_daq_python) || return 2
    if [ ! -x .uv/bin/uv ]; then
        if ! "$python" -m venv .uv; then
            echo "$python cannot make a virtual environment; on Debian: apt install python3-venv" >&2
            return 2
        fi
        .uv/bin/python -m pip install --quiet --disable-pip-version-check 'uv>=0.9' >&2 || return 2
    fi
    echo .uv/bin/uv
}

rid_daq_environment() {
    local python uv
    python=$(rid_daq_python) || return 2
    uv=$(rid_daq_uv) || return 2
    UV_PYTHON_DOWNLOADS=never "$uv" sync --quiet --frozen --inexact --compile-bytecode \
        --python "$python" "$@" || {
        echo "Could not make the environment .venv from uv.lock (is this machine on line?)." >&2
        return 2
    }
}
