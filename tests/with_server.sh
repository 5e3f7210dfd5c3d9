#!/usr/bin/env bash
# Runs a command against a treelightd of its own: with_server.sh TREELIGHTD COMMAND... . TREELIGHT_SERVER is its address.
# Exit status: the command's; 1 where the server does not start, or does not drain when it is told to.
set -euo pipefail
treelightd=${1:?usage: with_server.sh TREELIGHTD COMMAND...}
shift
folder=$(mktemp -d)
touch "$folder/log"  # read below, perhaps before the server has opened it
"$treelightd" --listen 127.0.0.1:0 --log-file "$folder/requests.jsonl" >"$folder/log" 2>&1 &
server=$!
trap 'kill -KILL "$server" 2>/dev/null || true; rm -rf "$folder"' EXIT

TREELIGHT_SERVER=
for _ in $(seq 1200); do  # a first start compiles the kernels
  TREELIGHT_SERVER=$(sed -nE 's/.*listening on ([^ ]+:[0-9]+).*/\1/p' "$folder/log")
  [ -z "$TREELIGHT_SERVER" ] && kill -0 "$server" 2>/dev/null || break
  sleep 0.1
done
if [ -z "$TREELIGHT_SERVER" ]; then
  cat "$folder/log" >&2
  echo "with_server: $treelightd does not listen" >&2
  exit 1
fi

export TREELIGHT_SERVER
status=0
"$@" || status=$?
kill "$server"
wait "$server" || { echo "with_server: $treelightd ended with exit code $?" >&2; status=1; }
exit "$status"
