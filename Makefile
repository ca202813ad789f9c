# make demo   set up, then play a wheelset onto a CAN bus and watch the estimate against the truth
# make test   set up, then all tests: on the host, on a real kernel's vcan and under real systemd; lists what this machine lacks for some
# make lint   format, lint, types: seconds
# make night  the slowest tests, minutes of processor time, which make test and make check leave out
# make check  make lint and make test; both, whatever fails
# make corpus  515 logs from seeds through wrcd replay: whether frames, events and rows are as recorded; minutes. Before every landing
# make docs   builds the pages' site into build/site
# make vcan -- COMMAND  COMMAND where there is a vcan0: on this kernel, or in a throw-away one; without COMMAND a shell
# make fuzz   property tests with EXAMPLES (10^5) examples each, and a million corrupted frames; hours
# make soak   HOURS (24) on the virtual clock in one core: nothing grows, drifts or is lost; an hour
# make coverage  which branches of wrcd/bus, wrcd/core, wrcd/recorder and wrcd/service the tests take, those in the guest too; fails below 95 %
# make deb    a Debian package with its libraries inside: build/deb
# make wheels  for x86_64 and aarch64, any Python and any Linux since 2014: dist
# make bench  what wrcd costs on this computer, against another checkout too (BEFORE=DIR); a minute, asserts nothing
# make mutants   whether the tests notice each changed number and comparison in the C that decides what is believed; half an hour or more
# where Python is told to write no bytecode, each program that a test starts compiles wrcd anew, and each worker all tests
unexport PYTHONDONTWRITEBYTECODE
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
TESTS := $(VENV)/tests
TOOLS := build/tools/ready
ZIG := build/zig/bin/cc
HIL := -vv -p no:cacheprovider --durations=5
# Where this machine has no C compiler of its own the library is built by zig's: what build/tools brings links to itself
ifeq ($(shell PATH='$(PATH)'; command -v $(firstword $(CC))),)
export CC := $(CURDIR)/$(ZIG)
endif
export ZIG_GLOBAL_CACHE_DIR := $(CURDIR)/build/zig/cache
# after this machine's own
export PATH := $(PATH):$(CURDIR)/build/tools/bin

