# The commands of README.md. On a fresh machine they need make and Python 3.10 or later with its venv module.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
YARDSTICKS := $(VENV)/.yardsticks
PYTEST = $(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist worksteal

# Of 'make fuzz': for how long, the run's number, and single cases, as it reports them, instead.
SECONDS ?= 600
SEED ?= 0
CASE ?=

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install demo test test-thorough test-drivers fuzz lint docs notebook gallery bench paper release clean

help:
	@echo "make demo     reconstruct the bundled photograph; the results go to demo-output/"
	@echo "make test     run the tests"
	@echo "make test-thorough  run those too that repeat a proof, in another precision, say, or with narrower vectors"
	@echo "make test-drivers  run the tests of the kernels on other drivers and emulated processors (Debian, Ubuntu)"
	@echo "make fuzz     random files and calls; SECONDS=600 SEED=0 tell how long and which, CASE=image:7 runs one again"
	@echo "make lint     check style, types and which module imports which"
	@echo "make docs     build the handbook, in .cache/site"
	@echo "make notebook  run the handbook's notebook, and keep what it shows"
	@echo "make gallery  make the surfaces and the pictures of docs/gallery.md (NAMES=coin)"
	@echo "make bench    measure speed and accuracy; the results go to bench-output/"
	@echo "make paper    do the paper's experiments again; the results go to paper-output/"
	@echo "make release  build the files of a release, and try them with every Python that is here"
	@echo "make install  only prepare $(VENV), which every command above does by itself"
	@echo "make clean    delete $(VENV) and everything that these commands made"
	@echo "PYTHON=/path/to/python3 picks another Python (now: $(PYTHON))"

install: $(INSTALLED)

$(INSTALLED): pyproject.toml
	@echo "Installing into $(VENV), which takes about two minutes, or longer over a slow connection."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable '.[dev]'
	touch $@

demo: $(INSTALLED)
	$(BIN)/persfs-cl demo

test: $(INSTALLED)
	$(PYTEST)

test-thorough: $(INSTALLED)
	$(PYTEST) --thorough

fuzz: $(INSTALLED)
	cd tests && ../$(BIN)/python -m fuzz --seconds $(SECONDS) --seed $(SEED) $(addprefix --case ,$(CASE))

# Installs drivers where it may, as root.
test-drivers: $(INSTALLED)
	bash .ci/test-drivers

lint: $(INSTALLED)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --cache-dir .cache/import-linter

# Without its theme's notes on other products, and without a network.
docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "The handbook: .cache/site/index.html"

notebook: $(INSTALLED)
	$(BIN)/python docs/site/run_notebook.py docs/notebooks/first-steps.ipynb

gallery: $(INSTALLED)
	$(BIN)/python docs/site/gallery.py $(NAMES)

bench: $(YARDSTICKS)
	$(BIN)/persfs-cl bench

$(YARDSTICKS): $(INSTALLED)
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable '.[bench]'
	touch $@

paper: $(INSTALLED)
	$(BIN)/persfs-cl paper

release: $(INSTALLED)
	bash .ci/release

clean:
	rm -rf $(VENV) .cache dist build demo-output bench-output paper-output .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find persfs_cl tests -name __pycache__ -prune -exec rm -rf {} +
