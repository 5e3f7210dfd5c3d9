#!/usr/bin/env bash
# Installs what is missing, builds Release and runs all tests through CTest. Further arguments go to ctest.
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh
cmake --preset release
ninja -C build
ctest --test-dir build --output-on-failure --parallel 2 "$@"
