# Viscera: every everyday command. `make` alone lists them.
#
# The extension and the Rust tests share one profile and one set of features, so the dependencies compile once.
# Clippy has a folder of its own: the environment that maturin gives pyo3 would make the two undo each other's work.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
CARGO  := cargo

core_sources := Cargo.toml Cargo.lock $(shell find core crates live mesher bindings/python -name '*.rs' -o -name Cargo.toml)
extension    := python/viscera/_core.abi3.so
c_tests      := tests/c
PREFIX       ?= /usr/local

# The C library: what it is linked to, its names, and what is taken out of the static one.
c_folder     := target/c
c_version    := $(shell sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml)
c_major      := $(firstword $(subst ., ,$(c_version)))
ifeq ($(shell uname),Darwin)
c_system     := -lSystem -lm
c_shared     := libviscera.$(c_version).dylib libviscera.$(c_major).dylib libviscera.dylib
c_strip       = strip -S $(1) -o $(2)
c_strip_all   = strip -x $(1) -o $(2)
else
c_system     := -lgcc_s -lutil -lrt -lpthread -lm -ldl -lc
c_shared     := libviscera.so.$(c_version) libviscera.so.$(c_major) libviscera.so
c_strip       = objcopy --strip-debug --remove-section=.llvmbc --remove-section=.llvmcmd $(1) $(2)
c_strip_all   = objcopy --strip-all $(1) $(2)
endif
c_link       := $(lastword $(c_shared))
c_hands      := $(c_shared:libviscera.%=libviscera_hands.%)
c_packages   := viscera.pc viscera_hands.pc VisceraConfig.cmake VisceraConfigVersion.cmake

# What GPU=1 adds: the library that the solver "gpu" loads. What is built and tested every day has no wgpu in it.
gpu_name     := $(if $(filter Darwin,$(shell uname)),libviscera_gpu.dylib,libviscera_gpu.so)
gpu_library  := python/viscera/$(gpu_name)
gpu_sources  := gpu/Cargo.toml gpu/Cargo.lock $(shell find gpu/src crates/device -type f)
cargo_gpu    := --release --quiet --manifest-path gpu/Cargo.toml
# The package, and what tests and documents it.
development  := $(extension) $(VENV)/development
vulkan       := /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json

# What is watched runs fast enough with little optimisation, and instrumented dependencies compile for ever with more.
# Nothing may ask for 128 MiB at once; each thread that factorises keeps a pool of 64.
fuzz_profile   := CARGO_PROFILE_RELEASE_OPT_LEVEL=1 CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16
FUZZ_SECONDS   ?= 60
HAPTIC_SECONDS ?= 600

# Processes that share the tests in Python, file by file.
WORKERS ?= 2

# Python compiles a module where it is first imported: pip takes half the time without compiling those that nobody needs.
export PIP_COMPILE := 0

# The viewer's page is a build product inside the package; without Node everything else still builds and tests.
page         := python/viscera/viewer/static/viewer.js
page_sources := $(shell find viewer/src viewer/public -type f) viewer/package-lock.json viewer/vite.config.ts viewer/tsconfig.json
evaluator    := viewer/wasm/evaluator.wasm
stepper      := viewer/wasm/stepper.wasm
page_stepper := $(dir $(page))stepper.wasm
node_page    := $(if $(shell command -v npm),$(page))
node_viewer  := $(if $(shell command -v npm),$(page_stepper))

browsers     := chromium-headless-shell chromium chromium-browser google-chrome
debian       := sh -c 'root=$$(test $$(id -u) = 0 || echo sudo); $$root apt-get update -q && $$root apt-get install -qy --no-install-recommends "$$@"' install

# Targets one after the other, then how long each took.
stages = @times=; for stage in $(1); do \
	began=$$(date +%s); $(MAKE) --no-print-directory $$stage || exit; \
	times="$$times$$(printf '%-13s %5d s' $$stage $$(($$(date +%s) - began)))\n"; done; printf "$$times"

