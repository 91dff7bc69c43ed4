# grainrig: `make demo` and `make test` do all the set-up on a fresh Debian or Ubuntu that has Rust and Node.
.PHONY: all demo quick test test-long test-hil run check bench tools drivers clean
.DEFAULT_GOAL := all

CARGO ?= cargo
# The drivers that need system libraries are off in a plain `cargo build`, and on here where those can be had (looked at
# after `drivers` has tried): libgphoto2 with its headers, and libclang, which reads the headers of both.
HAVE_DRIVERS := pkg-config --exists libgphoto2 2>/dev/null && ls /usr/lib/llvm-*/lib/libclang*.so* >/dev/null 2>&1
FEATURES = $(shell ($(HAVE_DRIVERS)) && echo --features gphoto2,v4l)
BIN := target/release/grainrig
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo)
APT := $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0
# The first browser that starts: Ubuntu's package is a snap, which does not everywhere.
FIND_BROWSER := (for b in chromium chromium-browser google-chrome; do \
	$$b --version >/dev/null 2>&1 && command -v $$b && exit; done; exit 1)

all: drivers
	$(CARGO) build --release $(FEATURES)

# A grain on the simulated rig: 25 views, hull, mesh, Abaqus input. Each run has a session of its own.
demo: all
	$(BIN) capture demo-$$(date +%Y%m%d-%H%M%S)
	@echo 'Look at it while it happens: `make run`, then open the address that it prints.'

# The monitor on the simulated rig, until Ctrl-C.
run: all
	$(BIN) serve

# Everything: units, properties, real data where it is, the real program with faults injected, CalculiX, a browser.
test: tools drivers
	CHROMIUM="$$( $(FIND_BROWSER) )" tests/run.sh $(FEATURES)

# While working: every unit test of both crates, and what stands between the rooms. Nothing is installed.
quick:
	$(CARGO) test $(FEATURES) --workspace --lib
	$(CARGO) test $(FEATURES) --test layering --test session --test acquire --test silhouette --test numbers --test serve

# The Rust tests with the hours: more rigs, grains, kills, mutations, meshes.
LONG := GRAINRIG_RIGS=60 GRAINRIG_ALL=1 GRAINRIG_BODIES=500 GRAINRIG_GRAINS=100 GRAINRIG_MERGES=1 GRAINRIG_PLANS=1 \
	GRAINRIG_KILLS=200 GRAINRIG_MUTATIONS=500 GRAINRIG_CROWD=2000 GRAINRIG_QUALITY_SEEDS=3 GRAINRIG_CONTACT=1 \
	GRAINRIG_MOVES=10000 GRAINRIG_FUZZ_ROUNDS=400 GRAINRIG_FUZZ_S=3000
test-long: tools drivers
	$(LONG) $(CARGO) test --release --no-fail-fast $(FEATURES)

# The second layer of the tests: the program on a real kernel that an emulator runs, with the rig plugged in. Needs Debian's
# packages and 100 MB of them; where they can't be had this says `*** skipped`, with the reason, and is no failure.
HIL := $(CURDIR)/target/hil
test-hil: tools drivers
	@if [ -z "$(FEATURES)" ]; then echo '*** skipped: it needs the drivers of cameras' >&2; exit 0; fi; \
	set -e; \
	$(CARGO) test $(FEATURES) --no-run --test hil; \
	prepared=0; tests/hil/prepare.sh target/debug/grainrig $(HIL) || prepared=$$?; \
	[ $$prepared != 77 ] || exit 0; \
	[ $$prepared = 0 ] || exit $$prepared; \
	GRAINRIG_HIL=$(HIL) timeout 600 $(CARGO) test $(FEATURES) --test hil -- --nocapture

# What the tests need beside Rust and Node: CalculiX reads the decks, a browser opens the monitor, the controller's
# firmware runs on a simulated chip. Where one cannot
# be installed (no network, no rights) this says so, and the tests that need it say `skipped`.
MISSING = { echo '*** $(1) could not be installed: tests that need it are skipped' >&2; }
tools:
	@command -v ccx >/dev/null || { echo 'installing calculix-ccx'; $(APT) update && $(APT) install -y calculix-ccx; } \
		|| $(call MISSING,calculix-ccx)
	@command -v avr-gcc >/dev/null && [ -e /usr/include/simavr/sim_avr.h ] \
		|| { echo 'installing the chip simulator'; $(APT) update && $(APT) install -y gcc gcc-avr avr-libc binutils-avr \
		libsimavr-dev libelf-dev; } || $(call MISSING,gcc-avr and libsimavr-dev)
	@[ web/node_modules/.package-lock.json -nt web/package-lock.json ] || (cd web && npm ci --no-audit --no-fund) \
		|| $(call MISSING,playwright-core and typescript)
	@$(FIND_BROWSER) >/dev/null || { echo 'installing chromium'; $(APT) update && $(APT) install -y chromium; } || true
	@$(FIND_BROWSER) >/dev/null || (cd web && npx playwright-core install --with-deps chromium-headless-shell) \
		|| $(call MISSING,a browser)

# What the cameras' drivers are built with. `gcc` is also what a test makes its video camera with.
drivers:
	@{ $(HAVE_DRIVERS); } || { echo 'installing libgphoto2-dev, libclang-dev, pkg-config, gcc'; \
		$(APT) update && $(APT) install -y libgphoto2-dev libclang-dev pkg-config gcc libc6-dev; } \
		|| echo '*** libgphoto2-dev or libclang-dev could not be installed: this is built without drivers of cameras' >&2

# Style, lints, documentation, the book with its links, licences; known vulnerabilities where the database can be reached.
# Where mdbook can't be had the book is not built, and its links, commands and pictures are held all the same.
check: drivers
	$(CARGO) fmt --check
	$(CARGO) clippy --all-targets $(FEATURES) -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --no-deps --document-private-items $(FEATURES)
	$(CARGO) test $(FEATURES) --test papers
	@command -v mdbook >/dev/null || $(CARGO) install --locked mdbook \
		|| echo '*** mdbook could not be installed: the book is not built' >&2
	@! command -v mdbook >/dev/null || mdbook build docs
	@command -v cargo-deny >/dev/null || $(CARGO) install --locked cargo-deny
	$(CARGO) deny check licenses bans sources
	$(CARGO) deny check advisories || echo 'advisories were not checked: see above'

# Timings as ratios to a yardstick that runs beside them; libjpeg-turbo's djpeg is one of them where it can be had. Instructions
# of the kernels beside their times, where valgrind can be had.
bench:
	@command -v djpeg >/dev/null || { $(APT) update && $(APT) install -y libjpeg-turbo-progs; } \
		|| echo '*** libjpeg-turbo-progs could not be installed: its yardstick is skipped' >&2
	@command -v valgrind >/dev/null || { $(APT) update && $(APT) install -y valgrind; } \
		|| echo '*** valgrind could not be installed: instructions are not counted' >&2
	$(CARGO) bench $(FEATURES)

clean:
	$(CARGO) clean
	rm -rf web/node_modules
