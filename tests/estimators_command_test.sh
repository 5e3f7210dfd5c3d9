#!/usr/bin/env bash
# Runs `treelight estimators` in small as a user does: estimators_command_test.sh TREELIGHT. Exit code 77: what draws charts
# is not installed.
set -euo pipefail
treelight=$(realpath "${1:?usage: estimators_command_test.sh TREELIGHT}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
fail() {
  echo "estimators_command_test: $*" >&2
  exit 1
}
small=(--photons 1000,10000 --k 10,50 --total-photons 40000 --summed 10000 --gathered 1000)
native=$("$treelight" devices --local | awk '/ native / {print $1}')

# Every line has as many cells as the first; the estimates of planes are about right, those of borders a half.
"$treelight" estimators "${small[@]}" --device "$native" --no-charts --output small 2>log || fail "$(tail -n 1 log)"
awk -F, 'NR == 1 { columns = NF; for (i = 1; i <= NF; i++) at[$i] = i; next }
         { if (NF != columns || $at["samples"] < 8 || !($at["rms"] > 0)) exit 1
           bias = $at["bias"]
           if ($at["place"] == "plane" && (bias < -0.3 || bias > 0.3)) exit 1
           if ($at["place"] == "edge" && (bias < -0.7 || bias > -0.3)) exit 1
           seen[$at["place"]]++ }
         END { exit !(seen["plane"] == 24 && seen["sphere"] == 24 && seen["peak"] == 24) }' small/estimators.csv ||
  fail "$(cat small/estimators.csv)"
awk -F, 'NR > 1 { seen[$1]++; if (!($4 < 1e-4)) exit 1 } END { exit !(seen["float"] == 3 && seen["gather"] == 2) }' \
  small/sums.csv || fail "$(cat small/sums.csv)"
if "$treelight" estimators --device 'none such' --output none 2>error; then fail 'there is such a device'; fi
grep -q '^treelight: device "none such" is none of those here' error || fail "$(cat error)"
if "$treelight" estimators --k 2 2>error; then fail 'two neighbours have no deviation'; fi
grep -q '^treelight: --k: Value 2 not in range' error || fail "$(cat error)"

# Charts, or one line that says what is missing.
if ! /usr/bin/python3 -c 'import matplotlib' 2>/dev/null; then
  echo 'SKIPPED: no charts are drawn; install python3-matplotlib'
  exit 77
fi
"$treelight" estimators --from small/estimators.csv --from small/sums.csv --output charts
for chart in bias deviation caustic sums; do
  file -b "charts/$chart.png" | grep -q '^PNG image' || fail "$chart.png"
  grep -q '<svg' "charts/$chart.svg" || fail "$chart.svg"
done
printf 'a,b\n1,2\n' >wrong.csv
if "$treelight" estimators --from wrong.csv --output charts 2>error; then fail 'a wrong file is drawn'; fi
grep -q 'wrong.csv:1: neither estimators.csv nor sums.csv' error || fail "$(cat error)"
