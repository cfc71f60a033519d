# Everything runs in .venv, which the first target that needs it sets up.

PYTHON ?= python3
BIN := .venv/bin
# What the commands need, and what tests and checks need beside it.
READY := .venv/.ready
TOOLS := .venv/.ready-to-test
BENCH := .venv-bench/.ready
DOCS := .venv/.ready-for-docs

.PHONY: help demo test test-lowest test-long mutants check bench generate clean \
  check-generated check-style check-layout check-types check-prose firmware-tools cost evidence evidence-page \
  evidence-tools language-tools estimation-tools site-tools faults fuzz release-check docs docs-serve docs-check

help:
	@echo "make demo      set up, then a short tour: formulas, their C, a table on every back end"
	@echo "make test      set up, with what tests need; run the test suite"
	@echo "make test-lowest  the same with the lowest versions that pyproject.toml allows, in .venv-lowest"
	@echo "make test-long the tests that take long: more words, roundings, methods and motions, long runs"
	@echo "make mutants   put the written faults and 240 drawn ones into copies of the code; half an hour a run, which goes on where the last one stopped"
	@echo "make check     generated code in step, ruff, mypy, spelling and prose"
	@echo "make bench     measure against other code generators, and the back ends; about a quarter of an hour"
	@echo "make generate  rebuild generated/"
	@echo "make cost      measure generated/COST.md anew, with the tools of make firmware-tools"
	@echo "make firmware-tools  on Debian: cross compilers, QEMU and CMake, for strapgen cost and tests"
	@echo "make evidence-tools  on Debian: the tools above, Frama-C, Gappa, Coq, fuzzers and more processors, for make evidence"
	@echo "make language-tools  on Debian: compilers of C++ and Rust, Eigen and Octave, for the tests of those languages"
	@echo "make estimation-tools  on Debian: Ceres, and GTSAM from PyPI, for the tests of examples/estimation"
	@echo "make site-tools  on Debian: Chromium and npm, for make docs and the tests of its pages"
	@echo "make evidence  have independent tools examine the standard catalogue; hold generated/EVIDENCE.md to what they say"
	@echo "make evidence-page  the same, and write generated/EVIDENCE.md anew"
	@echo "make faults    kill commands, fill disks and move clocks for four minutes; see that nothing wrong is left"
	@echo "make fuzz      try drawn inputs on the C, the readers and the command line for five minutes"
	@echo "make release-check  build the archives in dist/; have the wheel pass the tests away from the sources"
	@echo "make docs      build the documentation as a site that needs no network: docs/_build/html/index.html"
	@echo "make docs-serve  the same, at http://127.0.0.1:8000 for the page that runs strapgen in the browser"
	@echo "make docs-check  build the site; open each of its pages in Chromium, on a telephone and on a desk"
	@echo "make clean     remove .venv and what tools left behind"

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "strapgen needs Python 3.11 or newer; set PYTHON to one" >&2; exit 2; }
	@$(PYTHON) -m venv .venv \
	  || { echo "no virtual environment: on Debian, apt-get install python3-venv python3-dev gcc" >&2; exit 2; }
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar on -e .
	@touch $@

$(TOOLS): $(READY)
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar on -e '.[dev]'
	@touch $@

demo: $(READY)
	@echo "1. Derive every kernel of the catalogue; generate numpy, C and fixed point"
	$(BIN)/strapgen generate --all
	@echo
	@echo "2. One step as formulas: Euler parameters, Euler's method, two gyro samples"
	$(BIN)/strapgen derive euler --method rk1 --show program
	@echo
	@echo "3. The same step in C, from generated/c/euler_rk1_2.c"
	@sed -n '/^void euler_rk1_2(/,/^}/p' generated/c/euler_rk1_2.c
	@echo
	@echo "4. Table 5 of the thesis on every back end; c-fixed32 has 32-bit words, c-fixed16 16-bit"
	$(BIN)/strapgen tables --table 5
	@echo
	@echo "More: source .venv/bin/activate, then"
	@echo "  strapgen list      all algorithms, methods, kernels, motions and back ends"
	@echo "  strapgen --help    all commands, each with an example in its own --help"
	@echo "  strapgen tables    all five tables"
	@echo "docs/command-line.md shows all commands; docs/README.md answers questions."

FIRMWARE := gcc-arm-none-eabi picolibc-arm-none-eabi qemu-system-arm gcc-riscv64-unknown-elf \
  picolibc-riscv64-unknown-elf qemu-system-misc gcc-avr avr-libc arduino-core-avr clang cppcheck cmake

EXAMINERS := frama-c-base gappa clang-tidy simavr valgrind qemu-user gcc-powerpc-linux-gnu \
  libc6-dev-powerpc-cross gcc-i686-linux-gnu libc6-dev-i386-cross afl++ libclang-rt-14-dev coq libcoq-flocq libcoq-gappa \
  texlive-latex-base

firmware-tools:
	apt-get update -qq
	apt-get install -y -qq --no-install-recommends $(FIRMWARE)

evidence-tools: firmware-tools $(READY)
	apt-get install -y -qq --no-install-recommends $(EXAMINERS)
	$(BIN)/python -m pip install --disable-pip-version-check -e '.[evidence]'

language-tools:
	apt-get update -qq
	apt-get install -y -qq --no-install-recommends g++ rustc octave libeigen3-dev