.DEFAULT_GOAL := help
.PHONY: help setup package demo test lint format test-core test-c test-python test-web sanitize fuzz viewer c-library install-c
.PHONY: test-gpu test-gpu-if-any docs gallery bench bench-gpu bench-laws bench-haptic studies study-trust study-touches study-reduced study-soak study-contact study-calculix study-probe study-registration study-meshing study-solvers pages check-pages pictures clean
.PHONY: reduced-liver build-times stage-times compare wheel

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# Side by side: most of the time either compiler is busy with one crate, on one core.
setup: ## make .venv with everything in it, with GPU=1 the solver "gpu"; quick when nothing changed
	$(MAKE) --jobs=2 $(development) $(node_viewer) $(if $(GPU),$(gpu_library))

# No tools of development, and no solvers in the page.
package: ## make .venv and build into it what the demo and the viewer of its model need
	$(MAKE) --jobs=2 $(extension) $(node_page)

demo: ## reduce the built-in liver, check it against Newton, draw it; results in out/
	$(call stages,package reduced-liver)

reduced-liver: $(extension)
	$(BIN)/viscera demo --no-view --output out

test: ## everything that must be green
	$(call stages,setup lint docs test-core test-c test-python test-web test-gpu-if-any)

lint: $(development) $(VENV)/rust-tools ## formatting, clippy and ruff without warnings, types
	$(CARGO) fmt --all --check
	$(CARGO) fmt --manifest-path gpu/Cargo.toml --check
	$(CARGO) clippy --target-dir target/lint --workspace --all-targets -- -D warnings
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: $(VENV)/development $(VENV)/rust-tools ## put every file in its standard form
	$(CARGO) fmt --all
	$(CARGO) fmt --manifest-path gpu/Cargo.toml
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

test-core: ## the Rust tests
	$(CARGO) test --release --workspace --quiet

test-c: $(development) c-library $(VENV)/cmake ## the C library: programs in C and C++ against Python
	$(BIN)/pytest --numprocesses=$(WORKERS) --dist=loadfile $(c_tests)

test-python: $(development) $(node_viewer) ## the Python tests and doctests
	$(BIN)/pytest --numprocesses=$(WORKERS) --dist=loadfile --ignore=$(c_tests) --ignore=tests/web

test-web: $(development) $(page_stepper) $(VENV)/chromium ## the viewer in a real browser, against Python
	$(BIN)/pytest --numprocesses=$(WORKERS) --dist=loadfile tests/web

viewer: $(page_stepper) ## the viewer's page: evaluator to WebAssembly, TypeScript to one module

# Mesa's drivers make a Vulkan device of the processor: no measure of speed, and the same answers.
test-gpu: $(VENV)/vulkan $(development) $(gpu_library) ## kernels and solver on this machine's graphics processor, or on software in its place
	$(CARGO) clippy $(cargo_gpu) --target-dir target/lint --all-targets -- -D warnings
	VISCERA_GPU=required $(CARGO) test $(cargo_gpu) --target-dir target
	VISCERA_GPU=required $(BIN)/pytest --numprocesses=$(WORKERS) --dist=loadfile tests/gpu

test-gpu-if-any:
	if ls $(vulkan) 2>/dev/null | grep -q json; then $(MAKE) test-gpu; else \
		echo '*** NOT TESTED: the graphics processor. This machine has no Vulkan driver; make test-gpu installs one in software. ***'; fi

bench-gpu: $(development) $(gpu_library) ## kernels, frames and solutions on the graphics processor, for docs/gpu.md; only what a real device prints is kept
	$(CARGO) run $(cargo_gpu) --target-dir target --example bench
	$(BIN)/python benchmarks/gpu.py
	$(BIN)/python benchmarks/gpu_accuracy.py
	$(BIN)/python benchmarks/gpu_reduce.py

sanitize: $(development) c-library ## the C programs under address, undefined behaviour and thread sanitizers
	$(BIN)/pytest $(c_tests) -k sanitizers

