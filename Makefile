# make demo   set up, then play a wheelset onto a CAN bus and watch the estimate against the truth
# make test   set up, then all tests: on the host, then on a real kernel's vcan and under real systemd
# make check  format, lint, types, then make test
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
HIL := -p no:cacheprovider --durations=5

.PHONY: demo test check unit hil systemd format design score lock clean

demo: $(READY)
	$(BIN)/sim-ecu demo

test: unit hil systemd

unit: $(READY)
	$(BIN)/python -m pytest --durations=5

# vcan of this kernel where it has one, else of a throw-away guest kernel
hil: $(READY)
	GUEST_TIMEOUT=900 tests/hil/guest/run --native-ok -- $(BIN)/python -m pytest $(HIL) tests/hil/test_vcan.py

systemd: $(READY)
	tests/hil/unit-env
	GUEST_TIMEOUT=900 tests/hil/guest/run --systemd -- $(BIN)/python -m pytest $(HIL) -rP tests/hil/test_systemd.py

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(MAKE) test

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# the packaged design and what a score compares it with, as they were made; takes minutes
design: $(READY)
	$(BIN)/sim-ecu design -o wrcd/data/default.design.json --baselines sim_ecu/data/default.baselines.json

# the README's tables; up to 15 minutes on two cores
score: $(READY)
	$(BIN)/sim-ecu score --json build/score.json --html build/score.html

LOCK := $(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --no-header pyproject.toml
lock: $(READY)
	$(LOCK) --extra dev -o requirements.lock
	$(LOCK) -c requirements.lock -o requirements-train.lock

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "make: $(PYTHON) must be Python 3.11 or newer; say which with make PYTHON=..." >&2; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	    { echo "make: $(PYTHON) has no venv module; install Debian's package python3-venv" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
