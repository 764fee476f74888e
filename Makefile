# make demo | test | quick | cases | lint | bench | emission | docs | faults | kills | speed | page | screenshots : each creates its environment first; nothing else is needed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# How many runs `make kills` stops, and how many of a test with final measurement.
KILLS ?= 200
FINAL_KILLS ?= 50
# Workers of `make test`: one more than the number of cores, because many tests wait for a browser or a simulated instrument.
WORKERS ?= $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 1)')
# Tests start many programs, and each would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE
SOURCES := $(shell find src instruments procedures sim_profiles -type f -not -name '*.pyc')

.PHONY: demo test quick cases lint bench emission docs faults kills speed page screenshots install clean

install: $(STAMP)

# Strict editable mode links single files, so a file that is added or removed needs a new installation.
$(STAMP): pyproject.toml .files
	$(PYTHON) -c 'import sys; sys.exit("motoremi needs Python 3.11 or newer: make PYTHON=python3.12 ..." if sys.version_info < (3, 11) else 0)'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --config-settings editable_mode=strict -e '.[dev]'
	touch $@

# Changes only when the list of files does.
.files: FORCE
	@printf '%s\n' $(sort $(SOURCES)) | cmp -s - $@ || printf '%s\n' $(sort $(SOURCES)) > $@
FORCE:

demo: install
	$(BIN)/motoremi demo

# Without the motors of `make cases`: CI, which runs it, is to take less than 25 minutes.
test: install
	$(BIN)/python -m pytest -n $(WORKERS) -m 'not case'

# While one works: without tests of half a second or more, browser and ngspice; about a minute on two cores.
quick: install
	$(BIN)/python -m pytest -q -n $(WORKERS) --dist worksteal -m 'not slow'

# Whole diagnoses of single motors that were once judged wrongly, and long tests that are one more of a kind in `make test`. Run it after a change of
# diagnosis or fit.
cases: install
	$(BIN)/python -m pytest -n $(WORKERS) -m case

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy src instruments procedures sim_profiles

emission: install
	$(BIN)/python -m benchmarks.emission

bench: install
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --config-settings editable_mode=strict -e '.[bench]'
	$(BIN)/python -m benchmarks

docs: install
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# Every fault at every exchange of the full procedure (about ten minutes); the tests apply each at the first and last exchange of each step.
faults: install
	$(BIN)/python tests/fault_matrix.py

# 200 runs killed and 200 stopped by Ctrl-C at random moments, each resumed; 50 with prescan and final measurement killed, resumed and replayed.
kills: install
	$(BIN)/python tests/kill_run.py $(KILLS) SIGKILL impedance_only
	$(BIN)/python tests/kill_run.py $(KILLS) SIGINT impedance_only
	$(BIN)/python tests/kill_run.py $(FINAL_KILLS) SIGKILL conducted_emission

# Speed of simulation and replay, and the time that recording takes.
speed: install
	$(BIN)/python -m benchmarks.bench_speed

# Speed of the workbench in a browser (needs chromium).
page: install
	$(BIN)/python -m benchmarks.workbench

# The screenshots of the documentation, taken by the browser tests (needs chromium).
screenshots: install
	MOTOREMI_SCREENSHOTS=$(CURDIR)/docs/screenshots $(BIN)/python -m pytest -q $(addprefix tests/workbench/test_workbench_,browser.py story.py clicks.py)

clean:
	rm -rf $(VENV) build site .files .mypy_cache .pytest_cache .ruff_cache
