#!/bin/sh
# Builds firmware/build/libgemelo_core.so, the firmware core for Python; skipped when nothing has changed.
set -eu
CDPATH= cd -- "$(dirname -- "$0")/.." # relative paths from here on: that of the project may have blanks
library=build/libgemelo_core.so
compiler=${CXX:-c++}

if [ -f "$library" ] && [ -z "$(find core platform/host bindings \
        \( -name '*.cpp' -o -name '*.h' -o -name build.sh \) -newer "$library" -print | head -n 1)" ]; then
    echo "firmware core: up to date"
    exit 0
fi
if ! command -v ${compiler%% *} >/dev/null 2>&1; then
    echo "firmware core: no C++ compiler ($compiler); install one: sudo apt-get install g++" >&2
    exit 1
fi
echo "firmware core: compiling libgemelo_core.so with $compiler (a few seconds) ..."
mkdir -p build
# Written beside and then renamed: a process that has the old one loaded keeps it.
fresh=$library.$$
begun=$fresh.begun
trap 'rm -f "$fresh" "$begun"' EXIT
: >"$begun"
$compiler -std=c++17 -O2 -Wall -Wextra -fPIC -shared -fno-exceptions -fno-rtti -fvisibility=default \
    -Icore core/*.cpp platform/host/*.cpp bindings/*.cpp -o "$fresh"
# As old as its beginning: a source that was written meanwhile is newer.
touch -r "$begun" "$fresh"
mv "$fresh" "$library"
rm -f "$begun"
trap - EXIT
echo "firmware core: built firmware/$library"
