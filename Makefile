# What a person does with gemelo. Everything here needs only `deploy/bootstrap`, which `make setup` runs.
.DEFAULT_GOAL := help
.PHONY: help setup up down test check coverage format docs demo bench recordings lock clean
MAKEFLAGS += --no-print-directory
unexport PYTHONDONTWRITEBYTECODE # where it is set, every process compiles its libraries anew: 3 s of CPU for the page alone
bin := .venv/bin
# On every core at once; then the tests that start processes, a file on each core; then whole stacks with a browser or with
# processes that are killed, two files at once; then what measures links, stops and keys in time, alone.
side_by_side := $(addprefix tests/,arm bench chaos demo firmware logger planner robot_import schemas stepper_gateway urdf visualizer)
folders := $(filter-out $(side_by_side) tests/panel tests/stack,$(patsubst %/,%,$(wildcard tests/*/)))
# Of the page and of whole stacks those that measure no time: they hold steps, words and files.
patient := $(patsubst %,tests/panel/test_%.py,camera_box cameras model own_pages goals_on_the_stack \
	page_on_the_stack picks pointing quiet_page six_joints_on_the_stack) $(patsubst %,tests/stack/test_%.py,black_box camera camera_mount clocks_apart configuration control device imported_arm locked_broker my_own_arm old_dialects picks \
	plan_files planning provisioning serial_wire several_arms six_joints)
one_by_one := $(patsubst %,tests/stack/test_%.py,busy_machine chaos hostile_viewer jogging links stops)
# They wait for a state, for as long as it takes; the longest first, so that the browsers are mostly on one side.
in_pairs := $(patsubst %,tests/%.py,panel/test_page stack/test_whole stack/test_deaths stack/test_hosts)
in_pairs += $(filter-out $(patient) $(one_by_one) $(in_pairs),$(wildcard tests/panel/test_*.py tests/stack/test_*.py))
# The longest files begin first: one that begins last leaves the other cores idle.
longest := $(patsubst %,tests/%.py,gemelo/test_programs_on_the_stack examples/test_on_both_arms stack/test_picks gemelo/test_docstrings \
	stack/test_device stack/test_camera_mount stack/test_clocks_apart stack/test_control examples/test_pick_and_place \
	gemelo/test_arm_on_the_stack gemelo/test_unwatched stack/test_six_joints stack/test_several_arms)
file_by_file := $(longest) $(filter-out $(longest),$(patient) $(sort $(shell find $(folders) -name 'test_*.py')))

help: ## this list
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1|\2/p' Makefile | column -t -s '|'

setup: ## make this folder ready to run; skips what is done
	@deploy/bootstrap

up: setup ## start the twin (setup first), ARMS="rm1 parol6": several; Ctrl-C stops it
	@deploy/up

down: ## stop a twin that runs elsewhere
	@PROC_COMP_CONFIG=.gemelo $(bin)/process-compose down

test: setup ## all tests: Python, firmware, whole stack
	@deploy/run_tests worksteal $(side_by_side)
	@$(MAKE) --jobs 2 --keep-going test-firmware test-stacks
	@deploy/optional

# The firmware's build takes the time that the stacks leave while arms move.
.PHONY: test-firmware test-stacks
test-firmware:
	@deploy/behind deploy/test_firmware
test-stacks:
	@deploy/run_tests loadfile $(file_by_file)
	@deploy/run_tests pairs $(in_pairs)
	@deploy/run_tests no $(one_by_one)

check: setup ## ruff, mypy, import-linter, clang-format
	@$(MAKE) --jobs 2 --keep-going --output-sync=target $(checks)
	@echo "check: all good"

# Side by side, the longest first; each one's messages stay together.
checks := check-types check-walls check-lint check-format check-cpp
.PHONY: $(checks)
check-types:
	@$(bin)/mypy --no-error-summary gemelo schemas services firmware docs examples
check-walls:
	@$(bin)/lint-imports --no-logo >/dev/null || $(bin)/lint-imports --no-logo
check-lint:
	@$(bin)/ruff check --quiet .
check-format:
	@$(bin)/ruff format --check --quiet . || { echo "remedy: make format"; exit 1; }
check-cpp:
	@git ls-files '*.h' '*.hpp' '*.cpp' | xargs -r $(bin)/clang-format --dry-run -Werror

format: setup ## let ruff and clang-format write
	@$(bin)/ruff check --quiet --fix . ; $(bin)/ruff format --quiet .
	@git ls-files '*.h' '*.hpp' '*.cpp' | xargs -r $(bin)/clang-format -i

docs: setup ## docs/api.md from the docstrings of gemelo
	@$(bin)/python docs/make_api.py

demo: setup ## a sine and a tour, without a display: out/demo.json, recording, picture
	@$(bin)/python -m services.demo

coverage: setup ## lines of the firmware core that its tests reach, and why not the others
	@deploy/coverage

bench: setup ## the figures: out/bench.json
	@$(bin)/python -m services.bench

recordings: setup ## the recordings that `make test` replays, made anew: tests/replay/recordings
	@$(bin)/python -m services.replay.make_recordings

lock: setup ## resolve pyproject.toml anew into requirements.lock
	@deploy/lock

clean: ## remove everything that setup and runs made
	rm -rf .venv .gemelo out firmware/build services/planner/native/build services/planner/native/_motion.*.so gemelo.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
