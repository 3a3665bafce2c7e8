# Two commands do everything: `make run` shows it working, `make test` proves it.
PYTHON ?= python3
BIN := .venv/bin
LOG := logs/path-$(shell date +%Y%m%d-%H%M%S).mcap

.PHONY: run test check bench clean

run: .venv/installed
	$(BIN)/neurosnap run neurosnap/Path-v0 --ticks 300 --seed 7 --out $(LOG)
	$(BIN)/neurosnap replay $(LOG) --verify

test: .venv/installed-dev
	$(BIN)/python -m pytest

check: .venv/installed-dev
	tools/check

bench: .venv/installed-dev
	$(BIN)/python tools/bench.py

# pip from 25.1 on knows dependency groups.
.venv/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "neurosnap needs Python 3.11 or newer")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'

.venv/installed: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install --quiet --editable '.[plot]'
	touch $@

.venv/installed-dev: .venv/installed
	$(BIN)/python -m pip install --quiet --group dev
	touch $@

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
