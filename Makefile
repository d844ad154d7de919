# Two commands do everything on a fresh machine: `make demo` and `make test`. Each makes its own virtual environment.

PYTHON ?= python3
# Processes that pytest runs tests in; 0 for none but its own.
JOBS ?= 2
# What is run once more without compilation: arguments of pytest.
NOJIT ?= tests/test_determinism.py
VECTORS ?= conformance/vectors
# Minutes that the decoder is fuzzed for, and then the encoder.
MINUTES ?= 5
# Arguments of the speed measurement, for example BENCH="terrain.npy:500.5 --json".
BENCH ?=

DEMO_PYTHON := .venv-demo/bin/python
TEST_PYTHON := .venv-test/bin/python

.DEFAULT_GOAL := help
.PHONY: help demo test lint bench vectors zoo fuzz clean

help: ## Show this list.
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 10

demo: .venv-demo/.installed ## Encode and decode the shipped data; tables here, pictures and files in demo/out/.
	$(DEMO_PYTHON) tools/demo.py

test: .venv-test/.installed ## Run the tests, some of them again without compilation, and the conformance vectors.
	$(TEST_PYTHON) -m pytest -n $(JOBS) tests
	NUMBA_DISABLE_JIT=1 $(TEST_PYTHON) -m pytest $(NOJIT)
	$(TEST_PYTHON) -m isoconform run --layers --vectors $(VECTORS)

lint: .venv-test/.installed ## Run ruff and mypy.
	.venv-test/bin/ruff check .
	.venv-test/bin/mypy

bench: .venv-test/.installed ## Measure speed, first use and memory.
	$(TEST_PYTHON) tools/bench_speed.py $(BENCH)

vectors: .venv-test/.installed ## Write the conformance vectors anew.
	$(TEST_PYTHON) -m isoconform generate $(VECTORS)

zoo: .venv-test/.installed ## Plant wrong decoders and see that their vectors catch them.
	$(TEST_PYTHON) conformance/zoo --jobs $(JOBS)

fuzz: .venv-test/.installed ## Fuzz the decoder, then the encoder, for MINUTES=5 each; findings in fuzz-out/.
	$(TEST_PYTHON) -m isoconform fuzz --minutes $(MINUTES) --out fuzz-out
	$(TEST_PYTHON) -m isoconform fuzz --minutes $(MINUTES) --encoder

clean: ## Remove everything that make has made.
	rm -rf .venv-demo .venv-test demo/out fuzz-out .pytest_cache .mypy_cache .ruff_cache .hypothesis build dist
	find codec spec conformance tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

# The demonstration compares with scikit-image, which only the development extra brings.
.venv-demo/.installed .venv-test/.installed: pyproject.toml
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python -m pip install --disable-pip-version-check --quiet --editable '.[dev]'
	touch $@
