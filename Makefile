# Two commands do everything on a fresh machine: `make demo` and `make test`. Each makes its own virtual environment.

PYTHON ?= python3
# Processes that run tests and decode vectors; 0 for none but their own.
JOBS ?= 2
# What is run once more as plain Python: arguments of pytest.
PLAIN ?= tests/kernel/test_determinism.py
VECTORS ?= conformance/vectors
# Minutes that the decoder is fuzzed for, and then the encoder.
MINUTES ?= 5
# Commit since which heavy tests are run of what has changed; the last merge if not given.
SINCE ?=
# Arguments of the tool for slips, for example SLIPS="--rooms stream tiles".
SLIPS ?=
# Arguments of the speed measurement, for example BENCH="terrain.npy:500.5 --json".
BENCH ?=

# Tables that growth is measured in, and other arguments, for example GROWTH="length --most 1e7".
GROWTH ?=

# Debian's packages of the programs in which plugins are tested.
PROGRAMS ?= gdal-bin qgis python3-qgis paraview python3-paraview xvfb blender python3-fsspec python3-aiohttp

PLATFORMS ?= linux-x86_64 linux-aarch64 macos-aarch64 macos-x86_64 windows-x86_64

DOCS_PYTHON := .venv-docs/bin/python
SUDO := $(if $(filter 0,$(shell id -u)),,sudo)
DEMO_PYTHON := .venv-demo/bin/python
TEST_PYTHON := .venv-test/bin/python

.DEFAULT_GOAL := help
.PHONY: help kernels wheels demo docs test test-web view heavy heavy-changed apps slips lint bench growth vectors zoo fuzz clean

help: ## Show this list.
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 10

kernels: ## Compile the kernels, unless that has been done before.
	$(PYTHON) tools/kernels

wheels: ## Wheels for all platforms, in dist/; with the viewer, where node and npm can be had.
	$(PYTHON) tools/test_web.py --viewer
	for platform in $(PLATFORMS); do \
	  $(PYTHON) tools/kernels --target $$platform --out build/$$platform && \
	  ISOCODEC_WHEEL=$$platform $(PYTHON) -m pip wheel --quiet --no-deps --wheel-dir dist . || exit 1; \
	done

demo: kernels .venv-demo/.installed ## Encode and decode the shipped data; tables here, pictures and files in demo/out/.
	$(DEMO_PYTHON) tools/demo.py

docs: export NO_MKDOCS_2_WARNING = 1
docs: .venv-docs/.installed ## Build the documentation in build/site, all links checked.
	$(DOCS_PYTHON) -m mkdocs build --quiet --strict --config-file docs/site/mkdocs.yml

test: kernels .venv-test/.installed ## Run the tests, some of them again as plain Python, and the conformance vectors.
	$(TEST_PYTHON) -m pytest -n $(JOBS) tests
	ISOCODEC_KERNELS=python $(TEST_PYTHON) -m pytest $(PLAIN)
	$(TEST_PYTHON) -m isoconform run --layers --jobs $(JOBS) --vectors $(VECTORS)

test-web: ## Build the npm package and run its tests, where node and npm can be had; says so if not.
	$(PYTHON) tools/test_web.py

view: ## Build the viewer and serve it at http://localhost:8137/.
	$(PYTHON) tools/test_web.py --viewer
	$(PYTHON) -m http.server --directory build/viewer --bind localhost 8137

heavy: export ISOCODEC_HEAVY = 1
heavy: kernels .venv-test/.installed ## Run all tests, those that take long too, with all of their examples.
	$(TEST_PYTHON) -m pytest -n $(JOBS) -m 'not apps' tests

heavy-changed: kernels .venv-test/.installed ## Run the heavy tests of figures, packaging, zoo and others whose sources have changed.
	$(TEST_PYTHON) tools/heavy_changed.py $(SINCE)

apps: kernels .venv-test/.installed .venv-apps/.installed ## Install GDAL, QGIS, ParaView, Blender and napari (Debian's packages), and test the plugins in them.
	dpkg --status $(PROGRAMS) >/dev/null 2>&1 || { $(SUDO) apt-get update && $(SUDO) apt-get install --yes --no-install-recommends $(PROGRAMS); }
	$(TEST_PYTHON) -m pytest -m apps tests/apps

slips: kernels .venv-test/.installed ## Plant slips in a copy of the package, and count those that the tests catch; takes an hour.
	$(TEST_PYTHON) tools/slips.py $(SLIPS)

lint: .venv-test/.installed ## Run ruff and mypy.
	.venv-test/bin/ruff check .
	.venv-test/bin/mypy

bench: kernels .venv-test/.installed ## Measure speed, first use and memory, beside what a user would pick instead.
	$(TEST_PYTHON) tools/bench_speed.py $(BENCH)

growth: kernels .venv-test/.installed ## Measure how time and memory grow with sizes; a plot in build/growth.png.
	mkdir -p build
	$(TEST_PYTHON) tools/growth.py --plot build/growth.png $(GROWTH)

vectors: kernels .venv-test/.installed ## Write the conformance vectors anew.
	$(TEST_PYTHON) -m isoconform generate $(VECTORS)

zoo: kernels .venv-test/.installed ## Plant wrong decoders and see that their vectors catch them.
	$(TEST_PYTHON) conformance/zoo --jobs $(JOBS)

fuzz: export ISOCODEC_KERNELS = checked
fuzz: .venv-test/.installed ## Fuzz the decoder, then the encoder, for MINUTES=5 each, all indices checked; findings in fuzz-out/.
	$(PYTHON) tools/kernels --checked
	$(TEST_PYTHON) -m isoconform fuzz --minutes $(MINUTES) --out fuzz-out
	$(TEST_PYTHON) -m isoconform fuzz --minutes $(MINUTES) --encoder

clean: ## Remove everything that make has made; builds that are kept elsewhere stay, see docs/kernels.md.
	rm -rf .venv-apps .venv-build .venv-demo .venv-docs .venv-test codec/isocodec/kernel/built demo/out fuzz-out .pytest_cache .mypy_cache .ruff_cache .hypothesis build dist codec/js/dist codec/js/node_modules
	find codec spec conformance tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

.venv-apps/.installed: EXTRA = apps
.venv-demo/.installed: EXTRA = demo
.venv-docs/.installed: EXTRA = docs
.venv-test/.installed: EXTRA = dev
.venv-apps/.installed .venv-demo/.installed .venv-docs/.installed .venv-test/.installed: pyproject.toml | kernels
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python -m pip install --disable-pip-version-check --quiet --no-compile --editable '.[$(EXTRA)]'
	touch $@
