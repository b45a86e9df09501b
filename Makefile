# `make` alone lists the targets.
PYTHON ?= python3
BIN := .venv/bin

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /|/' | while IFS='|' read -r name text; do printf '  make %-12s %s\n' "$$name" "$$text"; done

demo: .venv/installed ## demonstration: a simulated transducer, measured and fitted after each gluing step
	$(BIN)/pzctl measure --fit

# In a new clone two processes compile half of the tests each: otherwise every process of the run would compile all of them.
test: .venv/ready ## run the tests
	@test -d tests/__pycache__ || find tests -name 'test_*.py' -not -path 'tests/benchmarks/*' | xargs -P 2 -n 150 $(BIN)/pytest --collect-only -qq > /dev/null || true  # the run itself tells what cannot be collected
	$(BIN)/pytest -n auto --dist worksteal

check: .venv/ready ## lint, format, import contracts, types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright

test-long: .venv/ready ## run the tests that `make test` leaves out because they compute for long
	$(BIN)/pytest -n auto --dist worksteal -m long

bench: test-long ## these, and the benchmarks behind all stated figures
	$(BIN)/pytest --override-ini addopts=--import-mode=importlib -s tests/benchmarks

docs: .venv/ready ## pages generated from code (thesis, schemas, keys of files, errors, gallery), and the guides as web pages in build/site
	$(BIN)/python -P -c "from pzctl.models.thesis import page; print(page(), end='')" > docs/thesis.md
	$(BIN)/python docs/tools/schemas.py docs/schema
	$(BIN)/python docs/tools/files_page.py docs
	$(BIN)/python docs/tools/errors_page.py docs/errors.md
	$(BIN)/python docs/tools/gallery.py docs/gallery
	$(BIN)/mkdocs build --quiet

docs-version: docs ## put the guides of this version beside those of earlier ones, on the branch `pages` (for a web server)
	$(BIN)/mike deploy --config-file mkdocs-versions.yml --branch pages --update-aliases $$($(BIN)/pzctl --version | cut -d' ' -f2) latest
	$(BIN)/mike set-default --config-file mkdocs-versions.yml --branch pages latest

errors: .venv/ready ## run the tests and list in docs/errors.md every sentence that they provoke
	rm -f docs/provoked.jsonl
	OPENBLAS_NUM_THREADS=1 PZCTL_PROVOKED=$(CURDIR)/docs/provoked.jsonl PYTHONPATH=$(CURDIR)/tests/support/provoked_by $(BIN)/pytest -n auto --dist worksteal -m 'long or not long' --deselect tests/test_docs.py::test_nearly_every_sentence_is_provoked_by_a_test
	$(BIN)/python docs/tools/errors_page.py docs/errors.md
	$(BIN)/pytest -q tests/test_docs.py

pictures: .venv/ready ## regenerate the screenshots of page and terminal in docs/pictures
	PZCTL_SCREENSHOTS=docs/pictures $(BIN)/pytest -q tests/daemon/page/test_page_browser.py tests/daemon/cli/test_terminal.py -k "button or hand or missing_effect or picture"

clean: ## remove the output of the other targets
	rm -rf .venv build dist *.egg-info .pytest_cache .ruff_cache .hypothesis .import_linter_cache

# Installed in place; a new pyproject.toml or constraints.txt installs again. The demonstration needs no developers' tools.
.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[web]'
	@touch $@

.venv/ready: .venv/installed
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $@

.PHONY: help demo test check bench docs docs-version errors pictures clean
.DEFAULT_GOAL := help
