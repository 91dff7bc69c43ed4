#!/usr/bin/env bash
# Writes THIRD-PARTY.md: what a program built with all drivers links, with versions and licences, as Cargo records them.
# Run it after dependencies have changed; `cargo test --test papers` says so where it was forgotten.
#
#   docs/third-party.sh
set -euo pipefail
cd "$(dirname "$0")/.."
{
  cat <<'HEAD'
# Third-party notices

Made by `docs/third-party.sh` from `cargo tree`: the crates that a program with all drivers links on Linux. Tools of the build
and the tests are not among them. The licences' texts are in the crates' own sources, which `cargo vendor` fetches;
`deny.toml` says which licences are allowed, and `make check` holds the crates to it.

Beside crates there are in the program

- letters of Noto Sans Mono (SIL Open Font License 1.1), drawn beforehand, by the crate `noto-sans-mono-bitmap`;
- with the feature `gphoto2`, the system's libgphoto2 (LGPL-2.1-or-later), linked dynamically.

HEAD
  echo '| crate | version | licence |'
  echo '| --- | --- | --- |'
  cargo tree --locked --workspace --all-features --edges normal,no-proc-macro --target x86_64-unknown-linux-gnu --prefix none \
    --format '{p}|{l}' |
    grep -v -e '(/' -e '^$' | sed -E 's/ \(\*\)//; s/^([^ ]+) v([^ |]+)[^|]*\|(.*)$/| \1 | \2 | \3 |/' | LC_ALL=C sort -u
} >THIRD-PARTY.md
