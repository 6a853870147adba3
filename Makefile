# Everything runs in .venv; the first target that needs it makes it.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
DOCS_STAMP := .venv/.installed-docs
MUTANTS_STAMP := .venv/.installed-mutants
export MUJOCO_GL ?= egl

.PHONY: setup demo test test-slow check mutants bench figures paper docs assets clean

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
	$(BIN)/python -m tools.licenses

# Break the code in small ways and count what no test notices; goes on where it was stopped. AGAIN=1: survivors
# alone; SHARE=0.3: a sample.
mutants: $(MUTANTS_STAMP)
	OMP_NUM_THREADS=1 nice -n 15 $(BIN)/python -m benchmarks.mutants $(if $(AGAIN),--again) $(if $(SHARE),--share $(SHARE))

$(MUTANTS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[mutants]"
	@touch $@

# All benchmarks, then the tables of README and docs; QUICK=1: small sizes, into benchmarks/results/quick.
bench: setup
	$(BIN)/python -m benchmarks $(if $(QUICK),--quick)

# The tables of README and docs from the results that there are.
figures: setup
	$(BIN)/python -m benchmarks.table

paper: setup
	$(BIN)/symbrion paper --out paper

# The documentation as a site: site/index.html.
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[docs]"
	@touch $@

# Remake the ready-made arenas that the package ships (see assets/README.md).
assets: setup
	$(BIN)/symbrion assets --out assets/arenas

clean:
	rm -rf .venv demo paper site build dist mutants
