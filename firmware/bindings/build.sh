#!/bin/sh
# Builds firmware/build/libgemelo_core.so, the firmware core for Python; skipped when nothing has changed.
set -eu
firmware=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
library=$firmware/build/libgemelo_core.so
sources="$firmware/core/*.cpp $firmware/platform/host/*.cpp $firmware/bindings/*.cpp"
compiler=${CXX:-c++}

if [ -f "$library" ] && [ -z "$(find "$firmware/core" "$firmware/platform/host" "$firmware/bindings" \
        \( -name '*.cpp' -o -name '*.h' -o -name build.sh \) -newer "$library" -print | head -n 1)" ]; then
    echo "firmware core: up to date"
    exit 0
fi
if ! command -v ${compiler%% *} >/dev/null 2>&1; then
    echo "firmware core: no C++ compiler ($compiler); install one: sudo apt-get install g++" >&2
    exit 1
fi
echo "firmware core: compiling libgemelo_core.so with $compiler (a few seconds) ..."
mkdir -p "$firmware/build"
# Written beside and then renamed: a process that has the old one loaded keeps it.
fresh=$library.$$
begun=$fresh.begun
trap 'rm -f "$fresh" "$begun"' EXIT
: >"$begun"
$compiler -std=c++17 -O2 -Wall -Wextra -fPIC -shared -fno-exceptions -fno-rtti -fvisibility=default \
    -I"$firmware/core" $sources -o "$fresh"
# As old as its beginning: a source that was written meanwhile is newer.
touch -r "$begun" "$fresh"
mv "$fresh" "$library"
rm -f "$begun"
trap - EXIT
echo "firmware core: built $library"
