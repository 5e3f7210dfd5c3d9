#!/usr/bin/env bash
# Checks that includes go down only (README.md, The house): include_rule.sh [ROOT]. Prints each line that breaks
# the rule and exits 1 where there is one.
set -euo pipefail
cd "${1:-$(dirname "$0")/..}"
broken=0

# deny FOLDERS PATTERN WHY: no include in FOLDERS may match PATTERN.
deny() {
  local found
  found=$(grep -rnE --include='*.h' --include='*.cc' "^ *# *include *[<\"]($2)" $1 2>/dev/null || true)
  if [ -n "$found" ]; then
    printf '%s\n  %s\n' "$3:" "${found//$'\n'/$'\n'  }"
    broken=1
  fi
}
# allow FOLDERS PATTERN EXCEPT WHY: as deny, but for the folders that match EXCEPT.
allow() {
  local found
  found=$(grep -rnE --include='*.h' --include='*.cc' "^ *# *include *[<\"]($2)" $1 2>/dev/null | grep -vE "^($3)" || true)
  if [ -n "$found" ]; then
    printf '%s\n  %s\n' "$4:" "${found//$'\n'/$'\n'  }"
    broken=1
  fi
}

deny core 'server/|client/|treelight/v1/|grpc' 'core includes what lies above it'
deny server 'client/' 'server includes client'
deny client 'server/' 'client includes server'
allow 'core server client' 'CL/|core/device/|core/gpu/' 'core/device/|core/gpu/' 'OpenCL outside core/device and core/gpu'
allow 'core server client' 'embree' 'client/' 'Embree outside client'
deny core/device 'core/(gpu|cpu|model/(photons|tree))' 'core/device knows photons'
deny core/model 'core/(device|gpu|cpu|builder)' 'core/model includes what lies above it'
deny core/cpu 'core/(device|gpu)' 'core/cpu includes the device'
deny client 'core/(device|gpu|cpu)/' 'client reaches into core'
deny server 'core/(device|gpu|cpu)/' 'server reaches into core'
deny 'core server client' 'tests/' 'tests are included'
exit $broken
