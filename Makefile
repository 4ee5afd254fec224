# SPDX-License-Identifier: MIT
# Everything sets itself up: `make fly` and `make test` are all that a fresh machine needs.
SHELL := /bin/bash
MAKEFLAGS += --no-print-directory
export SCENARIO ?= multi_obstacle
export PLANT ?= dji_hil
export SPEED ?= 1.0
SOAK_MINUTES ?= 10
RVIZ ?=
ONLY ?=
HOURS ?= 5
in_workspace := . devel/setup.bash &&
single_thread := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
two_workers := -n 2 --dist loadscope

.PHONY: help build fly bench soak faults fuzz test test-long lint clean

help:
	@echo "make fly [SCENARIO=multi_obstacle] [PLANT=dji_hil] [SPEED=1.0] [RVIZ=1]   fly in the simulator, record, report"
	@echo "make bench [BENCH_ARGS=...]   performance tables, build/bench.json, figures; ten minutes (--quick: one)"
	@echo "make soak [SOAK_MINUTES=10]   a long flight on a busy machine: jitter, memory, markers; build/soak.json"
	@echo "make faults [ONLY=WORD]   what may go wrong, in three situations each, without ROS: table, build/faults.json; some minutes"
	@echo "make fuzz [HOURS=5]   random stories around the guard, so many simulated hours; ends at the first in which something must not happen"
	@echo "make test [PYTEST_ARGS=...]   everything that continuous integration runs"
	@echo "make test-long   the tests that take too long for it: traffic, floods of obstacles, motion capture, laser"
	@echo "make build   system packages, Python packages and the workspace, as far as they are missing"
	@echo "make lint    ruff and catkin_lint"
	@echo "make clean   remove what was built; virtual environments and bags stay"

build:
	@.setup/system.sh
	@.setup/python.sh .venv /usr/bin/python3 --system-site-packages
	@.setup/workspace.sh

fly: build
	@$(in_workspace) rosrun uav_sim fly "$$SCENARIO" --plant "$$PLANT" --speed "$$SPEED" $(if $(filter-out 0,$(RVIZ)),--rviz)

bench: build
	@$(in_workspace) $(single_thread) .venv/bin/python3 -m uav_sim.closed_loop.bench $(BENCH_ARGS)

soak: build
	@$(in_workspace) $(single_thread) .venv/bin/python3 -m uav_sim.closed_loop.soak --minutes $(SOAK_MINUTES)

faults: build
	@$(in_workspace) $(single_thread) .venv/bin/python3 -m uav_sim.closed_loop.faults --json build/faults.json $(if $(ONLY),--only "$(ONLY)")

fuzz: build
	@$(in_workspace) $(single_thread) PYTHONPATH="$$PYTHONPATH:tests/unit" .venv/bin/python3 tests/unit/guard_fuzz.py "$(HOURS)"

test: lint
	@$(single_thread) .setup/python38.sh
	@$(in_workspace) $(single_thread) .venv/bin/python3 -m pytest tests $(two_workers) $(PYTEST_ARGS)

test-long: build
	@$(in_workspace) $(single_thread) .venv/bin/python3 -m pytest tests $(two_workers) -m long $(PYTEST_ARGS)

lint: build
	@.venv/bin/ruff check --quiet --output-format concise .
	@.venv/bin/ruff format --quiet --check --output-format concise .
	@$(in_workspace) .venv/bin/catkin_lint -W2 --strict --offline src

clean:
	@rm -rf build devel install logs .pytest_cache .ruff_cache
