#!/usr/bin/env bash
# Packs a build with cpack and looks into what it made, without installing it: package_test.sh BUILD_FOLDER. lintian and
# systemd-analyze judge too where they are installed.
set -euo pipefail
build=$(cd "${1:?usage: package_test.sh BUILD_FOLDER}" && pwd)
source=$(cd "$(dirname "$0")/.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "package_test: $*" >&2; exit 1; }

(cd "$build" && cpack -B "$folder/packages") >"$folder/log" 2>&1 || { cat "$folder/log" >&2; fail 'cpack failed'; }
for package in treelight libtreelight-dev; do
  deb=$(echo "$folder/packages/${package}"_*.deb)
  [ -f "$deb" ] || fail "cpack made no $package"
  echo "$(basename "$deb"): $(dpkg-deb -f "$deb" Depends)"
  dpkg-deb -x "$deb" "$folder/$package"
  documents=$folder/$package/usr/share/doc/$package
  [ -s "$documents/copyright" ] || fail "$package has no copyright"
  zcat "$documents/changelog.gz" | grep -F "treelight ($(dpkg-deb -f "$deb" Version)) " >/dev/null ||
    fail "the changelog of $package does not name its version: cmake/debian/changelog"
  if grep -rlF -e "$build" -e "$source" "$folder/$package" --include='*.cmake' --include='*.h' --include='*.service'; then
    fail 'the files above name the source or the build folder'
  fi
done

root=$folder/treelight
depends=$(dpkg-deb -f "$folder/packages"/treelight_*.deb Depends)
for dependency in libgrpc++ libembree3 ocl-icd-libopencl1 libc6; do
  [[ $depends == *"$dependency"* ]] || fail "treelight does not depend on $dependency"
done
[[ $depends != *opencl-icd* ]] || fail 'treelight depends on a driver, which the CPU does not need'
[ "$(dpkg-deb -f "$folder/packages"/treelight_*.deb Suggests)" = opencl-icd ] || fail 'treelight suggests no driver'
for program in treelightd treelight; do
  "$root/usr/bin/$program" --version
  if command -v help2man >/dev/null; then
    zcat "$root/usr/share/man/man1/$program.1.gz" | grep '^\.SH OPTIONS' >/dev/null || fail "$program.1 has no options"
  fi
done
[ -s "$root/etc/default/treelightd" ] || fail 'treelight has no /etc/default/treelightd'
[ "$(dpkg-deb --ctrl-tarfile "$folder/packages"/treelight_*.deb | tar -xO ./conffiles)" = /etc/default/treelightd ] ||
  fail '/etc/default/treelightd is no conffile'
# What its comments name is an option that the server has.
sed -n 's/^#\(TREELIGHT_[A-Z_]*\)=.*/\1/p' "$root/etc/default/treelightd" | while read -r variable; do
  "$root/usr/bin/treelightd" --help | grep "Env:$variable)" >/dev/null ||
    fail "/etc/default/treelightd: no option reads $variable"
done

unit=$root/lib/systemd/system/treelightd.service
if command -v systemd-analyze >/dev/null; then
  sed "s,^ExecStart=/usr/bin,ExecStart=$root/usr/bin," "$unit" >"$folder/treelightd.service"
  systemd-analyze verify --man=no "$folder/treelightd.service" || fail 'systemd-analyze verify: see above'
else
  [ -s "$unit" ] || fail 'treelight has no treelightd.service'
fi
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error,warning "$folder/packages"/*.deb || fail 'lintian: see above'
fi
