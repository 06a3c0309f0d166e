# Everything a newcomer needs; `make help` lists the targets.
# Needs Python >= 3.11 and nothing else; the environment is made in .venv.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help setup demo docs studies pages test test-all lint format constraints release clean

VENV := .venv
BIN := $(VENV)/bin
IS_NEW_ENOUGH := import sys; sys.exit(sys.version_info < (3, 11))

# The first interpreter that is new enough; 3.11 first, because constraints.txt was made with it.
# To use another: make demo PYTHON=/path/to/python3
PYTHON ?= $(shell for candidate in python3.11 python3 python3.12 python3.13 python; do \
	$$candidate -c '$(IS_NEW_ENOUGH)' 2>/dev/null && echo $$candidate && break; done)

# Extra arguments for pytest: make test ARGS="tests/usd -x"
ARGS ?=
# Processes that run the tests, file by file; each takes up to 2 GB.
WORKERS ?= 2

help: ## Show this list
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 20

setup: $(VENV)/.tools ## Make .venv and install the project and its tools into it

# Python compiles what is imported; all of it would be a fifth of a gigabyte.
INSTALL = $(BIN)/python -m pip install --disable-pip-version-check --quiet --use-pep517 --no-compile -c constraints.txt

# What the kernels are compiled with, so that they are while the rest is installed.
COMPILER := warp-lang tyro tqdm filelock

# Installs again only when the project file or the pins have changed. What fails to compile is compiled later.
$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(INSTALL) $(COMPILER)
	@$(BIN)/python -m digs_warp precompile >/dev/null 2>&1 & $(INSTALL) -e . && wait
	@touch $@

$(VENV)/.tools: $(VENV)/.installed
	$(INSTALL) -e '.[dev]'
	@touch $@

$(VENV)/bin/python:
	@'$(PYTHON)' -c '$(IS_NEW_ENOUGH)' 2>/dev/null || { \
		echo "make: needs Python 3.11 or newer, found '$(PYTHON)' ($$('$(PYTHON)' --version 2>&1 | tail -n 1));" \
			"install it or name it: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@echo "Making the environment $(VENV) with $$('$(PYTHON)' --version) and installing into it (a few minutes)"
	@'$(PYTHON)' -m venv $(VENV) || { rm -rf $(VENV); \
		echo "make: this Python cannot make environments; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }

demo: $(VENV)/.installed ## The main job on the built-in object: capture, reconstruct, out/demo/scene.usdz
	$(BIN)/digs-warp run --out out/demo --overwrite

docs: setup ## The documentation as a site in build/site; fails when a link leads nowhere
	$(INSTALL) -e '.[docs]'
	$(BIN)/zensical build --strict

studies: setup ## Run the studies within their budgets and write docs/study; an hour on a quiet machine
	$(BIN)/digs-warp study run initialization --time-budget 20min
	$(BIN)/digs-warp study run tradeoff --time-budget 20min
	$(BIN)/digs-warp study run robustness --time-budget 12min
	$(BIN)/python -m studies page studies

pages: setup demo ## Run all benchmarks and draw all pictures for the documentation; two hours on a quiet machine
	$(BIN)/python -m studies page raster growth budget surface trained recordings photographs sim realism device \
		demo gallery sensor randomization what-is-read real-recordings

# Threads of NumPy's matrix products, which wait by turning, would take the cores from the other process.
PYTEST = OPENBLAS_NUM_THREADS=$${OPENBLAS_NUM_THREADS:-1} $(BIN)/python -m pytest --numprocesses $(WORKERS) --dist loadfile

test: setup ## The test suite, some minutes (first installs missing system libraries with apt, when run as root)
	@scripts/install_system_libraries.sh
	$(PYTEST) -m "not long" $(ARGS)

test-all: setup ## The suite with what takes long and rarely fails: whole mappings, real recordings, browsers
	@scripts/install_system_libraries.sh
	$(PYTEST) $(ARGS)

lint: setup ## ruff (rules and formatting) and pyright
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

format: setup ## Format the code and fix what ruff can fix
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

constraints: ## Update constraints.txt to the newest versions that fit pyproject.toml
	rm -rf build/constraints
	'$(PYTHON)' -m venv build/constraints
	build/constraints/bin/python -m pip install --disable-pip-version-check --quiet '.[dev]'
	@{ sed -n '/^#/p' constraints.txt; \
		build/constraints/bin/python -m pip freeze --all --exclude pip --exclude digs-warp; } > build/constraints.txt
	mv build/constraints.txt constraints.txt
	rm -rf build/constraints

release: setup ## Build wheel and source package, try them in a fresh environment, write the notes: dist/
	$(BIN)/python scripts/release.py

clean: ## Remove caches and build products (keeps .venv and out/)
	rm -rf build dist *.egg-info .pytest_cache .ruff_cache
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +
