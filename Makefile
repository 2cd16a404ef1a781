# The commands of this repository; `make help` lists them.

.DEFAULT_GOAL := help
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

# Warnings are errors in CI only: a new compiler's new warning should stop nobody's work.
export UMBEL_WERROR ?= $(if $(CI),ON,OFF)
ifneq ($(shell command -v ccache),)
export CMAKE_CXX_COMPILER_LAUNCHER ?= ccache
endif

MESH ?=
JOBS ?= $(shell nproc 2>/dev/null || echo 2)
PYTEST_ARGS ?=
CTEST_ARGS ?=

# Everything that the installed package is made of; folders are listed for the files that leave.
PACKAGE := $(shell find CMakeLists.txt pyproject.toml LICENSE $(wildcard README.md) cmake include \
             src python -not -path '*/__pycache__*' -not -path '*/.*' 2>/dev/null)

.PHONY: help setup tools build test test-cpp test-python test-viewer test-install test-asan test-tsan \
        fuzz wasm cuda simt gpu gpu-check gpu-paths gpu-carry vulkan demo lint format bench clean

help:  ## what there is to make
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## */\t/' | expand -t 16

tools:
	@scripts/setup.sh

.venv/.installed: $(PACKAGE) scripts/requirements.txt | tools
	@scripts/install_package.sh
	@touch $@

setup: tools .venv/.installed  ## everything needed, and the command .venv/bin/umbel

build: setup  ## the library, the C++ tests and the benchmarks, in build/release
	@cmake -DUMBEL_WERROR=$(UMBEL_WERROR) build/release >build/configure.log
	@cmake --build build/release

test: test-cpp test-python test-viewer test-install  ## every test

test-cpp: build  ## the C++ tests
	@ctest --test-dir build/release --output-on-failure --no-tests=error -j $(JOBS) $(CTEST_ARGS)

test-python: setup  ## the Python tests
	@.venv/bin/python -m pytest -n $(JOBS) --dist loadfile $(PYTEST_ARGS)

test-viewer: setup  ## the web viewer's tests
	@scripts/node.sh test

test-install: build  ## projects that use Umbel by find_package and by add_subdirectory
	@scripts/test_install.sh

test-asan: sanitize-asan  ## the C++ tests under the address and undefined-behaviour sanitizers

test-tsan: sanitize-tsan  ## the C++ tests under the thread sanitizer

# GCC warns of sound code once sanitizers are in it, so warnings are no errors here.
sanitize-%: tools
	@cmake --preset $*
	@cmake --build --preset $*
	@ctest --preset $* -j $(JOBS) $(CTEST_ARGS)

fuzz: tools  ## the fuzzers, a minute each, under the sanitizers; SECONDS_EACH=900 for longer
	@scripts/fuzz.sh

wasm:  ## the viewer's decoder, compiled to WebAssembly again after it has changed
	@scripts/wasm.sh

cuda: tools  ## umbel::cuda with its tests and benchmark, in build/release; no GPU needed
	@scripts/cuda.sh

simt: tools  ## the tests of umbel::cuda on an emulated device; SEEDS=1000 for longer
	@scripts/simt.sh

gpu:  ## on a machine with a GPU: tests and measures; see scripts/gpu.sh
	@scripts/gpu.sh measure

gpu-check:  ## on a machine with a GPU: sanitizers, and arrays of Python's packages
	@scripts/gpu.sh check

gpu-paths:  ## on a machine with a GPU: pictures by path tracing; again for the scenes that are left
	@scripts/gpu.sh paths

gpu-carry: build  ## what `make gpu` needs on a machine without a network, into build/gpu-carry
	@scripts/gpu_carry.sh

vulkan: build  ## the Vulkan renderer in examples/vulkan with its tests; no GPU needed
	@scripts/vulkan.sh

demo: setup  ## a real scan to a verified LOD asset; MESH=my.glb for your own
	@.venv/bin/python scripts/demo.py $(if $(MESH),"$(MESH)")

lint: setup  ## formatting, clang-tidy (changed files; all with ALL=1), ruff, mypy, layers
	@.venv/bin/python scripts/lint.py $(if $(ALL),--all,$(if $(CI),--recent))

format: tools  ## formats the C++ and the Python
	@.venv/bin/python scripts/lint.py --fix

bench: build  ## every program in bench/ on the dragon, or on MESH=... (a binary PLY file)
	@PYTHONDONTWRITEBYTECODE=1 scripts/bench.sh $(if $(MESH),"$(MESH)")

clean:  ## removes what was built; .venv stays
	@rm -rf build .mypy_cache .ruff_cache .pytest_cache .venv/.installed
