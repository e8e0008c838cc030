# The same verbs by hand, in hooks and in CI: demo, test, test-long, test-deep, test-all, test-others, lint, docs, bench, golden,
# develop, install-c, clean. Of the site also: docs-links, figures.
# What takes long and looks for faults: fuzz, soak, mutants. What a release needs: lock, sbom, wheel.
#
#   make demo RUNS=500      a larger campaign
#   make test VENV=/tmp/v   another environment
#   make test WORKERS=1     one test process
#   make install-c PREFIX=/tmp/b    the C library somewhere else
VENV    ?= .venv
PYTHON  ?= python3
WORKERS ?= auto
RUNS    ?= 50
OUT     ?= out/demo
SECONDS ?= 60
HOURS   ?= 1
PREFIX  ?= /usr/local

# Tools beside the tests', pinned as these are. The Rust ones are compiled once, unoptimised and bare, into `tools`.
CARGO_DENY      := 0.20.2
CARGO_CYCLONEDX := 0.5.9
CBINDGEN        := 0.29.2
UV              := 0.13.9
CYCLONEDX_BOM   := 7.5.0
ZIGLANG         := 0.17.1
tools           := target/tools
tool            := CARGO_PROFILE_DEV_DEBUG=false cargo install --quiet --locked --debug
cbindgen        := $(tools)/cbindgen-$(CBINDGEN)/bin/cbindgen
make_header     := $(cbindgen) --quiet --output crates/bottomlock-c/include/bottomlock.h crates/bottomlock-c

bin := $(VENV)/bin
pip := $(bin)/python -m pip --disable-pip-version-check --quiet
# What pyproject.toml names, at the versions and with the hashes of the lock, from where pip is told to look.
uv := env UV_DEFAULT_INDEX="$${UV_DEFAULT_INDEX:-$${PIP_INDEX_URL:-$$($(bin)/python -m pip config get global.index-url 2>/dev/null || \
    echo https://pypi.org/simple)}}" $(bin)/uv pip
locked := $(uv) install --no-config --quiet --system-certs --python $(bin)/python --require-hashes --constraints requirements.lock
# The build backend calls the locked maturin by its name.
on_path := PATH="$(abspath $(bin)):$$PATH"
# Python keeps what it has compiled also where it is told not to: `bottomlock run --help` takes 2 s with it, 6 without.
export PYTHONDONTWRITEBYTECODE :=
# By another name, since a recipe line with $$(MAKE) in it is run even by `make --dry-run`.
make := $(MAKE) --no-print-directory
# A file's tests stay in one process, since they share what they fly; tests/conftest.py puts files of slow tests first.
pytest := $(bin)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

# Rust tests on the kernel that the wheel is made of: naming the bindings gives their dependencies the same features, so that
# nothing is compiled twice.
released := cargo test --locked --release --package bottomlock --package bottomlock-c --package bottomlock-py

# With overflow checks.
checked := cargo test --locked

# Whatever ends in the wheel; a change to any of it rebuilds and reinstalls.
wheel_sources := pyproject.toml README.md LICENSE LICENSE-MIT LICENSE-APACHE Cargo.toml Cargo.lock .cargo/config.toml \
    $(shell find crates -type f \( -name '*.rs' -o -name Cargo.toml \) -not -path '*/tests/*' -not -path '*/benches/*' -not -path '*-c/*') \
    $(shell find python -type f -not -name '*.so' -not -name '*.pyc' -not -name '.*')

.PHONY: demo docs docs-links figures spelling test test-rust test-python test-long test-long-rust test-deep test-all test-others \
    lint lint-rust lint-python deny bench golden develop header install-c fuzz soak mutants lock sbom wheel clean
.DELETE_ON_ERROR:

# The paper's study: campaign, sweep and report.
demo: $(VENV)/.installed
	rm -rf $(OUT)
	$(bin)/bottomlock reproduce --runs $(RUNS) --out $(OUT)

# What guards a change. The Rust tests are compiled beside the Python tests; those of the C library, which wait for cargo, come last.
test: $(VENV)/.tools $(VENV)/.installed
	@$(released) --tests --no-run --quiet & $(make) test-python; python=$$?; wait; $(make) test-rust && exit $$python

test-python: $(VENV)/.tools $(VENV)/.installed
	$(pytest) -m "not long and not deep" --doctest-modules --pyargs bottomlock tests

# Unit tests, laws and the documentation's tests. The bindings are tested by Python, examples by `make lint`.
test-rust:
	$(released) --tests
	$(released) --doc

# What `make test` leaves out; Rust's unit tests with overflow checks, compiled beside the Python tests, and the laws with more
# examples.
test-long: $(VENV)/.tools $(VENV)/.installed
	@$(checked) --lib --no-run --quiet & HYPOTHESIS_PROFILE=long $(pytest) -m "(long or hypothesis) and not deep" tests; \
	    python=$$?; wait; $(make) test-long-rust && exit $$python

