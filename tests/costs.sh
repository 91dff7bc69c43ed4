#!/usr/bin/env bash
# Processor seconds of every test and of the programs that it waits for, the most first, into target/costs.txt. Unlike the time
# on the clock they hardly depend on what else the computer does. Options are those of `cargo nextest run`:
# `tests/costs.sh --features gphoto2,v4l -E 'binary(contact)'`.
set -uo pipefail
if [ -n "${GRAINRIG_COSTS:-}" ]; then
	# Called by cargo-nextest with one test's command line, or to list the tests.
	[ -n "${NEXTEST_TEST_NAME:-}" ] || exec "$@"
	own=$GRAINRIG_COSTS.$$
	TIMEFORMAT='%U %S %R'
	{ time "$@" 2>&3 3>&-; } 3>&2 2> "$own"
	code=$?
	read -r user system wall < "$own"
	rm "$own"
	printf '%8.2f %8.2f  %s %s\n' "$(awk "BEGIN { print $user + $system }")" "$wall" "${1##*/}" "$NEXTEST_TEST_NAME" \
		| sed 's/-[0-9a-f]\{16\} / /' >> "$GRAINRIG_COSTS"
	exit "$code"
fi
cd "$(dirname "$0")/.."
mkdir -p target
export GRAINRIG_COSTS=$PWD/target/costs.txt
rm -f "$GRAINRIG_COSTS"
host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=$PWD/tests/costs.sh"
cargo nextest run "$@"
code=$?
sort -rn "$GRAINRIG_COSTS" -o "$GRAINRIG_COSTS"
echo 'processor s   wall s  test'
head -40 "$GRAINRIG_COSTS"
awk '{ sum += $1 } END { printf "%8.0f processor seconds in %d tests\n", sum, NR }' "$GRAINRIG_COSTS"
exit "$code"
