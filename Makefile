# What a person does with gemelo. Everything here needs only `deploy/bootstrap`, which `make setup` runs.
.DEFAULT_GOAL := help
.PHONY: help setup up down test test-all check coverage format docs picture demo bench recordings lock clean
MAKEFLAGS += --no-print-directory
unexport PYTHONDONTWRITEBYTECODE # where it is set, every process compiles its libraries anew: 3 s of CPU for the page alone
bin := .venv/bin
# Three workers for two cores, as many tests wait for brokers, routers and processes; of stacks one for each core.
workers = $(shell echo $$((3 * $$(nproc) / 2)))
pytest = $(bin)/pytest --durations=12 --durations-min=8

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' Makefile | column -t -s '|'

setup: ## make this folder ready to run; skips what is done
	@deploy/bootstrap

up: setup ## start the twin (setup first), ARMS="rm1 parol6": several; Ctrl-C stops it
	@deploy/up

down: ## stop a twin that runs elsewhere
	@PROC_COMP_CONFIG=.gemelo $(bin)/process-compose down

test: setup ## what one process can show, ten minutes; ROOM=planner: that folder of tests/ alone
	@$(MAKE) --keep-going test-core test-python
	@deploy/optional

test-all: test test-rest ## also stacks, browsers, real time, and every property with all its examples

.PHONY: test-core test-python test-left-out test-rest test-core-rest test-properties test-stacks test-alone
test-core:
	@$(if $(filter firmware,$(or $(ROOM),firmware)),deploy/test_firmware)
test-python:
	@$(pytest) -n $(workers) --maxprocesses 8 --dist worksteal -m "not full" tests/$(ROOM)

test-left-out: # what the run before went without, where it is here: .ci/run makes `make test` on a bare machine
	@deploy/test_firmware left-out
	@$(pytest) -n $(workers) --maxprocesses 8 --dist worksteal --left-out tests

test-rest: setup # without `make test`, which .ci/run has made before
	@$(MAKE) --keep-going test-core-rest test-properties test-stacks test-alone
	@deploy/optional
test-core-rest:
	@deploy/test_firmware full
test-properties:
	@HYPOTHESIS_PROFILE=full $(pytest) -n $(workers) --maxprocesses 8 --dist worksteal -m "(hypothesis or scaled) and not full" tests
test-stacks: # a stack on each of two workers: with three on two slow cores one loses its heartbeats
	@HYPOTHESIS_PROFILE=full $(pytest) -n 2 --dist loadgroup -m "full and not alone" tests
test-alone:
	@$(pytest) -m "alone" tests

check: setup ## ruff, mypy, import-linter, clang-format, gofmt
	@$(MAKE) --jobs 2 --keep-going --output-sync=target $(checks)
	@echo "check: all good"

# Side by side, the longest first; each one's messages stay together.
checks := check-types check-walls check-lint check-format check-cpp check-go
.PHONY: $(checks)
check-types:
	@$(bin)/mypy --no-error-summary gemelo docs examples integrations
check-walls:
	@$(bin)/lint-imports --no-logo >/dev/null || $(bin)/lint-imports --no-logo
check-lint:
	@$(bin)/ruff check --quiet .
check-format:
	@$(bin)/ruff format --check --quiet . || { echo "remedy: make format"; exit 1; }
check-cpp:
	@git ls-files '*.h' '*.hpp' '*.cpp' | xargs -r $(bin)/clang-format --dry-run -Werror
check-go: # where Go is on PATH
	@! command -v gofmt >/dev/null || [ -z "$$(gofmt -l services)" ] || { echo "remedy: make format"; exit 1; }

format: setup ## let ruff, clang-format and gofmt write
	@$(bin)/ruff check --quiet --fix . ; $(bin)/ruff format --quiet .
	@git ls-files '*.h' '*.hpp' '*.cpp' | xargs -r $(bin)/clang-format -i
	@! command -v gofmt >/dev/null || gofmt -w services

docs: setup ## these pages as a site with a search, in English and Spanish: out/site/index.html
	@$(bin)/python docs/make_planners.py
	@deploy/docs

picture: setup ## docs/move.gif anew: one move on the page, as Chromium draws it
	@$(bin)/python docs/make_picture.py

demo: setup ## a sine and a tour, without a display: out/demo.json, recording, picture
	@$(bin)/python -m gemelo.tools.demo

coverage: setup ## lines of the firmware core that its tests reach, and why not the others
	@deploy/coverage

bench: setup ## the figures: out/bench.json
	@$(bin)/python -m gemelo.tools.bench

recordings: setup ## the recordings that `make test` replays, made anew: tests/replay/recordings
	@$(bin)/python -m gemelo.tools.replay.make_recordings

lock: setup ## resolve pyproject.toml anew into requirements.lock and deploy/tools/docs.lock
	@deploy/lock

clean: ## remove everything that setup and runs made
	rm -rf .venv .gemelo out firmware/build services/planner/native/build services/planner/native/_motion.*.so gemelo.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