test-long-rust:
	$(checked) --lib
	BOTTOMLOCK_LONG=1 $(released) --test laws
	BOTTOMLOCK_LONG=1 $(released) --tests no_bytes_give

# The largest sizes, before a release: an hour and a half of two cores.
test-deep: $(VENV)/.tools $(VENV)/.installed
	$(pytest) -m deep tests
	$(checked) --test laws
	BOTTOMLOCK_DEEP=1 $(released) --test laws late_law

test-all: test test-long test-deep

# What needs libraries that nothing else does: Cyclone DDS, MHKiT as another reader. Recordings are read
# from BOTTOMLOCK_RECORDINGS.
test-others: $(VENV)/.tools $(VENV)/.installed
	$(locked) --group others
	$(pytest) -rs tests/ros tests/io/test_logs.py

lint: lint-rust lint-python

# The kernel once more as a vehicle has it, without the simulation; and the header of the C library is that of its sources.
lint-rust: deny $(cbindgen)
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	cargo clippy --package bottomlock --package bottomlock-c --no-default-features --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet
	$(make_header) --verify

lint-python: $(VENV)/.tools $(VENV)/.installed spelling
	$(bin)/ruff check .
	$(bin)/ruff format --check .
	$(bin)/mypy
	MYPY_CACHE_DIR=.mypy_cache/stubtest $(bin)/python -m mypy.stubtest bottomlock._kernel --mypy-config-file tools/stubtest.ini
	PYTHONPATH=python $(bin)/lint-imports --no-cache
	$(bin)/python -m tools.check_equations

# Licences, duplicates and sources of the crates (deny.toml); advisories where their database can be reached.
deny: $(tools)/cargo-deny-$(CARGO_DENY)/bin/cargo-deny
	$< --locked check licenses bans sources
	@if $< --locked fetch db >/dev/null 2>&1; then $< --locked --offline check advisories; \
	    else echo "make deny: the advisory database cannot be reached, so advisories are not checked" >&2; fi

# Makes the header of the C library again.
header: $(cbindgen)
	$(make_header)

# The C library under PREFIX: headers, libraries, CMake package, pkg-config file.
install-c:
	$(PYTHON) tools/install_c.py --prefix $(PREFIX)

bench: $(VENV)/.tools $(VENV)/.installed
	cargo build --release --locked --example compare_filters
	$(bin)/python benches/compare.py --rounds 5
	$(bin)/python -m pytest --benchmark-enable --benchmark-only tests

# The documentation site with its executed gallery, and rustdoc beside it; a warning is an error. Open out/site/index.html.
docs: $(VENV)/.docs $(VENV)/.installed
	RUSTDOCFLAGS="-D warnings" cargo doc --package bottomlock --no-deps --locked --quiet
	$(bin)/python -m tools.build_site

# Words that nobody spells so; NEES and NED are none of them.
spelling: $(VENV)/.tools
	$(bin)/codespell README.md CONTRIBUTING.md SECURITY.md CHANGELOG.md docs examples crates python tools benches ros

# Every link of the site: a broken one within it fails `make docs` already; those outside are tried, and told.
docs-links: $(VENV)/.docs $(VENV)/.installed
	$(bin)/python -m tools.build_site --builder linkcheck --out out/links

# The figures of README and methods' pages, flown again, and pictures of pages, which need Chromium.
figures: $(VENV)/.installed
	$(bin)/python -m tools.site_figures
	$(bin)/python -m tools.site_screenshots

# Rewrites the golden files; every number that moves goes into the CHANGELOG under "Numbers".
golden: $(VENV)/.installed
	$(bin)/python -m tools.update_golden

# Fuzzing of every reader for SECONDS.
fuzz: $(VENV)/.tools $(VENV)/.installed
	$(bin)/python -m tools.fuzz_readers --seconds $(SECONDS)

# HOURS of `bottomlock live` through sockets.
soak: $(VENV)/.tools $(VENV)/.installed
	$(bin)/python -m tools.live_soak --hours $(HOURS) --out out/live_soak.json

# Random wrong lines of kernel and package: which share do the quick tests of their rooms see? Needs cargo-mutants.
#
#   make mutants MUTANTS="logs --each 20"
mutants: $(VENV)/.tools $(VENV)/.installed
	@cargo mutants --version >/dev/null 2>&1 || \
	    { echo "make: cargo-mutants not found; cargo install cargo-mutants --locked --version 27.1.0" >&2; exit 2; }
	$(bin)/python -m tools.mutation_sample $(MUTANTS)

