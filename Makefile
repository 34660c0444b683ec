# Needs Python 3 and make alone; uv is brought into .tools/ where the machine has none.
UV := $(shell command -v uv 2>/dev/null || echo .tools/uv/bin/uv)

.PHONY: run test check uv

run: | uv
	$(UV) run navfw run office lobby-to-lab

test: check
	$(UV) run pytest -n auto

check: | uv
	$(UV) run ruff check
	$(UV) run ruff format --check
	$(UV) run mypy
	$(UV) run lint-imports

uv:
	@command -v $(UV) >/dev/null || { python3 -m venv .tools/uv && .tools/uv/bin/python -m pip install -q uv; }
