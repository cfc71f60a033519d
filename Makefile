# Everything runs in .venv, which the first target that needs it sets up.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
BENCH := .venv-bench/.ready

.PHONY: help demo test test-long test-modules mutants check bench generate clean

help:
	@echo "make demo      set up, regenerate the code, build it, print the five tables on every back end"
	@echo "make test      set up, run the test suite"
	@echo "make test-long the tests that take long: every word, rounding and residual on every kernel"
	@echo "make test-modules  list anew which kernels the tests compile"
	@echo "make mutants   put 80 faults into copies of the code, one at a time, and see that the tests notice them; half an hour"
	@echo "make check     generated code in step, ruff, mypy"
	@echo "make bench     measure against other code generators, and the back ends; about a quarter of an hour"
	@echo "make generate  rebuild generated/"
	@echo "make clean     remove .venv and what tools left behind"

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "strapgen needs Python 3.11 or newer; set PYTHON to one" >&2; exit 2; }
	@$(PYTHON) -m venv .venv \
	  || { echo "no virtual environment: on Debian, apt-get install python3-venv python3-dev gcc" >&2; exit 2; }
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar on -e '.[dev]'
	@touch $@

demo: $(READY)
	$(BIN)/strapgen generate --all
	$(BIN)/strapgen tables

test: $(READY)
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not long"

test-long: $(READY)
	$(BIN)/python -m pytest -n auto --dist worksteal -m long

# With an empty cache, so that every module is built and noted.
test-modules: $(READY)
	folder=$$(mktemp -d) && STRAPGEN_CACHE_DIR=$$folder/cache $(BIN)/python -m pytest -n auto --dist worksteal \
	  -m "not long" --record-modules $$folder/modules \
	  && sort -u $$folder/modules > tests/data/modules.jsonl && rm -r $$folder

# It goes on where it was stopped: the outcomes are in .mutants/. More with MUTANTS="--only rotations --list", see --help.
mutants: $(READY)
	$(BIN)/python tests/mutants.py $(MUTANTS)

check: $(READY)
	$(BIN)/strapgen generate --all --check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The other generators bring their own requirements: they get an environment of their own, each by itself, so that one
# that cannot be installed is missing alone; the report says so.
$(BENCH): pyproject.toml
	$(PYTHON) -m venv .venv-bench
	.venv-bench/bin/python -m pip install --disable-pip-version-check -e .
	@for name in symforce casadi wrenfold; do \
	  .venv-bench/bin/python -m pip install --disable-pip-version-check -e ".[bench-$$name]" \
	    || echo "$$name cannot be installed; the benchmark goes on without it" >&2; \
	done
	@touch $@

bench: $(BENCH)
	.venv-bench/bin/python benchmarks/compare.py
	.venv-bench/bin/python benchmarks/fixed_point.py
	.venv-bench/bin/python benchmarks/backends.py

generate: $(READY)
	$(BIN)/strapgen generate --all

clean:
	rm -rf .venv .venv-bench .mypy_cache .ruff_cache .pytest_cache .hypothesis .mutants build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
