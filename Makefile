# Needs Python 3 and make alone; uv is brought into .tools/ where the machine has none.
UV := $(shell uv --version >/dev/null 2>&1 && echo uv || echo .tools/uv/bin/uv)

# the Pythons that have wheels of all libraries; uv brings one where the machine has none
export UV_PYTHON ?= >=3.11,<3.14

# some hundred processes import the same modules: they must find them compiled
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test test-ros check kernels coverage docs uv

# what the README's commands need, without the tools of those who develop navfw; what is there stays
run: | uv
	@echo "navfw run office lobby-to-lab"
	@$(UV) run --no-dev --group project --extra sim --extra video navfw run office lobby-to-lab
	@echo; echo "next, once in each terminal: source .venv/bin/activate; then navfw --help"

# the checks leave a core idle: the kernels are compiled beside them
test: | uv
	@$(MAKE) --no-print-directory --jobs=2 check kernels
	$(UV) run pytest -n auto --maxprocesses 4 --dist worksteal $(PYTEST_OPTIONS)

# by the wheels of ROS 2, in an environment of their own: uv cannot take them out of one again
test-ros: | uv
	UV_PROJECT_ENVIRONMENT=.venv-ros $(UV) run --group ros pytest $(or $(PYTEST_OPTIONS),tests/ros)

# of the robot's rooms, with a floor (pyproject.toml), and a line for each room; tracing doubles the time
coverage: | uv
	$(UV) run pytest -n auto --maxprocesses 4 --dist worksteal --cov -m 'not slow'
	@mkdir -p dist
	$(UV) run python tests/helpers/room_coverage.py | tee dist/coverage.txt

check: | uv
	$(UV) run ruff check
	$(UV) run ruff format --check
	$(UV) run mypy
	$(UV) run lint-imports
	$(UV) run python tests/helpers/line_budget.py

kernels: | uv
	$(UV) run navfw warm --quiet

# the site of the documentation, in dist/site
docs: | uv
	$(UV) run --group docs python docs/build_site.py

# by venv, or by pip alone: Debian's Python may lack either
uv:
	@$(UV) --version >/dev/null 2>&1 || { echo "bringing uv into .tools/uv"; rm -rf .tools/uv; \
	python3 -m venv .tools/uv >/dev/null 2>&1 && .tools/uv/bin/python -m pip install -q uv; } || \
	{ rm -rf .tools/uv; python3 -m pip install -q --target .tools/uv uv; } || \
	{ echo "uv could not be installed: install uv, python3-venv or python3-pip" >&2; exit 1; }
