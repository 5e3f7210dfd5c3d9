#!/usr/bin/env bash
# From a fresh Debian 12 to a picture: installs packages, builds, starts a server on loopback, renders the built-in scene
# through it, prints what it took, stops the server. Leaves cornell.png. Further arguments go to `treelight render`.
set -euo pipefail
cd "$(dirname "$0")"

say() { printf '\n== %s\n' "$*"; }

say 'Packages'
./setup.sh

say 'Build (Release, in build/)'
mkdir -p build
cmake --preset release >build/configure.log 2>&1 || { cat build/configure.log >&2; exit 1; }
ninja -C build treelightd treelight

say 'Server'
log=build/treelightd.log
build/server/treelightd --listen 127.0.0.1:0 --log-file build/treelightd.requests.jsonl >"$log" 2>&1 &
server=$!
stop() {
  if kill -0 "$server" 2>/dev/null; then
    kill "$server" && wait "$server" && echo 'server stopped'
  fi
}
trap stop EXIT
address=
for _ in $(seq 1800); do  # on a GPU a first start compiles the kernels
  address=$(sed -nE 's/.*listening on ([^ ]+:[0-9]+).*/\1/p' "$log" | head -n 1)
  [ -n "$address" ] && break
  kill -0 "$server" 2>/dev/null || { cat "$log" >&2; exit 1; }
  sleep 0.1
done
[ -n "$address" ] || { cat "$log" >&2; echo 'demo: the server did not start within 180 s' >&2; exit 1; }
cat "$log"

say 'Picture'
build/client/treelight --server "$address" render --scene cornell --width 512 --height 512 --photons 1000000 \
  --compare tests/references/cornell_512.exr --output cornell.png "$@"

say 'Done'
echo "picture: $PWD/cornell.png"