ifeq ($(firstword $(MAKECMDGOALS)),vcan)
# The words after it are no targets of ours. make itself takes VAR=x, splits at blanks and drops a leading ./
MAKEFLAGS += --silent
TAKEN := $(filter-out PYTHON=%,$(MAKEOVERRIDES))
.PHONY: vcan
vcan:
	$(if $(strip $(foreach c,; & | < > $$ ` ",$(findstring $(c),$(MAKECMDGOALS)))),echo "make: loses quotes; call tests/with-vcan COMMAND yourself" >&2; exit 2)
	$(if $(TAKEN),echo "make: takes $(TAKEN) for a variable of its own; call tests/with-vcan COMMAND yourself" >&2; exit 2)
	$(MAKE) --no-print-directory $(READY)
	tests/with-vcan $(wordlist 2,$(words $(MAKECMDGOALS)),$(MAKECMDGOALS))
%: vcan ;
Makefile: ;
else

.PHONY: demo pictures test lint check night corpus unit hil systemd fuzz soak coverage bench mutants format design score docs lock audit clean deb wheels

demo: $(READY)
	$(BIN)/sim-ecu demo

test: $(TESTS) $(TOOLS)
	tests/all-stages

# a process for each core and one more, each with a stretch of the tests: few of a module's fixtures are made twice.
# Threads of the linear algebra would wait for each other on cores that are taken: a fifth of the processor time.
unit night: export OPENBLAS_NUM_THREADS = 1
unit night: export OMP_NUM_THREADS = 1
unit night: export LD_LIBRARY_PATH := $(CURDIR)/build/tools/lib$(LD_LIBRARY_PATH:%=:%)
unit: $(TESTS)
	$(BIN)/python -m pytest -n auto --maxprocesses=8 --dist=worksteal --durations=5 -rs -vv

# A script records what the daemon does on vcan, of this kernel where it has one, else of a throw-away guest kernel; then
# the recording is judged here. GUEST_TIMEOUT ends a guest that hangs; it judges no time
hil: $(TESTS)
	$(BIN)/python -m tests.hil.prepare build/hil/play
	rm -rf build/hil/vcan
	-PATH=$(CURDIR)/$(BIN):$$PATH GUEST_OUT=build/hil/vcan GUEST_TIMEOUT=1800 tests/hil/guest/run --native-ok -- \
	    tests/hil/vcan.sh $(CURDIR)/build/hil/play
	$(BIN)/python -m pytest $(HIL) tests/hil/test_daemon.py tests/hil/test_link.py

# records in a guest, and judges here; a guest that dies leaves a recording that fails
systemd: $(TESTS)
	tests/hil/unit-env
	rm -rf build/hil/systemd
	-GUEST_OUT=build/hil/systemd GUEST_TIMEOUT=1800 tests/hil/guest/run --systemd -- tests/hil/systemd.sh
	$(BIN)/python -m pytest $(HIL) tests/hil/test_systemd.py

# build/deb/wrcd_VERSION_ARCH.deb, for the system's python3; no root
deb: $(TESTS)
	$(BIN)/python systemd/deb/build.py

# build/lib*: setuptools would pack what was in the tree once
wheels: $(READY) $(ZIG)
	for machine in x86_64 aarch64; do rm -rf build/lib* && WRCD_MACHINE=$$machine PYTHONPATH=build/zig \
	    $(BIN)/python -m pip wheel -q --disable-pip-version-check --no-deps --no-build-isolation -w dist . || exit; done

# docs/leaf-patch.png, docs/monitor.svg and docs/report.png, from rides that are played for them
pictures: $(TESTS)
	$(BIN)/python -m tests.support.pictures

lint: $(TESTS)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

night: $(TESTS) $(ZIG)
	$(BIN)/python -m pytest -n auto --dist=worksteal --durations=5 -vv -m night

# CORPUS="own reverse" these alone; CORPUS="--write FILE" what this commit gives, for CORPUS="--with FILE" of a later one
corpus: export OPENBLAS_NUM_THREADS = 1
corpus: $(TESTS)
	$(BIN)/python -m tests.corpus $(CORPUS)

check: $(TESTS)
	@failed=0; for stage in lint test; do $(MAKE) $$stage || { failed=2; bad="$$bad $$stage"; }; done; \
	    for stage in $$bad; do echo "make $$stage FAILED"; done; exit $$failed

EXAMPLES ?= 100000
fuzz: $(TESTS)
	EXAMPLES=$(EXAMPLES) FRAMES=1000000 $(BIN)/python -m pytest tests/fuzz --hypothesis-profile=long \
	    --hypothesis-show-statistics --durations=0

HOURS ?= 24
soak: $(TESTS)
	$(BIN)/python -m tests.soak --hours $(HOURS)

coverage: $(TESTS)
	rm -rf build/coverage
	mkdir -p build/coverage/guest
	$(BIN)/python -m tests.hil.prepare build/hil/play
	$(BIN)/coverage run -m pytest --durations=5
	PATH=$(CURDIR)/$(BIN):$$PATH GUEST_OUT=build/coverage/guest GUEST_TIMEOUT=1800 tests/hil/guest/run -- \
	    env WRCD="coverage run --rcfile=$(CURDIR)/pyproject.toml -m wrcd.cli" tests/hil/vcan.sh $(CURDIR)/build/hil/play
	$(BIN)/coverage combine -q build/coverage build/coverage/guest
	$(BIN)/coverage report --fail-under=95

# best alone on the computer; the tables of docs/reference/cost.md
bench: $(TESTS)
	$(BIN)/python -m tests.bench $(if $(BEFORE),--before $(BEFORE))

# what is left is explained in tests/mutants.md
mutants: $(TESTS)
	$(BIN)/python -m tests.mutants

format: $(TESTS)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# the packaged designs, and the paper's own form, which a score compares the lone wheelset's with; takes minutes
design: $(TESTS)
	$(BIN)/sim-ecu design --config multiple-unit -o wrcd/data/designs/multiple-unit.design.json
	$(BIN)/sim-ecu design --config lone-wheelset -o wrcd/data/designs/lone-wheelset.design.json
	$(BIN)/sim-ecu design --config lone-wheelset --form paper -o sim_ecu/data/lone-wheelset.paper.design.json

# the tables of docs/reference/score.md, of the train, of the map with docs/low-rail.png, and of the lone wheelset; half
# an hour on two cores
score: $(READY)
	$(BIN)/sim-ecu score --suite worlds --json build/score-train.json
	$(BIN)/sim-ecu score --suite map --json build/score-map.json --plot docs/low-rail.png
	$(BIN)/sim-ecu score --design lone-wheelset --json build/score-lone.json

# docs/signs-and-axes.png, and the site of the pages in build/site: a warning or a dead link fails
SITE := -m sphinx -q -W --keep-going -n -E -c docs . build/site
docs: $(TESTS)
	$(BIN)/python -m tests.support.signs_picture
	$(BIN)/python $(SITE)

LOCK := build/lock/bin/uv pip compile -q --universal --fork-strategy fewest --python-version 3.11 --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --no-header
lock: build/lock/bin/uv
	$(LOCK) pyproject.toml --extra dev -o requirements-tests.lock
	$(LOCK) pyproject.toml -c requirements-tests.lock --extra bench --extra report --extra monitor --group set-up -o requirements.lock
	$(LOCK) pyproject.toml -c requirements-tests.lock -o requirements-train.lock
	$(LOCK) --group zig -o requirements-zig.lock

# known weaknesses of the locked packages, asked of the Python Packaging Advisory Database; needs the network
AUDIT ?= requirements-train.lock requirements.lock requirements-tests.lock requirements-zig.lock
audit: build/audit/bin/pip-audit
	build/audit/bin/pip-audit --require-hashes --disable-pip --strict --progress-spinner off $(AUDIT:%=-r %)

build/lock/bin/uv:
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install -q --disable-pip-version-check uv

build/audit/bin/pip-audit:
	$(PYTHON) -m venv build/audit
	build/audit/bin/python -m pip install -q --disable-pip-version-check pip-audit

# the library in C is built anew when its sources change
$(READY): requirements.lock tests/install.py pyproject.toml setup.py $(wildcard wrcd/*/c wrcd/*/c/*)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "make: $(PYTHON) must be Python 3.11 or newer; say which with make PYTHON=..." >&2; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	    { echo "make: $(PYTHON) has no venv module; install Debian's package python3-venv" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python tests/install.py requirements.lock
	@command -v $(firstword $(CC)) >/dev/null || $(MAKE) --no-print-directory $(ZIG)
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

# where there is no C compiler: zig's, beside the environment
$(ZIG): requirements-zig.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes --upgrade --target build/zig -r $< || \
	    { echo "make: there is no C compiler; install Debian's packages gcc and libc6-dev" >&2; exit 2; }
	printf '#!/bin/sh\nexec %s/build/zig/ziglang/zig cc -target %s-linux-gnu.2.17 "$$@"\n' '$(CURDIR)' "$$(uname -m)" >$@
	chmod +x $@

# beside it, what only tests and developers need
$(TESTS): $(READY) requirements-tests.lock
	$(BIN)/python tests/install.py requirements-tests.lock
	@touch $@

# the programs that tests use and this machine lacks
$(TOOLS): tests/tools tests/data/programs.txt
	-tests/tools fetch

clean:
	rm -rf $(VENV) build dist wrcd/_native* *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

endif
