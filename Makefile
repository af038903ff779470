# Two commands: `make run` starts the simulator, `make test` checks it; `make test-all` also checks the products around it.

SHELL := /bin/bash
CARGO ?= cargo
RELAY = cd host-ui/relay && CARGO_TARGET_DIR=$(abspath $(or $(CARGO_TARGET_DIR),target)) $(CARGO)
BIN := $(or $(CARGO_TARGET_DIR),target)/quick
SIMULATOR = --bin rt-core --bin stylet-bridge --bin host-ui
PRODUCTS = --bin stylet-lab --bin stylet-study --bin stylet-clinic --bin stylet-igtl --bin stylet-demo
# In the packages, not in what is built to develop: decoders of JPEG, JPEG-LS and JPEG 2000; screen readers.
COMPRESSED = --features stylet-files/compressed
PACKAGED = $(COMPRESSED) --features host-ui/screen-reader
SHIPPED := $(or $(CARGO_TARGET_DIR),target)/release

.PHONY: wasm-test animation attributes second-reader deny loom wall senders floods hostile compensation envelope procedure-test live live-test help run test test-all build products build-release reproducible sbom libraries package package-test picture example report seeds-oracle population validation causes ratios igtl-test relay relay-class relay-faults relay-fuzz relay-test fuzz soak force-pictures python python-beside python-test web web-test clean book deps-run deps-package deps-package-test deps-soak deps-test

help: ## List the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/'

run: deps-run build ## Build, start rt-core and open the window; without a display, run the procedure without a window
	@setpriv --pdeathsig TERM docs/tools/run "$(BIN)"

build: ## Build the simulator: force process, bridge, window
	$(CARGO) build --profile quick $(SIMULATOR)

products: build ## Build what `rt-core latency`, `host-ui dose` and the other commands on files and measurements need
	$(CARGO) build --profile quick --workspace $(PRODUCTS)

# Tests of what runs in real time run one at a time.
RUNNER = --config 'target."cfg(all())".runner=["$(abspath docs/tools/test-program)"]'
# The workspace without the simulator's packages, which `make test` has tested.
REST = --workspace $(shell $(CARGO) metadata --no-deps --format-version 1 | python3 -c 'import json, sys; all = json.load(sys.stdin); \
    print(*("--exclude " + p["name"] for p in all["packages"] if p["id"] in all["workspace_default_members"]))')

test: deps-test products ## Install what the tests need, test the simulator, and use each product once
	$(CARGO) test --profile quick $(RUNNER)

test-all: test ## Then test the products, and the programs with whole processes, windows and other programs' files
	$(CARGO) build --profile quick $(REST) --all-targets
	$(CARGO) test --profile quick $(REST) $(RUNNER)
	$(CARGO) test --profile quick -p stylet-files --lib $(COMPRESSED) -- compressed::

# No path of the builder goes into the programs: the same sources give the same bytes in any folder.
REMAPPED = CFLAGS="-ffile-prefix-map=$(CARGO_FOLDER)=/cargo" \
    RUSTFLAGS="--remap-path-prefix=$(CURDIR)=/stylet --remap-path-prefix=$(CARGO_FOLDER)=/cargo"
CARGO_FOLDER = $(or $(CARGO_HOME),$(HOME)/.cargo)

build-release: ## Build the programs as the packages hold them, with every dependency optimised
	$(REMAPPED) $(CARGO) build --release --locked --workspace $(SIMULATOR) $(PRODUCTS) $(PACKAGED)

reproducible: ## Build the last commit twice in folders of other names, and compare the programs byte by byte (some 30 minutes)
	docs/tools/reproducible

sbom: ## Write the software bill of materials of each program (CycloneDX 1.5), into target/package
	docs/tools/sbom

package: deps-package build-release ## Build the Debian packages of both programs, into target/package
	docs/tools/package "$(SHIPPED)"

package-test: deps-package-test package ## Install both packages in a fresh Debian root, run them, purge them, list what remains
	docs/tools/package-test

picture: deps-test build ## Redraw the kept pictures of the window, and in real time those of the README and the tour
	UPDATE_SNAPSHOTS=1 $(CARGO) test --profile quick -p stylet-tests-window -- --test-threads=1
	STYLET_TOUR=1 $(CARGO) test --profile quick -p stylet-tests-window -- --test-threads=1 live:: states:: plan:: probe:: update::
	STYLET_TOUR=1 $(CARGO) test --profile quick -p stylet-tests-window -- --test-threads=1 --ignored a_seed_is_dropped_in_the_pelvis an_update_on_the_live_picture

