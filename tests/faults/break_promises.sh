#!/usr/bin/env bash
# Breaks each promise of docs/guarantees.md, one at a time, and expects what stands beside it to notice: the run of faults,
# or the tests that are named: break_promises.sh BUILD_FOLDER [SWITCH...]. Then the same with nothing broken, of which there
# must be nothing to tell. Prints a line for each; exits 1 where one was not noticed, or where sources, the table below and
# docs/guarantees.md do not have the same switches.
set -uo pipefail
build=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."

# SWITCH of server/break_switch.h, PROGRAM that must fail, FILTER of its tests
table='
alike                   breakable_tests       ServiceReplicasTest.TheNewestIsTheNewestOfAll:ServiceReplicasTest.WhatOneDeletesIsGoneEverywhere
build_slots             breakable_tests       ServiceAdmissionTest.BuildsOverTheirSlotsAreRefusedAndOneGoesOnAfterwards
cancelled_in_queue      breakable_tests       DeviceQueueTest.AJobNobodyWaitsForIsToldInsteadOfRun
certificate_change      server_tls_test       ServerTlsTest.CertificatesThatChangeAreTakenUp
checksum                treelight_faults
client_ca               server_tls_test       ServerTlsTest.AClientCaAsksForCertificates
compression             server_half_sent_test CompressionTest.WhatIsPackedIsRefusedAndNotUnpacked
connections             server_connections_test ServerConnectionsTest.MoreConnectionsThanItHasFilesForDoNotEndIt
damaged_file            treelight_faults
dead_names              breakable_tests       MapStoreTest.NamesWithoutMapsAreForgottenAndNoVersionIsUsedTwiceStill
deadline                breakable_tests       ServiceAdmissionTest.AQueueThatCannotMeetTheDeadlineRefusesAtOnce
density                 breakable_tests       PhotonMapClientTest.GathersOfAnySizeAgreeWithBruteForce
device_failure          breakable_tests       *ServiceFaultsTest.FailsTheRequestAndNotTheServer*
distance                treelight_faults
drain                   treelight_faults
drain_delay             server_life_test      ServerLifeTest.CallsAreServedInTheDrainDelayAndRefusedAfterIt
dropped_connection      treelight_faults
durable_build           treelight_faults
durable_delete          treelight_faults
expiry                  treelight_faults
fair_queue              breakable_tests       DeviceQueueTest.ASmallJobPassesTheLargeOnesOfOtherCalls
floods                  server_flood_test     ServerFloodTest.CallsThatAreOpenedAndResetCostLittle
format_version          breakable_tests       SnapshotTest.FilesOfEveryFormatVersionLoad
health                  server_life_test      ServerLifeTest.HealthCheckFollowsTheServer
healthcheck             server_life_test      ServerLifeTest.HealthCheckFollowsTheServer
leftovers               treelight_faults
limits                  treelight_faults
loaded_once             breakable_tests       ServiceSharedFilesTest.AMapIsLoadedOnceForManyCallsAtOnce
log_reopen              server_life_test      ServerLifeTest.SighupOpensTheLogAnew
map_count               breakable_tests       ServiceAdmissionTest.AVersionMoreThanItKeepsIsRefusedUntilOneGoes
max_calls               breakable_tests       ActiveCallsTest.OneMoreThanTheLimitIsRefusedUntilOneLeaves
memory                  treelight_faults
memory_limit            breakable_tests       ServiceAdmissionTest.AnUploadOverTheMemoryLimitIsRefusedBeforeItsChunksAreRead
metric_labels           breakable_tests       ServiceMetricsTest.NoIdIsALabel
metrics                 breakable_tests       ServiceMetricsTest.RefusalsAreCountedByReason
newest                  treelight_faults
open_address            server_security_test  ServerSecurityTest.AnAddressForOthersNeedsTlsAndTokensOrInsecure
open_calls              treelight_faults
other_request           treelight_faults
other_version           treelight_faults
queue_depth             breakable_tests       DeviceQueueTest.AFullQueueRefusesAndNamesTheLimit
refused_build           treelight_faults
request_id              treelight_faults
request_id_of_last_life breakable_tests       KeptRequestIdTest.ItStandsForTheSameInTheNextLife
request_turns           breakable_tests       RequestTurnsTest.AsManyAsAllowedStartAndTheOthersOnceTurnsEnd
retry_info              breakable_tests       ServiceAdmissionTest.AnUploadThatFitsLaterIsToldWhen
route                   breakable_tests       ServiceRouteTest.AMapTheMetadataDoesNotNameIsRefused
same_tree               breakable_tests       ServiceDataTest.MapsComeBackWithAllThatIsToldOfThem:ServiceResidencyTest.IdleMapsLeaveTheDeviceForHostMemoryAndComeBack
second_signal           server_process_test   ServerProcessTest.ASecondSignalEndsItAtOnce
shared_request_id       breakable_tests       KeptRequestIdTest.BuildsOfOneRequestAtTheSameMomentMakeOneMap
shared_version          breakable_tests       ServiceDataTest.TwoServersOnOneFolderNeverWriteOneVersion
short_upload            treelight_faults
slices                  breakable_tests       ServiceSlicesTest.AStreamThatIsNotReadHoldsASliceOrTwo
socket_lock             server_process_test   ServerProcessTest.OfServersThatStartAtOnceOnOneUnixSocketOneServes
socket_mode             server_security_test  ServerSecurityTest.AUnixSocketHasThePermissionsThatWereAskedFor
stall                   treelight_faults
sync_file               breakable_tests       PowerLossTest.WhatIsWrittenIsThere
sync_folder             breakable_tests       PowerLossTest.WhatIsRemovedDoesNotComeBack:PowerLossTest.WhatIsWrittenIsThere
ties                    treelight_faults
token                   server_tokens_test    ServerTokensTest.ATokenOpensEveryCallAndHealthNeedsNone
version                 treelight_faults
withdrawn_token         server_tokens_test    ServerTokensTest.TokensAreTakenUpAndWithdrawnWhileItServes
'