# Without a wheel of GTSAM for this Python its tests are skipped.
estimation-tools: $(READY)
	apt-get update -qq
	apt-get install -y -qq --no-install-recommends g++ libceres-dev
	$(BIN)/python -m pip install --disable-pip-version-check --only-binary gtsam -e '.[estimation]' \
	  || echo "GTSAM cannot be installed; its tests are skipped" >&2

# Node's own packages bring npm too.
site-tools:
	apt-get update -qq
	apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core
	command -v npm > /dev/null || apt-get install -y -qq --no-install-recommends npm

# Python and pytest keep what they have compiled of the tests: a tenth of the next run.
test test-long: export PYTHONDONTWRITEBYTECODE =

test: $(TOOLS)
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not long"

# uv resolves direct requirements to their lowest versions.
test-lowest:
	$(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python -m pip install --disable-pip-version-check uv
	.venv-lowest/bin/uv pip install --python .venv-lowest/bin/python --resolution lowest-direct -e '.[dev]'
	.venv-lowest/bin/python -m pytest -n auto --dist worksteal -m "not long"

test-long: $(TOOLS)
	$(BIN)/python -m pytest -n auto --dist worksteal -m long

# It goes on where it was stopped: the outcomes are in .mutants/. More with MUTANTS="--only rotations --list", see --help.
mutants: $(TOOLS)
	$(BIN)/python tests/mutants.py $(MUTANTS)

# Side by side, each part's output in one piece.
check: $(TOOLS)
	@$(MAKE) --no-print-directory -j --output-sync=target check-generated check-style check-layout check-types check-prose

check-generated:
	$(BIN)/strapgen generate --all --check
check-style:
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-cache > /dev/null || $(BIN)/lint-imports --no-cache
check-layout:
	$(BIN)/ruff format --check .
check-types:
	$(BIN)/mypy
check-prose:
	$(BIN)/codespell
	$(BIN)/python tests/prose.py

# The other generators bring their own requirements: they get an environment of their own, each by itself, so that one
# that cannot be installed is missing alone; the report says so.
$(BENCH): pyproject.toml
	$(PYTHON) -m venv .venv-bench
	.venv-bench/bin/python -m pip install --disable-pip-version-check -e .
	@for name in symforce casadi wrenfold logs; do \
	  .venv-bench/bin/python -m pip install --disable-pip-version-check -e ".[bench-$$name]" \
	    || echo "$$name cannot be installed; the benchmark goes on without it" >&2; \
	done
	@touch $@

bench: $(BENCH)
	.venv-bench/bin/python benchmarks/compare.py
	.venv-bench/bin/python benchmarks/fixed_point.py
	.venv-bench/bin/python benchmarks/high_products.py
	.venv-bench/bin/python benchmarks/backends.py
	.venv-bench/bin/python benchmarks/throughput.py
	.venv-bench/bin/python benchmarks/waiting.py
	.venv-bench/bin/python benchmarks/jacobians.py
	.venv-bench/bin/python benchmarks/logs.py

generate: $(READY)
	$(BIN)/strapgen generate --all

cost: $(READY)
	$(BIN)/strapgen cost --all --format markdown --out generated/COST.md

# It fails if a tool is missing or the page differs from what the tools say.
evidence: $(READY)
	$(BIN)/strapgen evidence --all --complete --page generated/EVIDENCE.md --check
evidence-page: $(READY)
	$(BIN)/strapgen evidence --all --complete --page generated/EVIDENCE.md

# The wheel is built from the source archive, and passes the archive's tests without the sources beside it; the tests of
# the sources themselves, their layout and faults in them, stay out. For git the archive lies in no checkout.
release-check: $(TOOLS)
	rm -rf dist build/release
	$(BIN)/python -m build --outdir dist .
	mkdir -p build/release
	tar -xf dist/strapgen-*.tar.gz -C build/release --strip-components 1
	mv build/release/codegen build/release/sources
	$(PYTHON) -m venv build/release/.venv
	build/release/.venv/bin/python -m pip install --disable-pip-version-check "$$(ls dist/*.whl)[dev]"
	cd build/release && GIT_CEILING_DIRECTORIES=$(CURDIR)/build \
	  .venv/bin/python -m pytest -n auto --dist worksteal -m "not long" \
	  --ignore tests/test_architecture.py --ignore tests/test_mutants.py --ignore tests/test_package_files.py tests

faults: $(TOOLS)
	$(BIN)/python tests/faults.py --seconds 240
fuzz: $(TOOLS)
	$(BIN)/python tests/fuzz.py --seconds 300

$(DOCS): $(READY)
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar on -e '.[docs]'
	@touch $@

# npm and PyPI bring MathJax and Python for the browser, which the pages then have beside them.
docs: $(DOCS)
	$(BIN)/python docs/site/build.py
	@echo "docs/_build/html/index.html"

docs-serve: docs
	$(BIN)/python -m http.server --bind 127.0.0.1 --directory docs/_build/html 8000

docs-check: docs $(TOOLS)
	$(BIN)/python -m pytest -n auto --dist worksteal -m long --site docs/_build/html tests/test_site.py tests/test_try_page.py

clean:
	rm -rf docs/_build .venv .venv-bench .venv-lowest .mypy_cache .ruff_cache .pytest_cache .hypothesis .mutants build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
