# Everything runs in a virtual environment of the repository's own, made on first use.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# For EnvPool, which needs it; `make bench PYTHON312=...` if it is elsewhere.
PYTHON312 ?= $(firstword $(wildcard $(HOME)/.pyenv/versions/3.12.*/bin/python3.12) python3.12)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# uv fetches packages side by side. pip, which follows a configuration of its own, is for where uv is not to be had, or
# fails. Python compiles a module when it is first imported; most of those that are installed never are. It has to keep
# what it compiled, which images of containers often forbid, or each process compiles for more than a second.
unexport PYTHONDONTWRITEBYTECODE
PIP_INSTALL := PYTHONWARNINGS=ignore $(BIN)/pip install -q --no-compile
install = $(BIN)/uv pip install -q --python $(BIN)/python $(1) 2>/dev/null || $(PIP_INSTALL) $(1)

# Runs a command as root where that is permitted without a password.
AS_ROOT := $(shell if [ "$$(id -u)" = 0 ]; then echo env; elif sudo -n true 2>/dev/null; then echo sudo -n; else echo false; fi)
APT_INSTALL = $(AS_ROOT) sh -c 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$$@" >/dev/null' apt

.PHONY: help explore learn curves results test test-only test-clients test-warp check lint types format docs datasets gallery build bench soak parity transfer clean peers gl
.DEFAULT_GOAL := help

help:  ## List the targets.
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

explore: $(VENV)/.explore gl  ## Film the expert at Push and say which files to open.
	$(BIN)/python explore.py --task push --policy expert --episodes 4 --output_dir output/explore

test: lint  ## Check the code and run the tests; types are checked meanwhile.
	@$(MAKE) --no-print-directory -j2 types test-only

test-only: $(VENV)/.test gl  ## Run the tests.
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

# Each client has an environment of its own; but Stable-Baselines3 and TorchRL share one with torch, which takes
# 6 GB, and Minari and OGBench another. LeRobot wants an older torch.
CLIENT_TEST := -m pytest -m clients tests/clients
test-clients: $(patsubst %,.venv-clients-%/.installed,acme acme-wrappers torch ray minari lerobot)  ## Install and run real clients.
	.venv-clients-acme/bin/python $(CLIENT_TEST)/test_acme.py
	PYTHONPATH=$(CURDIR)/tests/clients/stand_in .venv-clients-acme-wrappers/bin/python $(CLIENT_TEST)/test_acme.py
	MUJOCO_GL=disabled .venv-clients-torch/bin/python $(CLIENT_TEST)/test_sb3.py
	MUJOCO_GL=disabled .venv-clients-torch/bin/python $(CLIENT_TEST)/test_sb3_explorer.py
	MUJOCO_GL=disabled .venv-clients-torch/bin/python $(CLIENT_TEST)/test_rl_zoo.py
	MUJOCO_GL=disabled .venv-clients-torch/bin/python $(CLIENT_TEST)/test_videos.py
	MUJOCO_GL=disabled .venv-clients-torch/bin/python $(CLIENT_TEST)/test_torchrl.py
	.venv-clients-ray/bin/python $(CLIENT_TEST)/test_ray.py
	.venv-clients-minari/bin/python $(CLIENT_TEST)/test_minari.py
	.venv-clients-minari/bin/python $(CLIENT_TEST)/test_ogbench.py
	.venv-clients-minari/bin/python -m pytest tests/test_optional_packages.py
	.venv-clients-lerobot/bin/python $(CLIENT_TEST)/test_lerobot.py

test-warp: .venv-clients-warp/.installed  ## Test the batch on a device, here the processor; half an hour the first time.
	MUJOCO_GL=disabled .venv-clients-warp/bin/python -m pytest -m warp tests/accelerator

check: lint types  ## Lint and type-check; edits nothing.

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.test
	$(BIN)/mypy

format: $(VENV)/.test  ## Mend what the linter can mend, and format the code.
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.docs gl  ## Build the site of the documents in build/site, with a tutorial that it runs.
	rm -rf build/site build/doctrees docs/generated
	$(BIN)/python -m sphinx -W --keep-going -d build/doctrees docs build/site
	@echo "open build/site/index.html"

gallery: $(VENV)/.explore gl  ## Make the animations of the experts in docs; a minute.
	$(BIN)/python docs/make_gallery.py

learn: $(VENV)/.learn  ## Learn Push from nothing; some minutes.
	$(BIN)/python -m fetch_composer.learning --task push --output_dir output/learn_push

curves: $(VENV)/.learn  ## Learn every task with three seeds, for docs/learning.md; most of a day.
	$(BIN)/python -m docs.make_curves

results: $(VENV)/.explore  ## Make the standard evaluations for docs/results.md; some minutes.
	MUJOCO_GL=disabled $(BIN)/python -m docs.make_results

datasets: $(VENV)/.datasets  ## Make datasets of graded skill for docs/datasets.md; half an hour, 5 GB.
	MUJOCO_GL=disabled $(BIN)/python -m docs.make_datasets $(DATASETS_OPTIONS)

