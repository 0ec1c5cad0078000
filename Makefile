# Everything a user or a CI types. Works from a bare clone with Python and GNU make 3.81 or newer.

NEEDED := Python 3.11 to 3.14 (on Intel Macs to 3.13)
FITS := import platform, sys; top = 13 if (sys.platform, platform.machine()) == ('darwin', 'x86_64') else 14; \
	sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, top))
PYTHON ?= $(shell for p in python3.14 python3.13 python3.12 python3.11 python3 python py; do \
	command -v $$p >/dev/null 2>&1 && $$p -c "$(FITS)" >/dev/null 2>&1 && echo $$p && break; done)
NO_VENV = import sys; print('$(PYTHON) has no venv module; on Debian and Ubuntu: apt install python%d.%d-venv' % sys.version_info[:2])
BIN := $(if $(filter Windows_NT,$(OS)),.venv/Scripts,.venv/bin)
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
STUDY ?=
N ?= 1000
SEED ?= 1

.DEFAULT_GOAL := help
.PHONY: help install study test verify fuzz figures versus bench bench-large torture check check-platforms clean

help: ## list the targets
	@echo "make study              run all named studies, from nothing; results and figures in results/"
	@echo "make study STUDY=p0     run one of them, or a study file"
	@echo "make test               run the tests"
	@echo "make verify             run the verification cases alone, with their names"
	@echo "make fuzz N=10000       attack the engine with random models, the reading with mutated files (SEED=1); findings in results/fuzz"
	@echo "make figures            draw the figures of docs/ anew, some minutes"
	@echo "make versus             OpenSees and coralquake on the same model, one figure: results/versus.png"
	@echo "make bench              all timings, beside OpenSees where it can be installed; some minutes; results/bench.json"
	@echo "make bench-large        10,000 cases of 1,000 steps on two cores: seconds, memory, results/large.nc"
	@echo "make torture            kill a run 50 times at random moments, start it again, compare; some minutes"
	@echo "make check              style, format, import contract, types"
	@echo "make check-platforms    do the pinned versions have wheels on every platform and Python? installs nothing"
	@echo "make install            make .venv with the command $(BIN)/coralquake"
	@echo "make clean              remove .venv, caches and what studies wrote to results/"

.venv/made:
	@test -n "$(PYTHON)" || { echo "$(NEEDED) was not found; install it, or say: make PYTHON=/path/to/python"; exit 2; }
	@"$(PYTHON)" -c "$(FITS)" || { echo "$(PYTHON) is not $(NEEDED)"; exit 2; }
	@"$(PYTHON)" -c "import ensurepip, venv" 2>/dev/null || { "$(PYTHON)" -c "$(NO_VENV)"; exit 2; }
	"$(PYTHON)" -m venv .venv
	@touch $@

.venv/installed: .venv/made pyproject.toml pins.txt
	$(PIP) install --quiet --only-binary :all: --constraint pins.txt --editable .
	@touch $@

.venv/tools: .venv/installed
	$(PIP) install --quiet --only-binary :all: --constraint pins.txt --editable ".[dev]"
	@touch $@

.venv/peer: .venv/installed
	@if $(PIP) install --quiet --only-binary :all: --constraint pins.txt --editable ".[peer]"; then touch $@; \
	else echo "OpenSeesPy could not be installed: versus shows its stored result, bench says so"; fi

.venv/cluster: .venv/installed
	$(PIP) install --quiet --only-binary :all: --constraint pins.txt --editable ".[cluster]"
	@touch $@

install: .venv/installed
	@echo "ready: $(BIN)/coralquake --help"

study: .venv/installed
	$(BIN)/coralquake run --plot $(if $(STUDY),"$(STUDY)",--all)

test: .venv/tools
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile

verify: .venv/tools
	$(BIN)/python -m pytest tests/verification --verbose

fuzz: .venv/tools
	$(BIN)/python -m tests.fuzz --number $(N) --seed $(SEED)
	$(BIN)/python -m tests.fuzz.mutations --number $(N) --seed $(SEED)

figures: .venv/installed
	$(BIN)/python docs/signs.py
	$(BIN)/python docs/mesh_convergence.py

versus: .venv/peer
	$(BIN)/python -m benchmarks.versus

bench: .venv/cluster .venv/peer
	$(BIN)/python -m benchmarks

bench-large: .venv/installed
	$(BIN)/python -m benchmarks.large

torture: .venv/tools
	$(BIN)/python -m tests.torture

check: .venv/tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy

check-platforms: .venv/tools
	@sh .ci/check-platforms $(BIN)/python

clean:
	rm -rf .venv build dist .pytest_cache .ruff_cache .mypy_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
	find results -type f ! -name README.md -delete
	find results -mindepth 1 -type d -empty -delete
