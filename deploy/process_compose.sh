# Providing process-compose for deploy/bootstrap, as .venv/bin/process-compose. Sourced.

pinned_version=$(sed -n 's/^.*f1bonacc1\/process-compose \(v[0-9.]*\).*$/\1/p' "$tools/go.mod" | head -n 1)
oldest_version=1.46
module=github.com/f1bonacc1/process-compose
own_binary=$state/bin/process-compose
# gin's own tag: without it the generated code of an encoding that process-compose has no use for is a quarter of the build.
tags=nomsgpack
# The compilation takes two thirds of the time without what is stripped from the program anyway, and with only Go's own
# library optimized: process-compose starts, asks and stops processes, and passes their lines on.
# Measured, in CPU time of the whole build: 130 s, and 104 s where the compiler collects no garbage before it has a GiB.
compile_flags=('-gcflags=all=-dwarf=false -N -l' -gcflags=std=-dwarf=false)
chosen=$state/process-compose # a link to it, or to the one on PATH

# In order: the one on PATH, ours if built before, built by Go, built by Go's own wheel, the upstream release.
provide_process_compose() {
    local found
    found=$(type -P process-compose || true)
    [ "$found" = "$root/.venv/bin/process-compose" ] && found=''
    if [ -n "$found" ] && will_do "$found"; then
        say "using $found"
        place "$found"
    elif [ -x "$own_binary" ] && [ "$(version_of "$own_binary")" = "$pinned_version" ]; then
        place "$own_binary"
    elif by_go build_by || download_release; then
        place "$own_binary"
    else
        fail "process-compose $pinned_version could not be built or downloaded" \
            "install Go 1.24 or newer, or process-compose $oldest_version or newer, so that it is on PATH; then: make setup"
    fi
}

place() { ln -sf "$1" "$chosen"; }

version_of() { "$1" version 2>/dev/null | sed -n 's/^Version: *//p'; }

# A version that does not tell itself, as from `go install`, is judged by whether it takes our file.
will_do() {
    local version
    version=$(version_of "$1")
    case $version in
        v[0-9]* | [0-9]*) newer_or_same "${version#v}" "$oldest_version" || { say "$1 is $version: too old"; return 1; } ;;
    esac
    "$1" --dry-run -f process-compose.yaml >/dev/null 2>&1 || { say "$1 does not take process-compose.yaml"; return 1; }
}

newer_or_same() { [ "$(printf '%s\n%s\n' "$1" "$2" | sort -V | head -n 1)" = "$2" ]; }

# Upstream sets the version at link time; so do we, that `process-compose version` tells.
build_by() {
    local config=$module/src/config
    say "building process-compose $pinned_version from deploy/tools/go.mod: about a minute the first time"
    build_go "$1" "$tools" "$own_binary" -tags "$tags" "${compile_flags[@]}" \
        -ldflags "-s -w -X $config.Version=$pinned_version" "$module" 2>&1 | counted 480
}

# The last resort, trusted by HTTPS alone: its hash is not pinned, and it has never been run where this was written.
download_release() {
    local machine
    case $(uname -m) in x86_64) machine=amd64 ;; aarch64 | arm64) machine=arm64 ;; *) return 1 ;; esac
    type -P curl >/dev/null || { say "there is no curl to download the release with"; return 1; }
    say "downloading the upstream release of process-compose $pinned_version"
    mkdir -p "$state/bin"
    run curl --fail --silent --show-error --location --max-time 120 --output "$state/process-compose.tar.gz" \
        "https://github.com/F1bonacc1/process-compose/releases/download/$pinned_version/process-compose_linux_$machine.tar.gz" &&
        tar -xzf "$state/process-compose.tar.gz" -C "$state/bin" process-compose
}
