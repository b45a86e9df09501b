# `make` alone lists the targets.
PYTHON ?= python3
BIN := .venv/bin

help: ## list what one can do
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /|/' | while IFS='|' read -r name text; do printf '  make %-10s %s\n' "$$name" "$$text"; done

demo: .venv/ready ## the whole story: a simulated transducer measured and fitted after each gluing step
	$(BIN)/pzctl measure --fit

test: .venv/ready ## run the tests
	$(BIN)/pytest -n auto --dist worksteal

check: .venv/ready ## lint, format, types, floors
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright

bench: .venv/ready ## the benchmarks behind every figure we state
	$(BIN)/pytest --override-ini addopts=--import-mode=importlib -s tests/benchmarks

docs: .venv/ready ## what is generated from code (thesis, schemas, errors), and the guides as pages in build/site
	$(BIN)/python -P -c "from pzctl.models.thesis import page; print(page(), end='')" > docs/thesis.md
	$(BIN)/python docs/tools/schemas.py docs/schema
	$(BIN)/python docs/tools/errors_page.py docs/errors.md
	$(BIN)/mkdocs build --quiet

errors: .venv/ready ## run the tests and write down, in docs/errors.md, every sentence that one of them provokes
	rm -f docs/provoked.jsonl
	OPENBLAS_NUM_THREADS=1 PZCTL_PROVOKED=$(CURDIR)/docs/provoked.jsonl PYTHONPATH=$(CURDIR)/tests/support/provoked_by $(BIN)/pytest -n auto --dist worksteal
	$(BIN)/python docs/tools/errors_page.py docs/errors.md

pictures: .venv/ready ## the screenshots of page and terminal in docs/pictures, made anew by their tests
	PZCTL_SCREENSHOTS=docs/pictures $(BIN)/pytest -q tests/daemon/page/test_page_browser.py tests/daemon/cli/test_terminal.py -k "button or hand or left_out or picture"

clean: ## remove what the other targets made
	rm -rf .venv build dist *.egg-info .pytest_cache .ruff_cache .hypothesis .import_linter_cache

# Installed in place; a new pyproject.toml or constraints.txt installs again.
.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $@

.PHONY: help demo test check bench docs errors pictures clean
.DEFAULT_GOAL := help
