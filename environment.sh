# Functions for demo.sh and check.sh that create or update .venv from uv.lock.
# They need Python 3.11 or newer, and use the installed uv or a copy in .uv/.
# Arguments go to `uv sync`.

# Prints the path of the Python itself. A shim of pyenv or the Python of a virtual environment never equals the one
# that .venv was made from; uv would then remove .venv and create it again, below the programs that run from it.
rid_daq_python() {
    for candidate in python3 python3.14 python3.13 python3.12 python3.11 python; do
        if command -v "$candidate" >/dev/null 2>&1 &&
            "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11) or print(sys._base_executable))' 2>/dev/null; then
            return 0
        fi
    done
    echo "rid-daq needs Python 3.11 or newer on the PATH; but none was found: install it." >&2
    return 1
}

# Prints the path of the installed uv, or of a copy that is created in .uv/.
rid_daq_uv() {
    local python
    if command -v uv; then
        return 0
    fi
    python=$(rid_daq_python) || return 2
    if [ ! -x .uv/bin/uv ]; then
        if ! "$python" -m venv .uv; then
            echo "$python cannot create a virtual environment; on Debian: apt install python3-venv" >&2
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
        echo "Could not create the environment .venv from uv.lock: check the internet connection." >&2
        return 2
    }
}
