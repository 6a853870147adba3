# Everything runs in .venv; the first target that needs it makes it. The steps stand in tools/make.py, which needs
# no make: `python tools/make.py demo` does what `make demo` does, also on Windows.
PYTHON ?= python3
STEP := @$(PYTHON) tools/make.py

.PHONY: setup demo test test-slow check mutants bench figures paper docs assets clean

setup:
	$(STEP) setup

demo:
	$(STEP) demo

test:
	$(STEP) test

test-slow:
	$(STEP) test-slow

check:
	$(STEP) check

# Break the code in small ways and count what no test notices; continues where it was stopped. AGAIN=1: survivors
# only; SHARE=0.3: a sample.
mutants:
	$(STEP) mutants $(if $(AGAIN),--again) $(if $(SHARE),--share $(SHARE))

# All benchmarks, then the tables of README and docs; QUICK=1: small sizes, into benchmarks/results/quick.
bench:
	$(STEP) bench $(if $(QUICK),--quick)

# The tables of README and docs from the results that exist.
figures:
	$(STEP) figures

paper:
	$(STEP) paper

# The documentation as a site: site/index.html.
docs:
	$(STEP) docs

# Make the ready-made arenas that the package ships again (see assets/README.md).
assets:
	$(STEP) assets

clean:
	$(STEP) clean
