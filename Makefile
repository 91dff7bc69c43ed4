# grainrig: `make demo` and `make test` do everything on a fresh Debian or Ubuntu that has Rust.
.PHONY: all test check
all: test

test:
	cargo test --workspace

check:
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --document-private-items
