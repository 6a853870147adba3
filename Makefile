# Everything runs in .venv; the first target that needs it makes it.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
export MUJOCO_GL ?= egl

.PHONY: setup demo test test-slow check bench paper assets clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "symbrion-gym needs Python 3.11 or newer; set PYTHON=python3.x")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	@touch $@

demo: setup
	$(BIN)/symbrion demo --out demo

test: setup
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadfile

test-slow: setup
	$(BIN)/python -m pytest -m slow

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

bench: setup
	$(BIN)/python -m benchmarks

paper: setup
	$(BIN)/symbrion paper --out paper

# Remake the ready-made arenas that the package ships (see assets/README.md).
assets: setup
	$(BIN)/symbrion assets --out assets/arenas

clean:
	rm -rf .venv demo paper build dist
