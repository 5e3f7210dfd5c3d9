#!/usr/bin/env bash
# Builds the images and runs them as docs/containers.md says: docker/test.sh [--debootstrap] [--tests]. Uses Docker where
# its engine runs, else buildah, podman and podman-compose. What is wrong is told on stderr, and the exit code is 1.
#
#   --debootstrap  where debian:bookworm-slim is not here, make it from Debian's packages rather than pull it: for
#                  machines that reach no registry of images. Needs root
#   --tests        builds and runs the tests in a container too
#
# BASE in the environment is another image to build on, JOBS limits what is compiled at once.
set -euo pipefail
debootstrap='' tests=''
for argument in "$@"; do
  case $argument in
    --debootstrap) debootstrap=yes ;;
    --tests) tests=yes ;;
    *) echo "usage: docker/test.sh [--debootstrap] [--tests]" >&2; exit 2 ;;
  esac
done
cd "$(dirname "$0")/.."
base=${BASE:-debian:bookworm-slim}
project=treelight-test-$$
largest_mb=750

say() { printf '\n== %s\n' "$*"; }
fail() {
  echo "docker/test.sh: $*" >&2
  exit 1
}
# need PROGRAM PACKAGE...: PROGRAM is there, or we say how to get it.
need() {
  local program=$1
  shift
  command -v "$program" >/dev/null || fail "$program is missing: apt-get install $*"
}
# expect WHAT TEXT FILE: FILE holds TEXT.
expect() { grep -qF -- "$2" "$3" || { cat "$3" >&2; fail "$1: nothing says '$2'"; }; }