build: $(VENV)/.build  ## Build wheel and sdist, and load the task from each in a clean environment.
	rm -rf build dist
	$(BIN)/python -m build --outdir dist . >/dev/null
	set -e; for package in dist/*.whl dist/*.tar.gz; do \
	  rm -rf build/clean; $(PYTHON) -m venv build/clean; \
	  build/clean/bin/pip install -q "$$package" $(LABMAZE); \
	  (cd build && MUJOCO_GL=disabled clean/bin/python -c \
	    "from fetch_composer import suite; print(suite.load('fetch', 'push').reset().observation['observation'])"); \
	  echo "$$package works"; \
	done

bench: $(VENV)/.bench peers  ## Measure speed beside Gymnasium-Robotics and EnvPool; about ten minutes.
	$(BIN)/python -m benchmarks $(PEERS) --write docs/speed.md README.md $(BENCH_OPTIONS)

SOAK_OPTIONS ?=
DATASETS_OPTIONS ?=
soak: $(VENV)/.test  ## Try hostile input for an hour, for docs/reliability.md.
	$(BIN)/python -m tests.hostile --write docs/reliability.md $(SOAK_OPTIONS)

parity: $(VENV)/.test .venv-gymnasium_robotics_current/.ready  ## Compare trajectories with Gymnasium-Robotics, live.
	$(BIN)/python -m benchmarks.parity --peer .venv-gymnasium_robotics_current/bin/python --write docs/conventions.md

transfer: $(VENV)/.test .venv-gymnasium_robotics_current/.ready  ## Run the trained policies in Gymnasium-Robotics.
	MUJOCO_GL=disabled $(BIN)/python -m benchmarks.transfer --peer .venv-gymnasium_robotics_current/bin/python --write docs/policies.md

clean:  ## Remove everything that was made, the virtual environments included.
	rm -rf $(VENV) $(PEER_VENVS) .venv-clients-* build dist output docs/generated *.egg-info stand_ins/*/build stand_ins/*/*.egg-info .pytest_cache .ruff_cache .mypy_cache

# On Python 3.13, for which labmaze has no wheel, an empty package stands in for it.
LABMAZE = $(shell $(PYTHON) -c 'import sys; print("./stand_ins/labmaze" if sys.version_info >= (3, 13) else "")')

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || \
	  { echo "Python 3.10 to 3.13 is needed: make PYTHON=python3.12 ..."; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || $(APT_INSTALL) python3-venv || \
	  { echo "venv is missing; run: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PIP_INSTALL) uv || true
	$(if $(LABMAZE),$(call install,$(LABMAZE)))

$(VENV)/.explore: $(BIN)/python setup.py
	$(call install,-e '.[explore]')
	@touch $@

$(VENV)/.learn: $(BIN)/python setup.py
	$(call install,-e '.[learn]')
	@touch $@

$(VENV)/.datasets: $(BIN)/python setup.py
	$(call install,-e '.[minari]')
	@touch $@

$(VENV)/.docs: $(BIN)/python setup.py
	$(call install,-e '.[docs]')
	@touch $@

$(VENV)/.test: $(BIN)/python setup.py
	$(call install,-e '.[test]')
	@touch $@

$(VENV)/.bench: $(VENV)/.test
	$(call install,-e '.[ray]')
	@touch $@

.venv-clients-acme/.installed: EXTRA = [acme]
.venv-clients-torch/.installed: EXTRA = [explore,sbx,zoo,torchrl]
.venv-clients-ray/.installed: EXTRA = [ray]
.venv-clients-minari/.installed: EXTRA = [minari,ogbench,learn]
.venv-clients-lerobot/.installed: EXTRA = [lerobot]
.venv-clients-warp/.installed: EXTRA = [warp,learn]
.venv-clients-%/.installed: setup.py
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/pip install -q pytest -e '.$(EXTRA)'
	@touch $@

# Acme 0.4.0 pins a dm-launchpad that is not on PyPI, hence --no-deps and a stand-in.
.venv-clients-acme-wrappers/.installed: setup.py
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/pip install -q --no-deps dm-acme==0.4.0
	$(@D)/bin/pip install -q pytest -e . 'numpy<2' dm-tree gym==0.26.2 pillow
	@touch $@

$(VENV)/.build: $(BIN)/python
	$(call install,build)
	@touch $@

# What the benchmarks compare with, each in a virtual environment of its own. What cannot be installed is skipped.
PEER_NAMES := gymnasium_robotics envpool
PEER_VENVS := $(PEER_NAMES:%=.venv-%)
PEERS = $(foreach peer,$(PEER_NAMES),--$(peer)=.venv-$(peer)/bin/python)
BENCH_OPTIONS ?=

peers:
	@for venv in $(PEER_VENVS); do \
	  $(MAKE) --no-print-directory $$venv/.ready || { rm -rf $$venv; echo "SKIPPED: $$venv"; }; \
	done

.venv-envpool/.ready: PEER_PYTHON = $(PYTHON312)
.venv-%/.ready: PEER_PYTHON ?= $(PYTHON)
.venv-%/.ready: benchmarks/peers/%.txt
	rm -rf $(@D)
	$(PEER_PYTHON) -m venv $(@D)
	$(@D)/bin/pip install -q -r $<
	@touch $@

# Pictures need EGL or OSMesa. Without permission to install one, everything else still works.
gl:
	@ldconfig -p | grep -qE 'libEGL\.so\.1|libOSMesa\.so' || \
	  $(APT_INSTALL) libegl1 libgl1-mesa-dri || \
	  echo "No EGL and no OSMesa: for pictures run apt-get install libegl1 libgl1-mesa-dri"
