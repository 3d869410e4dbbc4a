# make demo   ants search a path beside A*; both drive it, certified and filmed
# make test   all tests but the long ones (make test-slow: the long ones)
# make docs   the site, with everything that its pages show: docs/_build/html/index.html
# make dist   wheel and sdist in dist/, checked in a fresh environment outside the checkout
# Everything else that these need they set up themselves, in .venv.
.DELETE_ON_ERROR:
.PHONY: demo test test-slow docs dist lint format bench mutants warm clean help

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

help:
	@sed -n '1,5s/^# //p' Makefile

# `make PYTHON=...` with another Python than that of $(VENV) sets it up anew; `make VENV=... PYTHON=...` keeps both.
ifneq ($(PYTHON),)
ifneq ($(shell $(PYTHON) -V 2>&1),$(shell $(BIN)/python -V 2>&1))
.PHONY: $(VENV)/.core
CLEAR := --clear
endif
endif

# The core; then, where much runs, the cache of all compiled kernels.
$(VENV)/.core: pyproject.toml tools/find-python
	@python=$$(tools/find-python) && echo "Setting up $(VENV) with $$python" && "$$python" -m venv $(CLEAR) $(VENV)
	@echo "Installing antdrive and what it needs"
	@$(PIP) install --editable .
	@touch $@

$(VENV)/.warm: $(VENV)/.core $(wildcard src/antdrive/*/_kernels*.py src/antdrive/*/*/_kernels*.py)
	@echo "Compiling the kernels, once"
	@$(BIN)/python -m antdrive warm
	@touch $@

$(VENV)/.dev: $(VENV)/.core
	@echo "Installing what the tests need"
	@$(PIP) install --editable '.[dev]'
	@touch $@

$(VENV)/.docs: $(VENV)/.core
	@$(BIN)/python -c 'import sys; sys.exit("The site needs Python 3.11, as Sphinx does. With python3.11 on the path: make clean docs" if sys.version_info < (3, 11) else 0)'
	@echo "Installing what the site needs"
	@$(PIP) install --editable '.[docs]'
	@touch $@

warm: $(VENV)/.warm

demo: $(VENV)/.core
	@$(BIN)/antdrive demo

test: $(VENV)/.dev $(VENV)/.warm
	@$(BIN)/python -m tools.loop $(BIN)/ruff check --quiet . -- $(BIN)/ruff format --quiet --check . -- \
		$(BIN)/mypy --no-error-summary -- $(BIN)/python -m pytest --numprocesses 2 --dist loadgroup

test-slow: $(VENV)/.dev $(VENV)/.warm
	@$(BIN)/python -m tools.loop $(BIN)/python -m pytest --numprocesses 2 --dist loadgroup -m slow

# A page runs again when it or the packages change. Both halves use a process for each core, four at most.
DEPTHS := * */* */*/* */*/*/*
SOURCES := $(foreach folder,src/antdrive,$(wildcard $(foreach depth,$(DEPTHS),$(folder)/$(depth).py $(folder)/$(depth).yaml)))
# `make docs JOBS=1` uses fewer.
JOBS ?= $(shell cores=$$(nproc 2>/dev/null || echo 2); [ "$$cores" -le 4 ] && echo "$$cores" || echo 4)

docs/_build/.pages: $(VENV)/.docs $(VENV)/.warm $(SOURCES) tools/pages.py $(wildcard docs/*.md docs/*/*.md docs/*/*/*.md examples/*/*.md)
	@$(BIN)/python -m tools.pages --jobs $(JOBS) $(if $(filter-out %.md,$?),,$?)
	@mkdir -p docs/_build && touch $@

docs/_build/.gallery: $(VENV)/.docs $(VENV)/.warm $(SOURCES)
	@rm -rf docs/_gallery
	@mkdir -p docs/_build && touch $@

docs: docs/_build/.pages docs/_build/.gallery
	@$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --nitpicky --quiet --jobs $(JOBS) -d docs/_build/doctrees docs docs/_build/html
	@$(BIN)/python -m tools.site docs/_build/html

# `build` makes the sdist, and the wheel from the sdist.
dist: $(VENV)/.core
	@$(PIP) install --editable '.[dist]'
	@rm -rf dist
	@$(BIN)/python -m build --outdir dist . >/dev/null
	@$(BIN)/python -m twine check --strict dist/*
	@$(BIN)/python -m tools.dist dist

lint: $(VENV)/.dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

format: $(VENV)/.dev
	@$(BIN)/ruff format .
	@$(BIN)/ruff check --fix .

bench: $(VENV)/.dev $(VENV)/.warm
	@$(BIN)/python -m benchmarks.loop
	@echo
	@$(BIN)/python -m benchmarks.exploring

mutants: $(VENV)/.dev $(VENV)/.warm
	@$(BIN)/python -m tools.mutants

clean:
	rm -rf .venv* .python out docs/_build docs/_gallery .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
