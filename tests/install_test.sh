#!/usr/bin/env bash
# Installs a build into a folder, moves it, and uses it as another project would: install_test.sh BUILD_FOLDER.
#   - every header that is installed compiles by itself, with nothing but what is installed;
#   - examples/find_package builds with find_package(treelight), and its answers agree with the installed treelightd;
#   - a project that asks for another minor version is told so.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
build=$(cd "${1:?usage: install_test.sh BUILD_FOLDER}" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
quietly() { "$@" >"$folder/log" 2>&1 || { cat "$folder/log" >&2; echo "install_test: failed: $*" >&2; exit 1; }; }

quietly cmake --install "$build" --prefix "$folder/first"
mv "$folder/first" "$folder/prefix"  # nothing in it may know where it was
prefix=$folder/prefix
for program in treelightd treelight; do "$prefix/bin/$program" --version; done
if grep -rlF -e "$build" -e "$(cd "$tests/.." && pwd)" "$prefix" --include='*.cmake' --include='*.h'; then
  echo 'install_test: the files above name the source or the build folder' >&2
  exit 1
fi

echo 'Headers'
(cd "$prefix/include/treelight" && find client core v1 -name '*.h' | sort |
  sed 's,^v1/,treelight/v1/,; s,.*,#include "&",') >"$folder/includes"
cat "$folder/includes"
while read -r include; do
  echo "$include" >"$folder/header.cc"
  quietly g++ -std=c++20 -fsyntax-only -Wall -Wextra -Werror -I "$prefix/include/treelight" -isystem "$prefix/include" \
    "$folder/header.cc"
done <"$folder/includes"

echo 'examples/find_package'
quietly cmake -S "$tests/../examples/find_package" -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_PREFIX_PATH="$prefix"
quietly cmake --build "$folder/build"
"$tests/with_server.sh" "$prefix/bin/treelightd" bash -c '"$1" "$TREELIGHT_SERVER"' bash "$folder/build/nearest_photons"

echo 'Versions'
mkdir "$folder/other"
cat >"$folder/other/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.25)
project(other LANGUAGES CXX)
find_package(treelight 0.99 REQUIRED)
END
if cmake -S "$folder/other" -B "$folder/other/build" -DCMAKE_PREFIX_PATH="$prefix" >"$folder/log" 2>&1; then
  echo 'install_test: find_package(treelight 0.99) was content' >&2
  exit 1
fi
grep -o 'treelight-config.cmake, version: .*' "$folder/log"
