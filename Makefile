# Set-up is part of every target: only python3 (3.11 or newer), make and git are needed.

PYTHON ?= python3
VENV   ?= .venv
CONFIG ?= configs/flat.yaml
ARGS   ?=
JAX    ?=

# two processes, each with whole files: what a file's tests compile they share. In the order of
# tests/conftest.py, so that no long file begins when the other process has nothing left to do
PARALLEL := -n 2 --dist loadfile --no-loadscope-reorder

BIN   := $(VENV)/bin
STAMP := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help train test test-slow check bench clean

help: ## this list
	@awk -F':.*## ' '/^[a-z-]+:.*## / { printf "  make %-11s %s\n", $$1, $$2 }' Makefile
	@echo "  CONFIG=FILE chooses the config, ARGS='key=value ...' changes settings of it"
	@echo "  JAX=cuda13 (or cuda12) makes the set-up install JAX for NVIDIA GPUs"

train: $(STAMP) ## train CONFIG (configs/flat.yaml), or continue the run that is there
	$(BIN)/getup-train $(CONFIG) $(ARGS) --resume

test: $(STAMP) ## the tests, on the CPU
	JAX_PLATFORMS=cpu $(BIN)/python -m pytest -m "not slow" $(PARALLEL) $(ARGS)

test-slow: $(STAMP) ## the longer tests, on the CPU
	JAX_PLATFORMS=cpu $(BIN)/python -m pytest -m slow $(ARGS)

check: $(STAMP) ## lint, format and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

bench: $(STAMP) ## every benchmark, one after the other; ARGS=--quick for the smallest sizes
	@set -e; for file in benchmarks/*.py; do echo "== $$file"; $(BIN)/python "$$file" $(ARGS); done

clean: ## remove what can be made again; runs/ stays
	rm -rf $(VENV) dist build .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMP): pyproject.toml
	@command -v $(PYTHON) > /dev/null || { \
	  echo "make: no $(PYTHON) here; install Python 3.11 or newer, or give PYTHON=/path/to/python3" >&2; \
	  exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "make: expected Python 3.11 or newer, got $$($(PYTHON) --version 2>&1);" \
	       "give PYTHON=python3.11 (or newer)" >&2; \
	  exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2> /dev/null || { \
	  echo "make: $(PYTHON) cannot make virtual environments;" \
	       "on Debian and Ubuntu: apt install python3-venv" >&2; \
	  exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[dev]' $(if $(JAX),'jax[$(JAX)]')
	@touch $@
