#!/usr/bin/env bash
# Builds a sanitizer preset and runs the tests that it can judge: sanitize.sh asan|tsan.
#
# asan (address + undefined): all tests but those that start processes, which run the same code again.
#   Nor the comparisons of light with a path tracer, which are a matter of statistics and take minutes each; the tests beside
#   them run the same code. Leaks are left out: the OpenCL loader, PoCL and LLVM keep memory until the process ends and are not built by us.
# tsan: the tests labelled `tsan`: what is shared between threads and free of gRPC, TBB and OpenCL. Debian's builds of those
#   are not instrumented, so every lock of theirs would be reported as a race.
set -euo pipefail
cd "$(dirname "$0")"
preset=${1:?usage: sanitize.sh asan|tsan}
cmake --preset "$preset"
case $preset in
  asan)
    export ASAN_OPTIONS=detect_leaks=0:detect_stack_use_after_return=1 UBSAN_OPTIONS=print_stacktrace=1
    ninja -C build-asan
    ctest --test-dir build-asan --output-on-failure --parallel 2 --label-exclude process \
      --exclude-regex 'AgreesWithThePathTracer|IsReciprocal|GlossyFurnace|TargetedPowerIs'
    ;;
  tsan)
    export TSAN_OPTIONS=halt_on_error=1
    ninja -C build-tsan tsan_tests
    ctest --test-dir build-tsan --output-on-failure --label-regex tsan
    ;;
  *)
    echo "sanitize: no preset $preset" >&2
    exit 2
    ;;
esac
