# `make demo` shows the whole of ThinkNav; `make test` checks it. Both set up what they need.

PYTHON ?= python3
BIN := .venv/bin
# Tests run side by side in as many processes.
WORKERS ?= 2

.PHONY: help setup demo test test-upstreams bench bench-train bench-peers bench-server bench-server-peers soak fuzz check format pins clean

help:
	@echo 'make demo    train a robot that thinks, evaluate it, write runs/demo/report.html (about 10 minutes)'
	@echo 'make test    formatting, lint, types, tests'
	@echo 'make bench   the simulator'\''s speed beside MiniWorld, Open3D and bare ray casts (some minutes)'
	@echo 'make bench-train  the trainer'\''s speed beside Stable-Baselines3 and Habitat-Baselines (some minutes)'
	@echo 'make bench-server  the planning service beside LitServe, and under overload (some minutes)'
	@echo 'make soak    20 minutes of stepping through ever new homes, then 30 of asking the planning service good and bad things:'
	@echo '             memory stays flat, all is answered (MINUTES=1 for a short one)'
	@echo 'make fuzz    100,000 bodies that no client would send, at both doors of the planning service (some 20 minutes of one core),'
	@echo '             and some thousand requests made from its OpenAPI page'
	@echo 'make setup   only install: .venv with pinned versions'
	@echo 'make format  format the code'
	@echo 'make clean   remove what was made, but for runs/'

setup: .venv/installed

.venv/installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' \
	  || { echo "ThinkNav needs Python 3.11 to 3.13; set PYTHON=/path/to/one (found: $$($(PYTHON) --version 2>&1))" >&2; exit 1; }
	@scripts/system-libraries
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv \
	  || { echo "could not make .venv; on Debian: sudo apt-get install python3-venv" >&2; exit 1; }
	@echo 'installing into .venv (a few minutes the first time)'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[server,vlm,train,scans,dev]'
	@touch $@

demo: setup
	@$(BIN)/thinknav demo

test: setup check
	$(BIN)/pytest --numprocesses $(WORKERS) --dist worksteal

# The planner `openai` against a real vLLM and `transformers serve`; downloads gigabytes into .venv-upstreams.
test-upstreams: setup
	@scripts/upstreams/run

bench: setup bench-peers
	@$(BIN)/thinknav bench sim

bench-train: setup bench-peers
	@$(BIN)/thinknav bench train

# Simulators and learners to compare with, in a virtual environment of their own. Drawing without a display takes Mesa's software
# renderer; on Debian: libegl1 libgl1 libgl1-mesa-dri libglu1-mesa.
bench-peers: .venv-peers/installed

.venv-peers/installed: scripts/install-peers pyproject.toml constraints.txt
	@test -x .venv-peers/bin/python || $(PYTHON) -m venv .venv-peers
	@scripts/install-peers .venv-peers
	@touch $@

# The planning service beside LitServe, which has a virtual environment of its own.
bench-server: setup bench-server-peers
	@$(BIN)/thinknav-server bench throughput
	@$(BIN)/thinknav-server bench overload

bench-server-peers: .venv-serving/installed

.venv-serving/installed:
	@$(PYTHON) -m venv .venv-serving
	@.venv-serving/bin/python -m pip install --quiet --disable-pip-version-check litserve==0.2.19 simplejpeg numpy
	@touch $@

# MINUTES: of each of the two.
soak: setup
	@$(BIN)/thinknav bench soak $(if $(MINUTES),--minutes $(MINUTES))
	@$(BIN)/thinknav-server bench soak $(if $(MINUTES),--minutes $(MINUTES))

# Three kinds of bodies at two doors each.
CASES ?= 100000
fuzz: setup
	FUZZ_CASES=$$(($(CASES) / 6)) $(BIN)/pytest tests/server/test_fuzz.py
	FUZZ_CASES=$$(($(CASES) / 100)) $(BIN)/pytest tests/server/test_openapi.py

check: setup
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy

format: setup
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

# Take the versions that are installed now as the pinned ones.
pins: setup
	@{ sed -n '/^#/p' constraints.txt; \
	   $(BIN)/python -m pip freeze --exclude-editable | grep -vE '^(-e|thinknav)' | sed 's/^torch==.*/torch==2.13.0/'; } > constraints.new
	@mv constraints.new constraints.txt

clean:
	rm -rf .venv .venv-peers .venv-serving .venv-upstreams .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
