#!/usr/bin/env bash
# Runs every test of the project, and lists at the end which were skipped, and why. Options are cargo's, such as --features.
# With cargo-nextest the tests run side by side, those that compute as many as there are cores; without it `cargo test` runs the same.
set -uo pipefail
cd "$(dirname "$0")/.."
export GRAINRIG_SKIPPED=$PWD/target/skipped.txt
mkdir -p target
: > "$GRAINRIG_SKIPPED"
failed=0
if cargo nextest --version > /dev/null 2>&1; then
	# Most tests of the program wait for it more than they compute: see .config/nextest.toml.
	cargo nextest run --test-threads $((2 * $(nproc))) "$@" || failed=1
	# It runs no examples of the documentation.
	cargo test --doc "$@" || failed=1
else
	cargo test --no-fail-fast "$@" || failed=1
fi
if [ -x web/node_modules/.bin/tsc ]; then
	(cd web && npm run --silent types) || failed=1
else
	echo "page, its types: typescript is not installed (npm ci) (tools)" >> "$GRAINRIG_SKIPPED"
	case ",${GRAINRIG_REQUIRE:-}," in *,tools,* | *,all,*) failed=1 ;; esac
fi
(cd web && GRAINRIG_BIN=$OLDPWD/target/debug/grainrig npm test) || failed=1
# A skipped part of a test that is reached several times is one.
sort -u "$GRAINRIG_SKIPPED" -o "$GRAINRIG_SKIPPED"
count=$(wc -l < "$GRAINRIG_SKIPPED")
if [ "$count" -gt 0 ]; then
	echo "*** $count skipped; GRAINRIG_REQUIRE=all makes each a failure:"
	sed 's/^/***   /' "$GRAINRIG_SKIPPED"
fi
exit "$failed"
