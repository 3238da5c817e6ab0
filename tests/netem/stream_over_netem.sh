#!/usr/bin/env bash
# Streams the gallery from tesserad to tessera-client through netem: LOSS percent of all packets lost both ways, of UDP and
# TCP alike, and 0..30 ms of delay that reorders them.
# usage: stream_over_netem.sh TESSERAD TESSERA_CLIENT LOSS
set -euo pipefail

readonly kSkip=77
skip() {
  echo "skipped: $*"
  exit $kSkip
}
fail() {
  echo "failed: $*"
  exit 1
}

if [ -z "${TESSERA_NETEM_INSIDE:-}" ]; then
  for tool in unshare ip tc; do
    command -v "$tool" >/dev/null || skip "there is no $tool (Debian: util-linux, iproute2)"
  done
  if unshare --net true 2>/dev/null; then
    TESSERA_NETEM_INSIDE=1 exec unshare --net "$0" "$@"
  fi
  unshare --user --map-root-user --net true 2>/dev/null || skip "this user may not make a network namespace"
  TESSERA_NETEM_INSIDE=1 exec unshare --user --map-root-user --net "$0" "$@"
fi

readonly tesserad=$1 client=$2 loss=$3
ip link set lo up
tc qdisc add dev lo root netem delay 15ms 15ms loss "$loss%" 2>/dev/null ||
  skip "tc cannot add netem: the kernel lacks CONFIG_NET_SCH_NETEM, or its module may not be loaded"

folder=$(mktemp -d)
trap 'kill "$daemon" 2>/dev/null || true; wait; rm -rf "$folder"' EXIT
"$tesserad" --device cpu --http-port 0 --scene hall=gallery:0 >"$folder/daemon.log" 2>&1 &
daemon=$!
until grep -q 'serving ' "$folder/daemon.log"; do
  kill -0 "$daemon" 2>/dev/null || { cat "$folder/daemon.log"; fail "tesserad did not start"; }
  sleep 0.1
done

"$client" --scene hall --width 160 --height 90 --seconds 8 --json "$folder/run.json" ||
  { cat "$folder/daemon.log"; fail "tessera-client ended with $?"; }
cat "$folder/run.json"
value() { sed -n "s/.*\"$1\": *\([0-9]*\).*/\1/p" "$folder/run.json"; }

[ "$(value packets_recovered)" -gt 0 ] || fail "nothing was lost and recovered: is netem at work?"
[ $(($(value packets_given_up) * 50)) -le "$(value packets_recovered)" ] || fail "too many packets were given up"
[ "$(value frames_fresh)" -ge 5 ] || fail "the picture stood still"
[ "$(value orphans)" -lt 30 ] || fail "broken chains of frames were not mended"
[ "$(value decode_errors)" -eq 0 ] || fail "access units could not be decoded"

kill -TERM "$daemon"
wait "$daemon" || fail "tesserad ended with $?"
trap 'rm -rf "$folder"' EXIT
echo "passed at $loss % loss"
