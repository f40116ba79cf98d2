# Finding Python and uv for deploy/bootstrap. Sourced.

python_minor() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }

python_will_do() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

# The interpreter for .venv: $PYTHON, else the first on PATH that is new enough.
find_python() {
    local name path
    for name in ${PYTHON:-python3 python3.13 python3.12 python3.11 python3.14}; do
        path=$(type -P "$name") && python_will_do "$path" && printf '%s\n' "$path" && return 0
    done
    return 1
}

no_python() {
    local found
    found=$(type -P "${PYTHON:-python3}") && found="$found is $(python_minor "$found")" || found="${PYTHON:-python3} is not on PATH"
    fail "Python 3.11 or newer is needed, but $found" "sudo apt-get install python3" \
        "where the distribution's is older: PYTHON=/path/to/python3.11 make setup"
}

# uv: the one on PATH, else ours from PyPI in an environment of its own, so that no system package is touched (PEP 668).
find_uv() {
    local own=$state/tools/uv python=$1
    first_of uv && return 0
    (
        ! type -P flock >/dev/null || flock 8 # two steps at once may want it
        [ -x "$own/bin/uv" ] || own_uv "$python" "$own" >&2
    ) 8>"$state/uv.lock" || exit 1
    printf '%s\n' "$own/bin/uv"
}

own_uv() {
    say "uv is not on PATH: installing it from PyPI into .gemelo/tools/uv"
    rm -rf "$2"
    install_uv "$1" "$2" ||
        fail "uv could not be installed" "sudo apt-get install python3-venv     (Debian and Ubuntu leave it out of python3)" \
            "or install uv yourself, so that it is on PATH"
}

# By venv where ensurepip is there, else by the system's pip into a plain folder, which PEP 668 allows.
install_uv() {
    local python=$1 own=$2
    if "$python" -c 'import ensurepip' 2>/dev/null; then
        run "$python" -m venv "$own" && run "$own/bin/python" -m pip install --quiet --require-hashes -r "$tools/uv.lock"
    elif "$python" -m pip --version >/dev/null 2>&1; then
        run "$python" -m pip install --quiet --require-hashes -r "$tools/uv.lock" --target "$own"
    else
        return 1
    fi
}

# uv reads neither pip's settings nor the machine's certificates: pass both on.
[ -z "${PIP_INDEX_URL:-}" ] || export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX:-$PIP_INDEX_URL}
for certificates in "${SSL_CERT_FILE:-}" "${PIP_CERT:-}" /etc/ssl/certs/ca-certificates.crt; do
    if [ -f "$certificates" ]; then export SSL_CERT_FILE=$certificates && break; fi
done
