# Everything runs in .venv; the first target that needs it makes it.
PYTHON ?= python3
RUN := .venv/bin/python
INSTALL := $(RUN) -m pip install --no-compile --quiet --disable-pip-version-check -c constraints.txt

.PHONY: setup demo test test-slow check evidence release paper docs assets clean

setup: .venv/.installed

.venv/.installed: EXTRAS := dev
.venv/.demo: EXTRAS := cli,report,scan
.venv/.test: EXTRAS := test
.venv/.all: EXTRAS := dev,gpu,cluster,rl,ribs
.venv/.installed .venv/.demo .venv/.test .venv/.all: pyproject.toml constraints.txt
	test -x $(RUN) || $(PYTHON) -m venv .venv
	$(INSTALL) -e .[$(EXTRAS)]
	touch $@

# The whole pipeline on a small scale; open demo/report.html.
demo: .venv/.demo
	$(RUN) -m evolution demo --out demo

test: .venv/.test
	$(RUN) -m pytest -m "not slow and not long" -n 2 --dist loadfile

test-slow: setup
	$(RUN) -m pytest -m slow -n 2 --dist loadfile

# Style, types, licenses of the dependencies.
check: setup
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m pyright
	$(RUN) -m tools.licenses

# The paper's experiments, compared with its numbers: paper/report.html.
paper: setup
	$(RUN) -m evolution paper --out paper

# The documentation as a site: site/index.html.
docs: setup
	$(INSTALL) -e .[docs]
	NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --strict --quiet

# What README and docs say, measured in about an hour: docs/evidence.md. Installs every extra (PyTorch: 5 GB).
evidence: .venv/.all
	$(RUN) -m benchmarks.evidence

# Wheel and sdist, of a commit whose evidence was made from it: dist/.
release: setup
	$(RUN) -m benchmarks.evidence --check
	$(RUN) -m hatchling build

# The ready-made arenas that the package ships (see assets/README.md).
assets: setup
	$(RUN) -m tools.ready_made

clean:
	rm -rf .venv demo paper site build dist
