# The same verbs by hand, in hooks and in CI: demo, test, test-long, test-all, lint, bench, golden, consistency, develop, clean.
#
#   make demo RUNS=500      a larger campaign
#   make test VENV=/tmp/v   another environment
#   make test WORKERS=1     one test process
VENV    ?= .venv
PYTHON  ?= python3
WORKERS ?= auto
RUNS    ?= 50
OUT     ?= out/demo

bin := $(VENV)/bin
pip := $(bin)/python -m pip --disable-pip-version-check --quiet
# By another name, since a recipe line with $$(MAKE) in it is run even by `make --dry-run`.
make := $(MAKE) --no-print-directory
# A file's tests stay in one process, since they share what they fly; tests/conftest.py puts files of slow tests first.
pytest := $(bin)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

# The laws across modules, and the documentation's tests, on the kernel that the wheel is made of: naming the bindings gives
# their dependencies the same features, so that nothing is compiled twice.
released := cargo test --locked --release --package bottomlock --package bottomlock-py

# Whatever ends in the wheel; a change to any of it rebuilds and reinstalls.
wheel_sources := pyproject.toml README.md LICENSE LICENSE-MIT LICENSE-APACHE Cargo.toml Cargo.lock .cargo/config.toml \
    $(shell find crates -type f \( -name '*.rs' -o -name Cargo.toml \) -not -path '*/tests/*' -not -path '*/benches/*') \
    $(shell find python -type f -not -name '*.so' -not -name '*.pyc' -not -name '.*')

.PHONY: demo test test-rust test-python test-long test-all mutants-rust lint lint-rust lint-python bench golden consistency \
    develop clean
.DELETE_ON_ERROR:

# The paper's study: campaign, sweep and report.
demo: $(VENV)/.installed
	rm -rf $(OUT)
	$(bin)/bottomlock reproduce --runs $(RUNS) --out $(OUT)

# What guards a change. The wheel's kernel is one long step on one core: the Rust unit tests are built beside it.
test: $(VENV)/pyvenv.cfg
	@cargo test --locked --lib --no-run & rust=$$!; \
	    $(make) $(VENV)/.installed $(VENV)/.tools; python=$$?; wait $$rust && exit $$python
	@$(make) test-python test-rust

test-python: $(VENV)/.installed $(VENV)/.tools
	$(pytest) -m "not long" --doctest-modules --pyargs bottomlock tests

# Unit tests with overflow checks, then the laws. The bindings are tested by Python, examples by `make lint`.
test-rust:
	cargo test --locked --lib
	$(released) --test '*'
	$(released) --doc

# What `make test` leaves out, and the laws with more examples and overflow checks.
test-long: $(VENV)/.installed $(VENV)/.tools
	HYPOTHESIS_PROFILE=long $(pytest) -m "long or hypothesis" tests
	BOTTOMLOCK_LONG=1 cargo test --locked --test '*'

test-all: test test-long

# Does a wrong line of the kernel's mathematics fail a unit test? Files and command in .cargo/mutants.toml, survivors in
# docs/mutants_rust.md. All of it takes days of one core: name what you changed, or a share.
#
#   make mutants-rust MUTANTS="--file crates/bottomlock/src/aiding/heading.rs"
#   make mutants-rust MUTANTS="--shard 1/50"
#   make mutants-rust MUTANTS="--in-diff change.diff"
mutants-rust:
	@cargo mutants --version >/dev/null 2>&1 || \
	    { echo "make: cargo-mutants not found; cargo install cargo-mutants --locked --version 27.1.0" >&2; exit 2; }
	cargo mutants --package bottomlock --jobs 1 --output out $(MUTANTS)

lint: lint-rust lint-python

lint-rust:
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet

lint-python: $(VENV)/.installed $(VENV)/.tools
	$(bin)/ruff check .
	$(bin)/ruff format --check .
	$(bin)/mypy
	$(bin)/python -m mypy.stubtest bottomlock._kernel --mypy-config-file pyproject.toml
	PYTHONPATH=python $(bin)/lint-imports --no-cache
	$(bin)/python tools/check_equations.py

bench: $(VENV)/.installed $(VENV)/.tools
	cargo bench --locked --package bottomlock-benches
	$(bin)/python -m pytest --benchmark-enable --benchmark-only tests

# Rewrites the golden files; every number that moves goes into the CHANGELOG under "Numbers".
golden: $(VENV)/.installed
	$(bin)/python tools/update_golden.py

# The consistency study of a release in the paper's world and in that of a real vehicle, whose masks are flown too: many
# minutes of every core. A verdict other than expected in the paper's world fails. The verdicts go into the package and
# the README, too.
consistency: $(VENV)/.installed
	$(bin)/bottomlock consistency --out out/consistency --assert tests/statistical/expected_verdicts.toml
	cp out/consistency/consistency.md docs/consistency.md
	$(bin)/bottomlock consistency --world survey_table2 --runs 60 --out out/consistency_survey
	cp out/consistency_survey/consistency.md docs/consistency_survey.md
	$(bin)/bottomlock masks straight figure_eight lawn_mower --world survey_table2 --runs 50 --out out/masks_survey
	cp out/masks_survey/masks.md docs/masks_survey.md
	$(bin)/python tools/publish_studies.py

# An editable install for daily work: Python edits take effect at once, Rust edits after another `make develop`.
develop: $(VENV)/.tools
	$(pip) install --upgrade --no-build-isolation --editable .
	touch $(VENV)/.installed

clean:
	cargo clean
	rm -rf $(VENV) out .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks

$(VENV)/pyvenv.cfg:
	@command -v cargo >/dev/null || { echo "make: cargo not found; install Rust 1.89 or later (rustup.rs)" >&2; exit 2; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "make: $(PYTHON) is older than 3.11; name another one: make PYTHON=python3.12" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

# A release build of the extension, with the locked crates, installed as users get it.
$(VENV)/.installed: $(wheel_sources) | $(VENV)/pyvenv.cfg
	$(pip) install .
	touch $@

# The pinned tools alone: asking pip for ".[dev]" would build the wheel a second time.
$(VENV)/.tools: pyproject.toml | $(VENV)/pyvenv.cfg
	$(bin)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["dev"], sep="\n")' > $(VENV)/dev.txt
	$(pip) install --requirement $(VENV)/dev.txt
	touch $@