# Writes the versions and hashes of all that the groups of pyproject.toml install, for every platform and Python that is supported.
lock: $(bin)/uv
	$(uv) compile pyproject.toml --no-config --group dev --group docs --group others --universal --python-version 3.11 \
	    --generate-hashes --no-annotate --upgrade --quiet --custom-compile-command "make lock" --output-file requirements.lock
	$(uv) compile --group pyproject.toml:vehicle --no-config --universal --python-version 3.11 --constraints requirements.lock \
	    --generate-hashes --no-annotate --quiet --custom-compile-command "make lock" --output-file requirements-live.txt

# The bill of materials, CycloneDX: what an install brings along, at the locked versions, and the crates in the wheel. Its
# check against the schema takes minutes.
sbom: $(bin)/uv $(tools)/python/.ready $(tools)/cargo-cyclonedx-$(CARGO_CYCLONEDX)/bin/cargo-cyclonedx
	mkdir -p out/sbom
	$(uv) compile pyproject.toml --no-config --universal --python-version 3.11 --generate-hashes \
	    --no-annotate --quiet --constraints requirements.lock --output-file out/sbom/requirements.txt
	$(tools)/python/bin/cyclonedx-py requirements --no-validate --pyproject pyproject.toml --output-reproducible \
	    --output-file out/sbom/python.cdx.json out/sbom/requirements.txt
	$(lastword $^) cyclonedx --format json --manifest-path crates/bottomlock-py/Cargo.toml --override-filename rust.cdx
	mv crates/bottomlock-py/rust.cdx.json out/sbom/
	find crates -name rust.cdx.json -delete

# The wheel for Linux since 2014 (x86-64) and the source distribution, in out/dist; zig links against the old C library.
wheel: $(tools)/zig/.ready
	PATH="$(abspath $(tools)/zig/bin):$$PATH" maturin build --release --locked --zig --compatibility manylinux2014 --out out/dist
	PATH="$(abspath $(tools)/zig/bin):$$PATH" maturin sdist --out out/dist

# An editable install for daily work: Python edits take effect at once, Rust edits after another `make develop`.
develop: $(VENV)/.tools
	$(on_path) $(pip) install --upgrade --no-build-isolation --editable .
	touch $(VENV)/.installed

clean:
	cargo clean
	rm -rf $(VENV) out .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks

$(VENV)/pyvenv.cfg:
	@command -v cargo >/dev/null || { echo "make: cargo not found; install Rust 1.89 or later (rustup.rs)" >&2; exit 2; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "make: $(PYTHON) is older than 3.11; name another one: make PYTHON=python3.12" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(bin)/uv: | $(VENV)/pyvenv.cfg
	$(pip) install --no-compile uv==$(UV)

# A release build of the extension, with the locked crates, installed as users get it. What it needs is downloaded and compiled
# where the compiler leaves a core idle.
$(VENV)/.installed: $(wheel_sources) | $(bin)/uv
	$(locked) --group build
	rm -rf target/wheel
	@$(on_path) maturin build --release --locked --quiet --interpreter $(bin)/python --out target/wheel & wheel=$$!; \
	    nice -n 19 $(locked) --compile-bytecode --requirement pyproject.toml; needed=$$?; wait $$wheel && exit $$needed
	$(uv) install --no-config --quiet --python $(bin)/python --no-deps --reinstall --compile-bytecode target/wheel/*.whl
	touch $@

# What the tests need and what the wheel needs; the wheel, if it is installed after it, finds all it asks for.
$(VENV)/.tools: requirements.lock | $(bin)/uv
	$(locked) --requirement pyproject.toml --group dev
	touch $@

# What the site needs beside them.
$(VENV)/.docs: requirements.lock | $(bin)/uv
	$(locked) --requirement pyproject.toml --group docs
	touch $@

$(tools)/python/.ready: Makefile
	$(PYTHON) -m venv $(tools)/python
	$(tools)/python/bin/python -m pip --disable-pip-version-check --quiet install cyclonedx-bom==$(CYCLONEDX_BOM)
	touch $@

$(tools)/zig/.ready: Makefile
	$(PYTHON) -m venv $(tools)/zig
	$(tools)/zig/bin/python -m pip --disable-pip-version-check --quiet install ziglang==$(ZIGLANG) maturin==1.16.0
	touch $@

# A version has a folder of its own, so that a new one is installed.
$(tools)/cargo-deny-$(CARGO_DENY)/bin/cargo-deny:
	$(tool) --root $(tools)/cargo-deny-$(CARGO_DENY) cargo-deny@$(CARGO_DENY)

$(cbindgen):
	$(tool) --root $(tools)/cbindgen-$(CBINDGEN) cbindgen@$(CBINDGEN)

$(tools)/cargo-cyclonedx-$(CARGO_CYCLONEDX)/bin/cargo-cyclonedx:
	$(tool) --root $(tools)/cargo-cyclonedx-$(CARGO_CYCLONEDX) cargo-cyclonedx@$(CARGO_CYCLONEDX)
