#!/usr/bin/env bash
# What is compiled for wider vectors than every processor has must not be code that the linker may take for another's:
# simd_symbols.sh LIBRARY OBJECT... Prints each function of OBJECT that is not its own, and exits 1 where there is one.
set -euo pipefail
library=$1
shift
broken=0
for object in "$@"; do
  symbols=$(nm --demangle "$library" 2>/dev/null | sed -n "/^$object:/,/^$/p")
  if ! grep -q ' T treelight::Make' <<<"$symbols"; then
    echo "$object is not in $library"
    broken=1
  fi
  shared=$(grep -E ' [WuT] ' <<<"$symbols" | grep -vE ' T treelight::Make' || true)
  if [ -n "$shared" ]; then
    printf '%s:\n%s\n' "$object" "$shared"
    broken=1
  fi
done
exit $broken
