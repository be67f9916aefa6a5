# Each job does the set-up it needs first; that takes minutes once, and then about a second.
python := .venv/bin/python

help:
	@sed -n 's/^\([a-z]*\):.*## /make \1: /p' Makefile

demo: setup ## tensile tests of all four fabrics by the thesis's law and by the default one; see out/tensile
	$(python) demos/tensile.py --fabric all --angle all --law continuous potential --cells 9x3 --degree 1 --out out/tensile
	$(python) demos/thesis/closed_loops.py --loops 20000

thesis: setup ## chapter 7 of the thesis beside this code, in out/thesis/thesis.html; what has run before is kept
	$(python) demos/thesis/thesis.py

test: lint ## lint, then all tests but the slow ones, then the parallel ones again on 2 ranks
	$(python) -m pytest -n auto --maxprocesses 4 --dist worksteal -m "not slow"
	.venv/bin/mpirun -n 2 $(python) -m pytest -m parallel

slow: setup ## tests of whole studies and demos, which take some minutes
	$(python) -m pytest -n auto --maxprocesses 4 --dist worksteal -m slow

lint: setup ## ruff's rules and format, and the types of the package
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy

setup: ## .venv and the system libraries, if anything is missing
	@sh .setup/setup.sh

docs: setup ## theory, demos that are read from top to bottom, measured tables and the code, in out/docs
	$(python) .setup/pages.py

studies: setup ## what features cost, where the limits are, error against run time; tables and plots under out
	$(python) demos/studies/lean_scenes.py
	$(python) demos/studies/stability.py
	$(python) demos/studies/error_vs_runtime.py
	$(python) demos/studies/scaling.py --cells 10 20 40 80 --end 0.05

clean: ## remove .venv and the caches in this folder; results under out/ stay
	rm -rf .venv .cache build *.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

.PHONY: help demo thesis test slow lint docs studies setup clean