animation: deps-test ## Redraw the moving picture of the README from the recorded example (some minutes)
	$(CARGO) test --profile quick -p stylet-tests-window --lib animation -- --ignored --nocapture

example: build ## Record the example session of the window again
	docs/tools/example "$(BIN)"

report: ## Measure speed against error of every tissue model; writes benches/runs/<date>-<host> (some minutes)
	$(CARGO) run --release -p stylet-benches --bin report

seeds-oracle: ## Compare seeds, forces and motion of the gland with tests/oracles/seeds_at_rest.py in every case of docs/physics/needle-line.md
	$(CARGO) test --profile quick -p stylet-runtime --lib by_another_method -- --ignored --nocapture

WASM = $(abspath $(or $(CARGO_TARGET_DIR),target))/web

wasm-test: ## Repeat a flight recording (FLIGHT=FILE), or measure a tick, as the page's wasm by node and natively
	@docs/tools/need cargo nodejs
	[ -d "$$(rustc --print sysroot)/lib/rustlib/wasm32-unknown-unknown" ] || rustup target add wasm32-unknown-unknown
	RUSTFLAGS="-C target-feature=+simd128" CARGO_TARGET_DIR="$(WASM)" $(CARGO) rustc --profile quick --target wasm32-unknown-unknown -p stylet-tests-wasm --lib --crate-type cdylib
	node tests/wasm/run.mjs "$(WASM)/wasm32-unknown-unknown/quick/stylet_tests_wasm.wasm" $(FLIGHT)
	$(CARGO) run --profile quick -p stylet-tests-wasm -- $(FLIGHT)

causes: ## Inject ten causes of late ticks into measurements, and see which of them the trace names (as root, about a minute)
	$(CARGO) build --profile quick --workspace --bin rt-core --bin stylet-bridge --bin stylet-lab
	$(CARGO) test --profile quick -p stylet-tests-lab -- eight_of_ten without_a_trace --ignored --nocapture --test-threads=1

ratios: build-release ## Measure the force loop beside cyclictest in alternating rounds and print the ratios, RATIOS_SECONDS (30) each (as root, quiet machine)
	@docs/tools/need rt-tests python3
	docs/tools/ratios "$(SHIPPED)"

procedure-test: deps-test build ## Drive a whole procedure with probe, contour, update of the plan and debrief through the window (three minutes)
	$(CARGO) test --profile quick -p stylet-tests-window --lib update:: -- --ignored --nocapture

igtl-test: deps-test products ## Compare OpenIGTLink with libOpenIGTLink and pyigtl, show a core with Slicer's nodes, then serve IGTL_SECONDS (600) beside clients that hang (11 minutes)
	@docs/tools/need g++ libopenigtlink-dev python3-venv
	python3 -m venv $(BIN)/pyigtl && $(BIN)/pyigtl/bin/pip install -q pyigtl==0.3.4 slicer-core==5.13.31053.0
	$(CARGO) test --profile quick -p stylet-igtl --lib library -- --ignored --nocapture
	STYLET_PYIGTL=$(abspath $(BIN))/pyigtl/bin/python STYLET_IGTL_S=10 $(CARGO) test --profile quick -p stylet-tests --test system igtl_python -- --ignored --nocapture --test-threads=1
	STYLET_IGTL_S=$(or $(IGTL_SECONDS),600) $(CARGO) test --profile quick -p stylet-tests --test system igtl::clients_that_hang -- --nocapture

senders: deps-test products ## End what moves the hand in each way, SENDERS_TRIALS (50) times each: procedure, OpenIGTLink, window, gamepad (two hours)
	SENDERS_TRIALS=$(or $(SENDERS_TRIALS),50) $(CARGO) test --profile quick -p stylet-tests --test system motion_sender:: -- --nocapture --test-threads=1
	SENDERS_TRIALS=$(or $(SENDERS_TRIALS),50) $(CARGO) test --profile quick -p stylet-tests-window --lib senders:: -- --include-ignored --nocapture --test-threads=1

floods: build ## Stop and release under three floods of requests, FLOODS_STOPS (1000) times each (three minutes)
	FLOODS_STOPS=$(or $(FLOODS_STOPS),1000) $(CARGO) test --profile quick -p stylet-tests --test system floods::a_stop -- --include-ignored --nocapture --test-threads=1

hostile: products ## Send what is valid, stale and broken to a core and its OpenIGTLink for HOSTILE_SECONDS (600), by HOSTILE_SEED (1)
	HOSTILE_SECONDS=$(or $(HOSTILE_SECONDS),600) HOSTILE_SEED=$(or $(HOSTILE_SEED),1) $(CARGO) test --profile quick -p stylet-tests --test system hostile:: -- --nocapture --test-threads=1

