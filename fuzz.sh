#!/usr/bin/env bash
# Builds the fuzzers and runs each on its corpus: fuzz.sh [SECONDS [NAME...]]; 10 seconds, and all of them, where nothing
# is said. Installs clang 16 where it is missing. What they find new is kept in build-fuzz/corpus, inputs that break
# something in build-fuzz/found: build-fuzz/tests/fuzz/fuzz_NAME FILE shows it again. fuzz.sh 0 runs the corpora alone.
set -euo pipefail
cd "$(dirname "$0")"
seconds=${1:-10}
shift || true
names=("$@")
[ ${#names[@]} -gt 0 ] || names=(requests snapshot tokens photons meshes)
./setup.sh fuzz
cmake --preset fuzz
ninja -C build-fuzz "${names[@]/#/fuzz_}"
export UBSAN_OPTIONS=print_stacktrace=1 ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1
mkdir -p build-fuzz/found
for name in "${names[@]}"; do
  corpus=build-fuzz/corpus/$name
  mkdir -p "$corpus"
  limit=(-max_total_time="$seconds")
  [ "$seconds" != 0 ] || limit=(-runs=0)
  echo "fuzz: $name"
  "build-fuzz/tests/fuzz/fuzz_$name" "${limit[@]}" -timeout=10 -rss_limit_mb=2048 -max_len=16384 -print_final_stats=1 \
    -artifact_prefix="build-fuzz/found/$name-" "$corpus" "tests/fuzz/corpus/$name" 2>"build-fuzz/$name.log" ||
    { tail -n 40 "build-fuzz/$name.log" >&2; echo "fuzz: $name has found something" >&2; exit 1; }
  grep -E '^stat::number_of_executed_units|^#[0-9]+.*DONE' "build-fuzz/$name.log" || true
done
