# Two commands: `make run` starts the simulator, `make test` checks all of it.

SHELL := /bin/bash
CARGO ?= cargo
BIN := $(or $(CARGO_TARGET_DIR),target)/release

.PHONY: help run test build picture report fuzz soak force-pictures clean deps-run deps-soak deps-test

help: ## This list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/'

run: deps-run build ## Build, start rt-core and open the window; without a display run the procedure headless
	@setpriv --pdeathsig TERM docs/tools/run "$(BIN)"

build: ## Build both programs
	$(CARGO) build --release -p rt-core -p host-ui

test: deps-test ## Install what the tests need, build everything, run all tests
# The same set of packages both times, or features differ and everything is built twice. One test at a time: each system
# test has a real-time core of its own.
	$(CARGO) build --release --workspace --all-targets
	$(CARGO) test --release --workspace -- --test-threads=1

picture: deps-test build ## Draw the pictures of the README and the tour anew
	UPDATE_SNAPSHOTS=1 $(CARGO) test --release -p stylet-tests --test ui_live --test ui_plan --test ui_states --test ui_window -- --test-threads=1

report: ## Speed against error of every tissue model, into benches/runs/<date>-<host> (some minutes)
	$(CARGO) run --release -p stylet-benches --bin report

fuzz: ## Feed each reader of files with what it does not expect for FUZZ_SECONDS (600) seconds
	docs/tools/fuzz

soak: deps-soak build ## Memory of the window over SOAK_SECONDS (3600) of procedures, on a screen of its own
	docs/tools/soak "$(BIN)" $(SOAK_SECONDS)

force-pictures: ## Measure the stiffness that the loop holds, and draw the pictures of force anew
	$(CARGO) bench -p stylet-benches --bench force

clean: ## Remove what was built
	$(CARGO) clean

deps-run:
	@docs/tools/need cargo libxkbcommon-x11-0 mesa-vulkan-drivers

deps-soak:
	@docs/tools/need cargo libxkbcommon-x11-0 mesa-vulkan-drivers xauth xvfb

deps-test:
	@docs/tools/need cargo libxkbcommon-x11-0 mesa-vulkan-drivers python3-nibabel python3-pydicom xvfb