failed=0
# What differs between two lists of switches.
same() {
  local difference
  difference=$(comm -3 <(sort -u <<<"$2") <(sort -u <<<"$3"))
  [ -z "$difference" ] || { printf '%s:\n%s\n' "$1" "$difference" >&2; failed=1; }
}
known=$(awk 'NF { print $1 }' <<<"$table")
same 'switches of the sources | of the table of this script' "$(grep -rhoP 'Broken\("\K[a-z_]+' server)" "$known"
same 'switches of docs/guarantees.md | of the table of this script' \
  "$(sed -n '/^| promise/,/^$/p' docs/guarantees.md | awk -F' \\| ' '{ print $NF }' | grep -oP '`\K[a-z_]+(?=`)')" "$known"

promises=("$@")
[ ${#promises[@]} -gt 0 ] || mapfile -t promises <<<"$known"

# Runs the program of one line of the table.
run() {
  local program=$1 filter=${2:-}
  case $program in
    treelight_faults) timeout 120 "$build/tests/faults/$program" --server "$build/server/breakable_server" --seconds 60 ;;
    breakable_tests) timeout 20 "$build/tests/faults/$program" --gtest_brief=1 --gtest_filter="$filter" ;;
    *) TREELIGHT_TEST_SERVER=$build/server/breakable_server timeout 40 "$build/tests/$program" --gtest_brief=1 --gtest_filter="$filter" ;;
  esac
}

check() {
  local promise=$1 program filter told code by begin=$SECONDS
  read -r _ program filter < <(awk -v promise="$promise" '$1 == promise' <<<"$table")
  told=$(TREELIGHT_BREAK=$promise run "$program" "$filter" 2>&1)
  code=$?
  by=$(sed -n 's/^NOT KEPT, \([^:]*\):.*/\1/p; s/^\[  FAILED  \] \([A-Za-z]*\.[A-Za-z0-9]*\).*/\1/p' <<<"$told" | sort -u | paste -sd,)
  # A test may also be ended by the server in its process, or wait for ever.
  if [ "$program" != treelight_faults ] && [ "$code" -gt 128 ]; then by="${by:-$filter, ended by signal $((code - 128))}"; fi
  if [ "$program" != treelight_faults ] && [ "$code" = 124 ]; then by="${by:-$filter, which does not end}"; fi
  if [ "$code" != 0 ] && [ -n "$by" ]; then
    printf 'noticed      %-24s by: %s (%d s)\n' "$promise" "$by" $((SECONDS - begin))
  else
    printf 'NOT NOTICED  %-24s exit code %d\n%s\n' "$promise" "$code" "$told"
    return 1
  fi
}

# Four at once: most of the time of a run is spent waiting.
running=0
for promise in "${promises[@]}"; do
  check "$promise" &
  running=$((running + 1))
  if [ "$running" -ge 4 ]; then
    wait -n || failed=1
    running=$((running - 1))
  fi
done
while [ "$running" -gt 0 ]; do
  wait -n || failed=1
  running=$((running - 1))
done

# With nothing broken all of it passes.
"$build/tests/faults/treelight_faults" --server "$build/server/breakable_server" --seconds 5 || failed=1
while read -r program filters; do
  run "$program" "$filters" || failed=1
done < <(awk 'NF == 3 { filters[$2] = filters[$2] ":" $3 } END { for (program in filters) print program, substr(filters[program], 2) }' <<<"$table")
exit $failed