wall: build ## Damage what hosts share with WALL_SEEDS (50) seeds of each kind, kill and stop the bridge WALL_ROUNDS (100) times (about an hour)
	STYLET_WILD_SEEDS=$(or $(WALL_SEEDS),50) STYLET_WILD_FILES=$(or $(WALL_SEEDS),50) STYLET_BRIDGE_ROUNDS=$(or $(WALL_ROUNDS),100) $(CARGO) test --profile quick -p stylet-tests --test system wall -- --nocapture --test-threads=1
	STYLET_BRIDGE_FORCE_ROUNDS=10 $(CARGO) test --profile quick -p stylet-tests --test system bridge_force:: -- --ignored --nocapture --test-threads=1

loom: ## Try every order in which the force process and its bridge can meet on a board (some minutes)
	cd shm-schema/wall/loom && RUSTFLAGS="--cfg loom" $(CARGO) test --release --target-dir $(abspath $(BIN))/../loom

relay: ## Build the relay, which carries a core to other machines; the other targets neither need nor build it
	$(RELAY) build --profile quick --bin relay

population: products ## Insert the 10,016 needles of docs/study/population.toml, and make the page of where seeds rest (an hour)
	$(BIN)/rt-core study docs/study/population.toml --out $(BIN)/population
	$(BIN)/host-ui study $(BIN)/population

validation: ## Compute what docs/validation.md compares with patients, by friction as well, and the error of one seed, and write that page (some ten minutes)
	UPDATE_DOCS=1 $(CARGO) test --profile quick -p stylet-study --lib validation_is_written -- --ignored --nocapture

relay-test: deps-test build ## Test the relay with whole processes (about three minutes)
	$(RELAY) test --profile quick -- --test-threads=1

relay-class: deps-test build ## Measure the relay over a line of 100 Mbit/s and with 20 observers in network namespaces (as root, two minutes)
	@docs/tools/need iproute2
	$(RELAY) test --profile quick --test system -- --test-threads=1 --nocapture --ignored line

relay-faults: deps-test build ## Stop, kill and cut off server, observer and operator, 100 times each in an insertion (some 20 minutes)
	export STYLET_RELAY_FAULTS=100; $(RELAY) test --profile quick --test system -- --test-threads=1 --nocapture faults

compensation: deps-test build ## Compensate every needle of every plan of docs/compensation.md, and write that page (four minutes)
	UPDATE_DOCS=1 $(CARGO) test --profile quick --workspace --test system -- --ignored --nocapture compensation_of_every

envelope: deps-test ## Hold needles on lines with every hand over links of every lateness (20 minutes)
	$(CARGO) test --profile quick --workspace --lib -- --ignored --nocapture no_hand_sings_on_a_line_at_any

live: ## Build stylet-live, which 'host-ui record --live' needs to serve Foxglove's app; the other targets neither need nor build it
	cd host-ui/live && CARGO_TARGET_DIR=$(abspath $(BIN))/../live $(CARGO) build --release
	cp $(BIN)/../live/release/stylet-live $(BIN)/

live-test: build live ## Watch 'host-ui record --live' for LIVE_SECONDS (60) with a client of Foxglove's protocol, beside one that hangs
	@docs/tools/need python3-venv
	python3 -m venv $(BIN)/live-client && $(BIN)/live-client/bin/pip install -q websockets==17.4
	docs/tools/live-test "$(BIN)" $(BIN)/live-client/bin/python $(or $(LIVE_SECONDS),60)

libraries: ## Package stylet-sim, stylet-dose and what they need, and build a program outside of the workspace from the packages (minutes)
	docs/tools/libraries $(abspath $(BIN))/../libraries

# In a target folder of its own: other features of what both build would build it twice.
PYTHON = $(abspath $(BIN)/../python)
WHEELS = $(abspath $(or $(CARGO_TARGET_DIR),target))/package

python: ## Build the Python package, a wheel for Python 3.9 or newer, into target/package (some minutes)
	@docs/tools/need cargo python3-venv
	python3 -m venv $(PYTHON)/maturin && $(PYTHON)/maturin/bin/pip install -q maturin==1.16.0
	cd rt-core/python && CARGO_TARGET_DIR=$(PYTHON) $(PYTHON)/maturin/bin/maturin build --release --locked --out $(WHEELS)

