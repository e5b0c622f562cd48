# make demo        install into .venv and convert the clip in examples/
# make test        the tests of every day, in the same environment
# make test-long   those that kill programs, play GPUs, draw sensors at random, compile for rare ones, or train
# make lint        style, format and types

PYTHON ?= $(shell for python in python3 python3.13 python3.12 python3.11; do \
	$$python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null \
	&& echo $$python && break; done)
PYTEST_FLAGS ?= -n auto --dist loadfile
BIN := .venv/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.PHONY: demo test test-long lint clean

demo: .venv/core
	$(BIN)/vid2ev convert examples/demo.mp4 -o demo_events --overwrite
	@echo "Look at it: demo_events/preview.mp4"

# (bytecode is kept: some hundred processes are started, and all of them import the same)
test: .venv/dev
	env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest $(PYTEST_FLAGS)

test-long: .venv/dev
	env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest $(PYTEST_FLAGS) -m "long and not slow"

lint: .venv/dev
	$(BIN)/ruff check --no-cache .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf .venv demo_events

.venv/core: pyproject.toml constraints.txt | $(BIN)/pip
	$(INSTALL) -e .
	@touch $@

.venv/dev: pyproject.toml constraints.txt | $(BIN)/pip
	$(INSTALL) -e '.[dev]'
	@touch .venv/core $@

$(BIN)/pip:
	@test -n "$(PYTHON)" || { echo "vid2ev needs Python 3.11, 3.12 or 3.13; install one, or name it: make PYTHON=..."; exit 1; }
	$(PYTHON) -m venv .venv