fuzz: ## files, touches and requests that bring evaluator or stepper down, FUZZ_SECONDS for each target; needs nightly Rust
	$(CARGO) fuzz --version || $(CARGO) install cargo-fuzz --locked
	for target in file edits case requests; do \
		mkdir -p out/fuzz/$$target && $(fuzz_profile) $(CARGO) +nightly fuzz run --target-dir target/fuzz --features libfuzzer \
			$$target out/fuzz/$$target fuzz/corpus/$$target -- \
			-max_total_time=$(FUZZ_SECONDS) -malloc_limit_mb=128 -artifact_prefix=out/fuzz/ || exit; done

# The library with solvers shares the crates that everything else has compiled: made small like the other, it would take
# minutes, and it is loaded once.
c-library: ## the C libraries for haptic loops, with what pkg-config and CMake read, in target/c
	$(CARGO) build --profile library --package viscera-c --no-default-features
	$(CARGO) build --release --package viscera-c
	install -d $(c_folder)
	install -m 644 target/library/$(c_link) $(c_folder)/$(firstword $(c_shared))
	$(call c_strip_all,target/release/$(c_link),$(c_folder)/$(firstword $(c_hands)))
	for names in "$(c_shared)" "$(c_hands)"; do set -- $$names; \
		ln -sf $$1 $(c_folder)/$$2 && ln -sf $$2 $(c_folder)/$$3 || exit; done
	$(call c_strip,target/library/libviscera.a,$(c_folder)/libviscera.a)
	for package in $(c_packages); do \
		sed -e 's|@PREFIX@|$(PREFIX)|' -e 's|@PRIVATE@|$(c_system)|' -e 's|@VERSION@|$(c_version)|' -e 's|@MAJOR@|$(c_major)|' \
			-e 's|@SHARED@|$(word 1,$(c_shared))|' -e 's|@SONAME@|$(word 2,$(c_shared))|' \
			-e 's|@HANDS@|$(word 1,$(c_hands))|' -e 's|@HANDS_SONAME@|$(word 2,$(c_hands))|' \
			bindings/c/packages/$$package.in > $(c_folder)/$$package; done