python-test: python products ## Install the wheel in a fresh environment, compare it with the same in Rust, the programs and other packages, and run the notebooks (some minutes)
	python3 -m venv --clear $(PYTHON)/test
	$(PYTHON)/test/bin/pip install -q -r rt-core/python/tests/requirements.txt
	$(PYTHON)/test/bin/pip install -q --no-deps $(WHEELS)/stylet-*.whl
	cd rt-core/python && CARGO_TARGET_DIR=$(PYTHON) $(CARGO) run --quiet --release --locked --example steps >$(PYTHON)/steps
	cd rt-core/python && STYLET_STEPS=$(PYTHON)/steps STYLET_PROGRAMS=$(abspath $(BIN)) $(PYTHON)/test/bin/python -m pytest -s

python-beside: python ## Compute twenty implants also by dicompyler-core, pymedphys and, with PYTG43=FOLDER, pyTG43, and write docs/measurements.md (minutes)
	python3 -m venv --clear $(PYTHON)/beside
	$(PYTHON)/beside/bin/pip install -q -r rt-core/python/tests/requirements.txt terminaltables xlrd
	$(PYTHON)/beside/bin/pip install -q --no-deps $(WHEELS)/stylet-*.whl
	UPDATE_DOCS=1 $(PYTHON)/beside/bin/python rt-core/python/tests/beside.py

# A folder that any static server can serve.
SITE = $(abspath $(or $(CARGO_TARGET_DIR),target))/web-site

web: ## Build the window and a core for a browser, into target/web-site (some minutes)
	@docs/tools/need cargo brotli clang llvm
	docs/tools/web $(SITE)

web-test: web products ## Implant five seeds in headless Chromium, in three sizes, and compare with host-ui procedure
	@docs/tools/need chromium python3-venv
	python3 -m venv $(SITE)-test && $(SITE)-test/bin/pip install -q playwright==1.63.0
	$(SITE)-test/bin/python host-ui/web/check.py $(SITE) $(abspath $(BIN)) host-ui/example/insertion.mcap $(SITE)-test/pictures

attributes: ## Read 10,000 objects of each kind with damaged attributes; a wrong figure without a note fails
	STYLET_ATTRIBUTES=$(or $(OBJECTS),10000) $(CARGO) test --profile quick -p stylet-files --lib damaged_attributes -- --nocapture

second-reader: ## Compare what Stylet reads with pydicom, ITK, dcmtk, nibabel, highdicom and dicompyler on 265 generated objects (about 15 minutes), then time them
	@docs/tools/need dcmtk dicom3tools python3-venv time
	$(CARGO) build --profile quick --workspace --bin host-ui --bin stylet-clinic $(COMPRESSED)
	python3 -m venv $(BIN)/second-reader && $(BIN)/second-reader/bin/pip install -q -r tests/oracles/clinic/requirements.txt
	$(BIN)/second-reader/bin/python tests/oracles/clinic/run.py $(BIN)/host-ui $(BIN)/second-reader/objects
	$(BIN)/second-reader/bin/python tests/oracles/clinic/times.py $(BIN)/host-ui $(BIN)/second-reader/times

fuzz: ## Fuzz each file reader for FUZZ_SECONDS (600) seconds
	docs/tools/fuzz

deny: ## Check licences, sources, bans and advisories of what the programs are built from
	docs/tools/deny --install

relay-fuzz: ## Fuzz what the relay takes from the net for FUZZ_SECONDS (600) seconds
	docs/tools/fuzz wire

soak: deps-soak build ## Measure the memory of the window during SOAK_SECONDS (3600) of procedures, on a virtual screen
	docs/tools/soak "$(BIN)" $(SOAK_SECONDS)

force-pictures: ## Measure the stiffness that the force loop holds, and redraw the pictures of force
	$(CARGO) bench -p stylet-benches --bench force

book: ## Make a site of docs/ in target/book; installs mdbook with cargo if it is missing
	@command -v mdbook >/dev/null || $(CARGO) install mdbook --locked
	PATH="$$PATH:$${CARGO_HOME:-$$HOME/.cargo}/bin" mdbook build docs

clean: ## Remove the build output
	$(CARGO) clean

deps-run:
	@docs/tools/need cargo libxkbcommon-x11-0 mesa-vulkan-drivers

deps-package:
	@docs/tools/need cargo binutils

deps-package-test:
	@docs/tools/need debootstrap desktop-file-utils mandoc python3 xvfb

deps-soak:
	@docs/tools/need cargo libxkbcommon-x11-0 mesa-vulkan-drivers xauth xvfb

deps-test:
	@docs/tools/need cargo libxkbcommon-x11-0 mesa-vulkan-drivers mandoc python3-nibabel python3-pydicom xvfb
