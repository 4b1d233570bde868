# Everything a contributor runs. Needs git, make and a Python 3.11 to 3.14; all else goes into .venv, once.
# Another interpreter: make test PYTHON=python3.13

VENV := .venv
BIN := $(VENV)/bin

# The stamp carries the interpreter's name, so that another PYTHON= makes the environment anew.
MADE := $(if $(PYTHON),$(VENV)/made-with-$(subst /,_,$(PYTHON)),$(firstword $(wildcard $(VENV)/made-with-*) $(VENV)/made-with-any))

.DELETE_ON_ERROR:
.PHONY: help reproduce demo test bench check clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /\1|/p' $(firstword $(MAKEFILE_LIST)) | awk -F'|' '{ printf "  make %-9s %s\n", $$1, $$2 }'

demo: $(VENV)/installed ## solve the bundled survey with both methods and compare with the truth
	@$(BIN)/python scripts/demo.py

reproduce: $(VENV)/installed-positioning ## the paper's tables and figures, under results/reproduction; ARGS=--quick
	$(BIN)/python scripts/reproduce.py $(ARGS)

test: $(VENV)/installed-dev ## the whole suite, on all cores; ARGS="-k evaluate" for a part
	$(BIN)/python -m pytest -n auto $(ARGS)

bench: $(VENV)/installed-dev ## time and memory of every stage, written to docs/performance.md; ARGS="--sizes 18"
	@mkdir -p results
	$(BIN)/python -m pytest -c benchmarks/pytest.ini benchmarks --benchmark-json=results/benchmark.json $(ARGS)
	$(BIN)/python benchmarks/page.py results/benchmark.json docs/performance.md

check: $(VENV)/installed-dev ## format, lint, types, layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean: ## remove .venv, caches, builds and the demo's output
	rm -rf $(VENV) build dist *.egg-info out/paper-office-joint out/paper-office-sequential
	rm -rf .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(MADE):
	@sh scripts/make_venv.sh $(VENV) "$(PYTHON)"
	@rm -f $(VENV)/made-with-* $(VENV)/installed*
	@touch $@

# The stamp is written last: an interrupted installation is repeated.
$(VENV)/installed: pyproject.toml $(MADE)
	@echo "installing slam-uwb and what it needs into $(VENV) (once)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/installed-positioning: pyproject.toml $(MADE)
	@echo "installing slam-uwb with positioning into $(VENV) (once)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[positioning]'
	@touch $(VENV)/installed $@

$(VENV)/installed-dev: pyproject.toml $(MADE)
	@echo "installing slam-uwb and its development tools into $(VENV) (once)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $(VENV)/installed $(VENV)/installed-positioning $@