install-c: c-library ## headers and libraries for C, and what pkg-config and CMake read, into PREFIX
	install -d $(PREFIX)/include $(PREFIX)/lib/pkgconfig $(PREFIX)/lib/cmake/Viscera
	install -m 644 bindings/c/include/*.h bindings/c/include/*.hpp $(PREFIX)/include
	install -m 644 $(c_folder)/libviscera.a $(PREFIX)/lib
	cp -P $(addprefix $(c_folder)/,$(c_shared) $(c_hands)) $(PREFIX)/lib
	install -m 644 $(c_folder)/*.pc $(PREFIX)/lib/pkgconfig
	install -m 644 $(c_folder)/*.cmake $(PREFIX)/lib/cmake/Viscera

bench: $(development) c-library out/liver.viscera ## the benchmarks
	for script in benchmarks/*.py; do $(BIN)/python $$script || exit; done
	{ $(BIN)/python benchmarks/machine.py 1; $(CARGO) bench --quiet --package viscera-core --bench assembly; }
	{ $(BIN)/python benchmarks/machine.py; $(CARGO) bench --quiet --package viscera-core --bench threads; }
	{ $(BIN)/python benchmarks/machine.py 1; $(CARGO) run --quiet --release --package viscera-linear --example fronts; }
	{ $(BIN)/python benchmarks/machine.py 1; $(CARGO) test --quiet --release --package viscera-galerkin panels_beside_units -- --ignored --nocapture; }
	$(CARGO) bench --quiet --package viscera-core --bench online -- $(CURDIR)/out/liver.viscera

bench-laws: $(development) ## cost and trust of every law and element against those kept in benchmarks/results
	$(BIN)/viscera bench laws --against benchmarks/results/laws.json -o out/bench

bench-haptic: c-library out/liver.viscera ## ticks of two fingers, and HAPTIC_SECONDS of a simulated haptic device at 1 kHz; kept in benchmarks/results
	$(CC) -std=c11 -O2 -Ibindings/c/include bindings/c/device/*.c $(c_folder)/libviscera.a $(c_system) -lm -o out/haptic_loop
	$(BIN)/python benchmarks/ticks.py --write
	$(BIN)/python benchmarks/machine.py 1 > out/haptic.txt
	out/haptic_loop out/liver.viscera bindings/c/device/palpation.csv $(HAPTIC_SECONDS) >> out/haptic.txt; status=$$?; \
		{ cat out/haptic.txt; uptime | sed 's/.*load/\nload of the machine at the end,/'; } | tee benchmarks/results/haptic.txt; \
		exit $$status

wheel: $(node_viewer) ## a wheel for this platform, in out/wheel; its size is kept in benchmarks/results
	$(BIN)/maturin build --release --locked --out out/wheel
	($(BIN)/python benchmarks/machine.py && $(BIN)/python scripts/wheel_size.py out/wheel/*.whl) > out/wheel.txt
	mv out/wheel.txt benchmarks/results/wheel.txt

build-times: $(development) ## processor time of all that make compiles, from nothing; kept in benchmarks/results
	$(BIN)/python scripts/build_times.py | tee benchmarks/results/build.txt

stage-times: $(development) ## how long make demo and make test take from nothing, stage by stage; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python scripts/stage_times.py > out/stages.txt && mv out/stages.txt benchmarks/results/stages.txt

compare: $(development) ## whether this is slower than revision REV, or revision WITH is, row by row in turns
	@$(BIN)/python scripts/compare.py $(REV) $(WITH)

out/liver.viscera: | $(extension)
	$(BIN)/viscera demo --no-view --output out

studies: $(development) ## the full studies of the papers; their tables go where the pages quote them
	for name in beam liver; do \
		mkdir -p benchmarks/results/$$name && \
		$(BIN)/python benchmarks/machine.py > benchmarks/results/$$name/printed.txt && \
		$(BIN)/viscera study $$name -o out/$$name && cp out/$$name/*.csv benchmarks/results/$$name/ || exit; done

docs: $(development) ## the documentation site, in out/site; a warning is an error
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -c docs/site docs out/site

study-trust: $(development) ## what trust is worth: 6,000 touches of ten bodies, each under all laws; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/trust.py > out/trust.txt && mv out/trust.txt benchmarks/results/trust.txt

study-touches: $(development) ## touches of the full organ: how they end under each law, and which could have been solved; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/touches.py > out/touches.txt && mv out/touches.txt benchmarks/results/touches.txt

# Script and arguments of each.
reduced_depth                := depth.py 40 4
reduced_depth_order_6        := depth.py 60 6 1
reduced_deep                 := deep.py
reduced_fingers              := fingers.py P1 24 12
reduced_fingers_mean_volume  := fingers.py "P1 mean volume" 12 6
reduced_parameters           := parameters.py
reduced_offline              := offline.py --most 10000
reduced_surrogates           := surrogates.py
reduced_surrogates_liver     := surrogates.py liver anterior 1 4
reduced_studies              := depth depth_order_6 deep fingers fingers_mean_volume parameters offline surrogates surrogates_liver

study-reduced: $(reduced_studies:%=study-reduced-%) ## reduced models: against Newton, and what the off-line stage costs; kept in benchmarks/results

study-reduced-%: $(development)
	mkdir -p out
	$(BIN)/python benchmarks/$(reduced_$*) > out/$*.txt && mv out/$*.txt benchmarks/results/

study-soak: $(development) ## ten minutes of a jerky random hand; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/soak.py > out/soak.txt && mv out/soak.txt benchmarks/results/soak.txt

study-contact: $(development) ## tools and organs in contact: Hertz, what a frame costs, 100,000 frames; kept in benchmarks/results
	for name in hertz hertz_pair contact contact_soak; do $(BIN)/python benchmarks/$$name.py --write || exit; done

study-calculix: $(development) $(VENV)/calculix ## rigid tools on the liver with CalculiX; decks and forces are kept in tests/reference/data
	$(BIN)/python tests/reference/run_calculix_contact.py
	$(BIN)/python benchmarks/drag.py --write

study-probe: $(development) ## rigid probes against true contact, one and two, and what a tick costs; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/probe.py > out/probe.txt && mv out/probe.txt benchmarks/results/probe.txt
	$(BIN)/python benchmarks/probes.py > out/probes.txt && mv out/probes.txt benchmarks/results/probes.txt

study-registration: $(development) ## how well a liver is found again, over twenty truths; goes on where it was interrupted; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/registration.py > out/registration.txt && mv out/registration.txt benchmarks/results/registration.txt

study-meshing: $(development) ## meshes from label maps: angles, volumes, times; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/meshing.py > out/meshing.txt && mv out/meshing.txt benchmarks/results/meshing.txt

study-solvers: $(development) ## which linear solver wins, and what "auto" chooses; goes on where it was interrupted; kept in benchmarks/results
	mkdir -p out
	$(BIN)/python benchmarks/solvers.py > out/solvers.txt && mv out/solvers.txt benchmarks/results/solvers.txt

pages: $(development) ## run the marked programs of README and docs/, and write their real output there
	$(BIN)/python scripts/case_page.py
	$(BIN)/python scripts/pages.py

check-pages: $(development) ## compare what README and docs/ show with what their programs print, the long ones too
	$(BIN)/python scripts/pages.py --check

gallery: $(development) ## run the examples and keep their pictures for docs/
	$(BIN)/python scripts/gallery.py

pictures: $(development) $(page_stepper) $(VENV)/chromium out/liver.viscera ## photograph the viewer for docs/
	$(BIN)/python scripts/viewer_pictures.py out/liver.viscera
	$(BIN)/python scripts/moving_picture.py out/liver.viscera

# The evaluator for every page, and all solvers for one that steps a case; all browsers of the last years have these
# vector instructions. One after the other, as cargo gives both the same name.
$(evaluator) $(stepper): Cargo.toml Cargo.lock $(shell find crates bindings/wasm -name '*.rs' -o -name Cargo.toml)
$(stepper): $(core_sources) $(gpu_sources)
$(evaluator) $(stepper):
	rustup target add wasm32-unknown-unknown
	RUSTFLAGS='-C target-feature=+simd128' $(CARGO) build --profile wasm --package viscera-wasm --target wasm32-unknown-unknown \
		--no-default-features --features $(basename $(notdir $@))
	install -D -m 644 target/wasm32-unknown-unknown/wasm/viscera_wasm.wasm $@

$(stepper): $(evaluator)

$(page): $(evaluator) $(page_sources) viewer/node_modules/.package-lock.json
	npm --prefix viewer run build

# Vite empties the folder of the page.
$(page_stepper): $(stepper) $(page)
	install -m 644 $(stepper) $@

viewer/node_modules/.package-lock.json: viewer/package-lock.json
	npm --prefix viewer ci --no-audit --no-fund
	touch $@

$(VENV)/chromium: | $(VENV)/development
	for browser in $(browsers); do command -v $$browser && exit; done; \
		$(debian) chromium-headless-shell || $(debian) chromium
	touch $@

$(VENV)/calculix: | $(VENV)/development
	command -v ccx || $(debian) calculix-ccx
	touch $@

$(VENV)/cmake: | $(VENV)/development
	command -v cmake || $(debian) cmake
	touch $@

clean: ## forget .venv, build products and results
	$(CARGO) clean
	rm -rf $(VENV) out dist $(extension) $(gpu_library) $(dir $(page)) $(dir $(evaluator)) viewer/node_modules

# The first installation brings the dependencies and the `viscera` command; afterwards only the compiled core is renewed.
$(VENV)/installed: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip 'maturin>=1.9.4,<2'
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release
	touch $@

# Nothing is compiled again.
$(VENV)/development: pyproject.toml | $(extension)
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --extras cluster,dev,docs,scan
	touch $@

$(extension): $(VENV)/installed $(core_sources)
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --skip-install
	touch $@

$(gpu_library): $(gpu_sources)
	$(CARGO) build $(cargo_gpu) --target-dir target --lib
	install -m 755 target/release/$(gpu_name) $@

$(VENV)/vulkan: | $(VENV)/development
	ls $(vulkan) 2>/dev/null | grep -q json || $(debian) mesa-vulkan-drivers
	touch $@

$(VENV)/rust-tools: $(VENV)/development
	$(CARGO) fmt --version || rustup component add rustfmt
	$(CARGO) clippy --version || rustup component add clippy
	touch $@
