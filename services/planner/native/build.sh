#!/bin/sh
# Builds the motion core for the interpreter given (.venv's by default); skipped when nothing has changed.
# Exit code 3 where the interpreter has no headers: the caller may go on without the core.
set -eu
python=${1:-$(dirname -- "$0")/../../../.venv/bin/python}
case $python in /*) ;; *) python=$PWD/$python ;; esac
CDPATH= cd -- "$(dirname -- "$0")" # relative paths from here on: that of the project may have blanks
compiler=${CXX:-c++}
build=build

ask() { "$python" -c "$1"; }
headers=$(ask 'import sysconfig; print(sysconfig.get_paths()["include"])')
library=_motion$(ask 'import sysconfig; print(sysconfig.get_config_var("EXT_SUFFIX"))')
if [ ! -f "$headers/Python.h" ]; then
    echo "motion core: $headers/Python.h is missing; install it: sudo apt-get install python3-dev" >&2
    exit 3
fi
nanobind=$(ask 'import nanobind; print(nanobind.source_dir())')
stamp="$compiler $headers $nanobind"
if [ -f "$library" ] && [ "$(cat "$build/stamp" 2>/dev/null)" = "$stamp" ] && \
        [ -z "$(find src build.sh -type f -newer "$library" -print | head -n 1)" ]; then
    echo "motion core: up to date"
    exit 0
fi
if ! command -v ${compiler%% *} >/dev/null 2>&1; then
    echo "motion core: no C++ compiler ($compiler); install one: sudo apt-get install g++" >&2
    exit 1
fi
echo "motion core: compiling $library with $compiler (about half a minute) ..."
mkdir -p "$build"
common="-std=c++17 -fPIC -fvisibility=hidden -DNDEBUG"
# The same bits on every processor: no fused multiply-add, no reassociation. No sqrt call for its errno.
exact="-O3 -ffp-contract=off -fno-math-errno -fno-exceptions -fno-rtti -Wno-psabi"
# An error only where CI builds: another compiler may warn of more.
warnings="-Wall -Wextra -Wconversion -Wshadow ${CI:+-Werror}"
objects="$build/nanobind.o $build/module.o $build/trajectories.o $build/vector.o $build/plain.o"
has_avx2=$($compiler -dM -E -x c++ /dev/null | grep -o -m 1 __x86_64__ || true)
[ -z "$has_avx2" ] || objects="$objects $build/avx2.o"

kernel() { # NAME OPTION...
    name=$1
    shift
    $compiler $common $exact $warnings "$@" -c src/kernel.cpp -o "$build/$name.o"
}
kernels() {
    kernel vector
    kernel plain -fno-tree-vectorize -DGEMELO_PLAIN_LANES
    [ -z "$has_avx2" ] || kernel avx2 -mavx2
}
module() {
    set -- -isystem "$nanobind/../include" -isystem "$nanobind/../ext/robin_map/include" -isystem "$headers"
    for name in module trajectories; do
        $compiler $common -O3 -ffp-contract=off $warnings "$@" -c "src/$name.cpp" -o "$build/$name.o"
    done
    [ "$(cat "$build/nanobind.stamp" 2>/dev/null)" = "$stamp" ] && [ -f "$build/nanobind.o" ] || {
        $compiler $common -Os -w -fno-strict-aliasing "$@" -c "$nanobind/nb_combined.cpp" -o "$build/nanobind.o"
        printf '%s\n' "$stamp" >"$build/nanobind.stamp"
    }
}
# Two at once, which is what a small machine has cores and memory for.
(set -e && kernels) &
first=$!
(set -e && module) &
wait $! || { wait $first || true; exit 1; }
wait $first || exit 1
# Written beside and then renamed: a process that has the old one loaded keeps it.
fresh=$library.$$
trap 'rm -f "$fresh"' EXIT
$compiler -shared $objects -o "$fresh"
mv "$fresh" "$library"
trap - EXIT
printf '%s\n' "$stamp" >"$build/stamp"
echo "motion core: built services/planner/native/$library"
