#!/usr/bin/env bash
# Breaks each promise that the run of faults watches, one at a time, and expects the run to notice:
# checker_check.sh FAULTS BREAKABLE_SERVER [PROMISE...]. Then the same server with nothing broken, of which there must be
# nothing to tell. Prints a line for each; exits 1 where one was not noticed.
set -uo pipefail
faults=$1 server=$2
shift 2
promises=("$@")
[ ${#promises[@]} -gt 0 ] || promises=(damaged_file drain dropped_connection durable_build durable_delete expiry leftovers
  limits memory newest open_calls other_version refused_build request_id checksum short_upload stall ties version)
seconds=60
failed=0

# Two at once: most of the time of a run is spent waiting.
check() {
  local promise=$1 told begin=$SECONDS
  told=$(TREELIGHT_BREAK=$promise "$faults" --server "$server" --seconds "$seconds" 2>&1)
  local code=$?
  local rules=$(sed -n 's/^NOT KEPT, \([^:]*\):.*/\1/p' <<<"$told" | sort -u | paste -sd,)
  if [ "$code" = 1 ] && [ -n "$rules" ]; then
    printf 'noticed      %-20s by: %s (%d s)\n' "$promise" "$rules" $((SECONDS - begin))
  else
    printf 'NOT NOTICED  %-20s exit code %d\n%s\n' "$promise" "$code" "$told"
    return 1
  fi
}
running=0
for promise in "${promises[@]}"; do
  check "$promise" &
  running=$((running + 1))
  if [ "$running" -ge 2 ]; then
    wait -n || failed=1
    running=$((running - 1))
  fi
done
while [ "$running" -gt 0 ]; do
  wait -n || failed=1
  running=$((running - 1))
done
"$faults" --server "$server" --seconds 5 || failed=1
exit $failed