folder=$(mktemp -d)
containers=() volumes=()
clean_up() {
  [ ${#containers[@]} -eq 0 ] || engine rm -fv "${containers[@]}"
  [ ${#volumes[@]} -eq 0 ] || engine volume rm -f "${volumes[@]}"
  [ -z "${composed:-}" ] || uncompose
  [ -z "${played:-}" ] || unplay
  rm -rf "$folder"
} >/dev/null 2>&1
trap clean_up EXIT

# ---- What runs containers here

# engine COMMAND...: docker or podman. Podman tells of each health check that systemd does not make here; we make them.
engine() {
  if [ "$engine" = docker ]; then docker "$@"; else podman --log-level=fatal "$@"; fi
}
if command -v docker >/dev/null && docker info >/dev/null 2>&1; then
  engine=docker
  docker compose version >/dev/null 2>&1 || fail 'docker compose is missing: apt-get install docker-compose-plugin'
  compose() { docker compose -p "$project" -f docker/compose.yaml "$@"; }
else
  engine=podman
  need podman podman
  need buildah buildah
  need catatonit catatonit # of pods
  need podman-compose podman-compose golang-github-containernetworking-plugin-dnsname
  compose() { podman-compose -p "$project" -f docker/compose.yaml "$@"; }
fi

# podman-compose leaves the network.
uncompose() {
  compose down -v
  engine network rm "${project}_default" || true
} >/dev/null 2>&1

# build TARGET TAG
build() {
  local arguments=(--build-arg "BASE=$base" --build-arg "JOBS=${JOBS:-}" -f docker/Dockerfile --target "$1" -t "$2" .)
  if [ "$engine" = docker ]; then
    docker build "${arguments[@]}"
  else  # chroot: also where no namespaces are to be had; docker: the format that knows health checks
    buildah bud --isolation chroot --format docker --layers "${arguments[@]}"
  fi >"$folder/build.log" 2>&1 || { tail -n 40 "$folder/build.log" >&2; fail "image $2 does not build"; }
}

# debian:bookworm-slim from Debian's packages: as the official one without documents and caches of apt. Has what apt is
# told here of how to reach them.
make_base() {
  need debootstrap debootstrap
  [ "$(id -u)" = 0 ] || fail '--debootstrap needs root'
  local root=$folder/base mirror=http://deb.debian.org
  debootstrap --variant=minbase bookworm "$root" "$mirror/debian" >"$folder/debootstrap.log" 2>&1 ||
    { tail -n 20 "$folder/debootstrap.log" >&2; fail 'debootstrap failed'; }
  printf 'deb %s main\n' "$mirror/debian bookworm" "$mirror/debian bookworm-updates" \
    "$mirror/debian-security bookworm-security" >"$root/etc/apt/sources.list"
  printf 'path-exclude /usr/share/%s/*\n' doc man info locale groff lintian linda >"$root/etc/dpkg/dpkg.cfg.d/docker"
  echo 'path-include /usr/share/doc/*/copyright' >>"$root/etc/dpkg/dpkg.cfg.d/docker"
  apt-config dump | grep -E '^Acquire::(https?|ftp|Check-)' >"$root/etc/apt/apt.conf.d/90host" || true
  rm -rf "$root"/var/cache/apt/* "$root"/var/lib/apt/lists/* "$root"/usr/share/{doc,man,info,locale}/*
  tar -C "$root" -c . | engine import - "$base" >/dev/null
}

say "Images, on $base, by $(engine --version)"
if ! engine image inspect "$base" >/dev/null 2>&1; then
  if [ -n "$debootstrap" ]; then
    make_base
  else
    engine pull -q "$base" || fail "$base cannot be pulled; --debootstrap makes it from Debian's packages"
  fi
fi
if [ "$engine" = podman ] && ! engine run --rm "$base" true 2>/dev/null; then
  # Not root enough to raise limits, or cgroups that crun does not know: runc, with the limits of this shell.
  need runc runc
  printf '[containers]\ndefault_ulimits = ["nofile=%s:%s", "nproc=%s:%s"]\n[engine]\nruntime = "runc"\n' \
    "$(ulimit -Hn)" "$(ulimit -Hn)" 4096 4096 >"$folder/containers.conf"
  export CONTAINERS_CONF=$folder/containers.conf
  engine run --rm "$base" true || fail 'podman runs no container here'
fi
SECONDS=0
build slim treelight:slim
build runtime treelight
build prometheus treelight-prometheus
echo "built in $SECONDS s"
for image in treelight treelight:slim treelight-prometheus; do
  bytes=$(engine image inspect --format '{{.Size}}' "$image")
  printf '%-22s %4d MB\n' "$image" $((bytes / 1000000))
  if [ "$image" != treelight-prometheus ] && [ $((bytes / 1000000)) -gt $largest_mb ]; then
    fail "$image is larger than $largest_mb MB"
  fi
done

# ---- One container

# ends CODE TEXT ARGUMENT...: a container that is run with the arguments ends with CODE and says TEXT.
ends() {
  local code=0 expected=$1 text=$2
  shift 2
  timeout 120 "$engine" run --rm "$@" >"$folder/ends.log" 2>&1 || code=$?
  [ "$code" = "$expected" ] || { cat "$folder/ends.log" >&2; fail "run $*: exit code $code, not $expected"; }
  expect "run $*" "$text" "$folder/ends.log"
}

# wait_healthy CONTAINER: its own health check says so. Without systemd nobody but us asks podman to check.
wait_healthy() {
  local health=''
  for _ in $(seq 180); do
    [ "$engine" = docker ] || podman healthcheck run "$1" >/dev/null 2>&1 || true
    health=$(engine inspect --format '{{.State.Health.Status}}' "$1")
    [ "$health" != healthy ] || return 0
    [ "$(engine inspect --format '{{.State.Running}}' "$1")" = true ] || break
    sleep 1
  done
  engine logs "$1" >&2
  fail "$1 is $health and not healthy"
}

say 'What is refused'
ends 2 'give --tls-cert, --tls-key and --token-file' treelight
ends 2 'is none of those here' -e TREELIGHT_INSECURE=true -e TREELIGHT_DEVICE=nosuch treelight:slim
echo 'an address for others without TLS and tokens; a device that is not there'

# ---- compose.yaml

say 'compose.yaml: server, client and Prometheus'
export TREELIGHT_PORT=${TREELIGHT_PORT:-17543} PROMETHEUS_PORT=${PROMETHEUS_PORT:-19090}
container_of() {
  engine ps -aq --filter "label=com.docker.compose.project=$project" --filter "label=com.docker.compose.service=$1" | head -n 1
}
client() {
  engine run --rm --no-healthcheck --network "${project}_default" --user "$(id -u):$(id -g)" \
    -v "$folder/work:/work" -w /work -e TREELIGHT_SERVER=server:7543 --entrypoint treelight treelight:slim "$@"
}
mkdir "$folder/work"
composed=yes
compose up -d server prometheus >"$folder/compose.log" 2>&1 || { cat "$folder/compose.log" >&2; fail 'compose up'; }
server=$(container_of server)
SECONDS=0
wait_healthy "$server"
echo "healthy after $SECONDS s"
[ "$(engine exec "$server" id -u)" = 7543 ] || fail 'the server is run by the wrong user'
[ "$(engine exec "$server" cat /proc/1/comm)" = treelightd ] || fail 'treelightd is not process 1'
! engine exec "$server" touch /usr/a-file 2>/dev/null || fail 'the root file system can be written'

compose run --rm --no-deps -T client info >"$folder/info.log" 2>&1 # podman-compose does not tell how it ended
expect 'compose run client info' 'most photons in a map' "$folder/info.log"
client trace --scene cornell --photons 20000 --caustic-photons 0 --output photons.ply
client build --photons photons.ply --name room
client gather --map room --queries photons.ply --k 8 --radius 0.1 --outputs count,neighbors,density --output before.csv
[ "$(wc -l <"$folder/work/before.csv")" -gt 20000 ] || fail 'the gather has fewer answers than questions'
client gather --map room --queries photons.ply --k 8 --radius 0.1 --outputs count,radius,neighbors --output exact.csv
client render --scene cornell --width 96 --height 96 --photons 100000 --output room.exr --output room.png
client render --scene cornell --width 96 --height 96 --reference --spp 64 --output reference.exr
client compare room.exr reference.exr | tee "$folder/compare.log"
error=$(sed -nE 's/.*relative MSE ([0-9.e-]+).*/\1/p' "$folder/compare.log")
awk -v error="$error" 'BEGIN { exit !(error != "" && error < 0.05) }' || fail "relative MSE '$error' is not below 0.05"

say 'Prometheus reads the metrics'
# prometheus_says QUERY: the value of the metric, as Prometheus has it.
prometheus_says() {
  engine exec "$(container_of prometheus)" promtool query instant http://localhost:9090 "$1" 2>/dev/null |
    sed -nE 's/.*=> ([^ ]+) .*/\1/p' || true
}
scraped=''
for _ in $(seq 60); do
  scraped=$(prometheus_says 'treelight_maps{job="treelight"}')
  [ "$scraped" != 1 ] || break
  sleep 1
done
[ "$scraped" = 1 ] || { engine logs "$(container_of prometheus)" >&2; fail "treelight_maps is '$scraped', not 1"; }
echo 'it has one map'

say 'A server that is stopped, and the next on its volumes'
SECONDS=0
engine stop -t 45 "$server" >/dev/null
code=$(engine inspect --format '{{.State.ExitCode}}' "$server")
[ "$code" = 0 ] || { engine logs "$server" >&2; fail "SIGTERM: exit code $code, not 0"; }
echo "SIGTERM: exit code 0 after $SECONDS s"
SECONDS=0
engine start "$server" >/dev/null
wait_healthy "$server"
echo "healthy after $SECONDS s, on the same volumes"
client gather --map room --queries photons.ply --k 8 --radius 0.1 --outputs count,neighbors,density --output after.csv
cmp "$folder/work/before.csv" "$folder/work/after.csv" || fail 'the map of the volume gives other answers'
echo 'the map is there and answers with the same bytes'
uncompose
composed=

say 'PoCL in the image: kernels in a volume'
# Not even podman's folders in memory: a read-only root and the volumes.
strict=(--read-only --cap-drop ALL --security-opt no-new-privileges)
[ "$engine" = docker ] || strict+=(--read-only-tmpfs=false)
compiled=$project-compiled kernels=$project-kernels
containers+=("$compiled") volumes+=("$kernels")
# serve_compiled: a server whose kernels PoCL compiles, or finds in the volume.
serve_compiled() {
  engine run -d --name "$compiled" "${strict[@]}" -v "$kernels:/var/cache/treelight" -e TREELIGHT_INSECURE=true \
    -e TREELIGHT_DEVICE=pthread treelight >/dev/null
  SECONDS=0
  wait_healthy "$compiled"
}
# kernel_files: those that are kept, and when they were written.
kernel_files() {
  engine exec "$compiled" find /var/cache/treelight '(' -name '*.clbin' -o -name '*.so' ')' -printf '%p %T@\n' | sort
}
ask_compiled() {
  engine run --rm --no-healthcheck --network "container:$compiled" --user "$(id -u):$(id -g)" \
    -v "$folder/work:/work" -w /work --entrypoint treelight treelight:slim --server localhost:7543 "$@"
}
serve_compiled
first=$SECONDS
ask_compiled info >"$folder/info.log" 2>&1 || { cat "$folder/info.log" >&2; fail 'the server with PoCL is not reached'; }
expect 'info of the server with PoCL' 'pthread' "$folder/info.log"
ask_compiled build --photons photons.ply --name room
ask_compiled gather --map room --queries photons.ply --k 8 --radius 0.1 --outputs count,radius,neighbors --output pocl.csv
cmp "$folder/work/exact.csv" "$folder/work/pocl.csv" || fail 'PoCL gives other answers than the CPU without OpenCL'
kernel_files >"$folder/kernels.before"
grep -q clbin "$folder/kernels.before" || fail 'no kernel is kept in the volume'
engine rm -fv "$compiled" >/dev/null
serve_compiled
kernel_files >"$folder/kernels.after"
cmp "$folder/kernels.before" "$folder/kernels.after" || fail 'the next server compiles its kernels again'
echo "healthy after $first s, and after $SECONDS s with the kernels of the volume; the same answers as without OpenCL, bit for bit"
engine rm -fv "$compiled" >/dev/null

say 'TLS and tokens'
need openssl openssl
# make_certificate PREFIX NAME: PREFIX.crt and PREFIX.key for NAME.
make_certificate() {
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=treelight \
    -addext "subjectAltName=DNS:$2" -keyout "$1.key" -out "$1.crt" 2>"$folder/openssl.log" ||
    { cat "$folder/openssl.log" >&2; fail 'openssl makes no certificate'; }
  chmod 644 "$1.key" # for the user of the container; the folder around it is ours alone
}
# make_token FOLDER: FOLDER/tokens, which knows the token in the client's folder.
make_token() {
  engine run --rm --user "$(id -u):$(id -g)" -v "$1:/secrets" treelight token renderer --token-file /secrets/tokens \
    >"$folder/work/token"
  chmod 644 "$1/tokens"
}
secrets=$folder/secrets
mkdir "$secrets"
make_certificate "$secrets/server" localhost
make_token "$secrets"
secured=$project-secured
containers+=("$secured")
engine run -d --name "$secured" "${strict[@]}" -v "$secrets:/secrets:ro" -v "$folder/work:/work:ro" \
  -e TREELIGHT_TLS_CERT=/secrets/server.crt -e TREELIGHT_TLS_KEY=/secrets/server.key \
  -e TREELIGHT_TOKEN_FILE=/secrets/tokens treelight >/dev/null
wait_healthy "$secured"
engine exec "$secured" treelight --server localhost:7543 --tls-ca /secrets/server.crt --token-file /work/token info \
  >"$folder/info.log" 2>&1 || { cat "$folder/info.log" >&2; fail 'a client with a token is not answered'; }
! engine exec "$secured" treelight --server localhost:7543 --tls-ca /secrets/server.crt info >"$folder/info.log" 2>&1 ||
  fail 'a client without a token is answered'
expect 'a client without a token' 'token' "$folder/info.log"
echo 'healthy through TLS, without one writable folder but the volumes; a client with a token is answered, one without is not'
engine rm -fv "$secured" >/dev/null

# ---- kubernetes.yaml

unplay() {
  [ -n "${played:-}" ] || return 0
  engine kube down "$folder/pods.yaml"
  podman volume ls -q | grep "^$project-" | xargs -r podman volume rm -f
  podman network rm -f "$project-pods"
  played=
} >/dev/null 2>&1

if [ "$engine" = podman ]; then
  say 'kubernetes.yaml, as far as podman can: three servers on one folder of maps, nginx, TLS and tokens'
  build nginx treelight-nginx
  secrets=$folder/pods
  mkdir -p "$secrets/treelight-tls" "$secrets/treelight-tokens"
  make_certificate "$secrets/treelight-tls/tls" treelight
  cp "$secrets/treelight-tls/tls.crt" "$secrets/treelight-tls/ca.crt"
  make_token "$secrets/treelight-tokens"
  docker/play.py "$secrets" "$project-" treelight-nginx <docker/kubernetes.yaml >"$folder/pods.yaml"
  played=yes
  podman network create "$project-pods" >/dev/null
  engine kube play --network "$project-pods" "$folder/pods.yaml" >"$folder/play.log" 2>&1 ||
    { cat "$folder/play.log" >&2; fail 'kube play'; }
  SECONDS=0
  for replica in 0 1 2; do wait_healthy "treelight-$replica-treelightd"; done
  echo "all healthy after $SECONDS s"
  member() { # the real client, on their network
    engine run --rm --no-healthcheck --network "$project-pods" --user "$(id -u):$(id -g)" -v "$folder/work:/work" -w /work \
      -v "$secrets/treelight-tls/ca.crt:/ca.crt:ro" --entrypoint treelight treelight:slim \
      --server treelight:7543 --tls-ca /ca.crt --token-file token "$@"
  }
  member build --photons photons.ply --name room
  member gather --map room --queries photons.ply --k 8 --radius 0.1 --outputs count,neighbors,density --output replicas.csv
  cmp "$folder/work/before.csv" "$folder/work/replicas.csv" || fail 'the replicas give other answers'
  for replica in 0 1 2; do
    podman logs "treelight-$replica-treelightd" >"$folder/replica.log" 2>&1
    ! grep -q '"method":"Gather' "$folder/replica.log" || owner=$replica
  done
  podman kill "treelight-${owner:?no server has logged the gather}-treelightd" >/dev/null
  member gather --map room --queries photons.ply --k 8 --radius 0.1 --outputs count,neighbors,density --output moved.csv
  cmp "$folder/work/before.csv" "$folder/work/moved.csv" || fail 'the replicas that are left give other answers'
  echo "server $owner answered, and another one once it was killed: the bytes are those of the one server before"
  unplay
fi

if [ -n "$tests" ]; then
  say 'Tests in a container'
  SECONDS=0
  build test treelight-test
  grep -E 'tests passed' "$folder/build.log"
  echo "in $SECONDS s"
  engine rmi treelight-test >/dev/null
fi

say 'Done'
