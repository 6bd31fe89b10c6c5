# make run                        the paper's analysis in small, and a diagnosis, in 8
#                                 minutes on two cores
# make photos FOLDER=my_photos    train on your photos or video, and diagnose the result
# make poses FOLDER=my_scan       check the cameras that came with photos, and adjust them;
#                                 nothing is trained
# make judge PHOTOS=images RENDERS=renders CAMERAS=sparse/0
#                                 diagnose renders of another program, or a splat:
#                                 SPLAT=model.ply instead of RENDERS
# make export SCENE=my_photos     write photos, cameras and points for other programs
#
# Options: OPTIONS="--name x"; `make photos OPTIONS=--help` lists those of photos.
# CORES=2 limits the cores, VERBOSE=1 shows all output. More commands: make help-all
#
# make show                 print the tables and verdicts of finished runs
# make table1               make a table of the paper; SCENE=fox_small: of one scene.
#                           OPTIONS=-n counts the jobs, CONFIG=my.yaml takes your config
# make table2               the same of Table 2
# make table3               the same of Table 3
# make table4               the same of Table 4
# make figures              draw the paper's figures
# make tradeoff             compare what settings cost and bring
# make paper                make all of these
# make comparison           compare all methods on all scenes
# make preview              print what a run will cost
# make cluster              install plugins for Slurm, Kubernetes and S3
# make clean                delete the results of this program, and no other files
# make check                run the tests that a change reaches, for a minute
# make test                 run the tests
# make tools                run the slow tests: whole programs, packaging, browser
# make lint                 check the format and the style of code and workflow
# make bench                measure speed, into results/bench/
# make peers PEERS=folder   compare with the code that the papers' authors released
# make torture              try to break it for 20 minutes: bad files, links, kills
# make docs                 rebuild the tables and figures of docs/ from docs/measured/
# make site                 build docs/ as a website, in site/
# make lock                 pin the versions of all packages again (needs uv)
# make help                 list the commands for users
# make help-all             list all commands
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CORES ?= $(shell nproc 2>/dev/null || sysctl -n hw.ncpu)
export PATH := $(abspath $(BIN)):$(PATH)
# JUDGE and POSES: as the options of these commands were called before.
OPTIONS ?= $(JUDGE)$(POSES)
# Of Snakemake's, called alike.
TARGETS := table1 table2 table3 table4 figures tradeoff paper comparison preview
# What a user gives is handed on by its value alone: exported as it is, make would expand
# it, and `$(shell ...)` in a folder's name would run.
unexport FOLDER SCENE WIDTH CONFIG PHOTOS RENDERS SPLAT CAMERAS DEPTH OPTIONS JUDGE POSES PEER PEERS BENCH TORTURE

# `exec`: who ends make by a signal ends the program, and not a shell around it alone.
.DEFAULT_GOAL := help
.PHONY: help help-all run show photos poses judge export $(TARGETS) check test tools bench peers torture docs site lint cluster lock clean

help:
	@sed -n '/^# make show/q; s/^# \{0,1\}//p' $(firstword $(MAKEFILE_LIST))

help-all:
	@sed -n '/^[^#]/q; s/^# \{0,1\}//p' $(firstword $(MAKEFILE_LIST))

run: $(VENV)/.installed
	@exec python -m alignerf.cli.demo --cores $(CORES)

show: $(VENV)/.installed
	@python -m alignerf.show

# By the environment: a shell would see more than a name in some names. PHOTOS, which is
# `make judge`'s, is taken for FOLDER.
photos: export PHOTOS_FOLDER := $(if $(value FOLDER),$(value FOLDER),$(value PHOTOS))
photos: $(VENV)/.installed
	$(if $(value FOLDER),$(if $(value PHOTOS),@echo 'error: PHOTOS beside FOLDER: options go into OPTIONS="--name x"'; exit 1))
	@exec python -m alignerf.cli --cores $(CORES) $(OPTIONS) -- "$$PHOTOS_FOLDER"

poses: export POSED_FOLDER := $(value FOLDER)
poses: $(VENV)/.installed
	@exec python -m alignerf.cli.poses $(OPTIONS) -- "$$POSED_FOLDER"

judge: export JUDGED_PHOTOS := $(value PHOTOS)
judge: export JUDGED_RENDERS := $(value RENDERS)
judge: export JUDGED_SPLAT := $(value SPLAT)
judge: export JUDGED_CAMERAS := $(value CAMERAS)
judge: export JUDGED_DEPTH := $(value DEPTH)
judge: $(VENV)/.installed
	@exec python -m alignerf.cli.judge --cores $(CORES) "--photos=$$JUDGED_PHOTOS" \
		"--renders=$$JUDGED_RENDERS" "--splat=$$JUDGED_SPLAT" "--cameras=$$JUDGED_CAMERAS" \
		"--depth=$$JUDGED_DEPTH" $(OPTIONS)

export: export EXPORT_OF := $(value SCENE)$(value FOLDER)
export: export EXPORT_WIDTH := $(value WIDTH)
export: $(VENV)/.installed
	@exec python -m alignerf.cli.export --cores $(CORES) \
		$(if $(value WIDTH),"--width=$$EXPORT_WIDTH") $(OPTIONS) -- "$$EXPORT_OF"

$(TARGETS): export ASKED_CONFIG := $(value CONFIG)
$(TARGETS): export ASKED_SCENE := $(value SCENE)
$(TARGETS): $(VENV)/.installed
	@exec python -m snakemake --cores $(CORES) $(if $(value CONFIG),--configfile "$$ASKED_CONFIG") \
		$(OPTIONS) -- $@ $(if $(value SCENE),"$$ASKED_SCENE")

# What others add; benchmarks, the torture and the packaging; the page in a browser, and
# of a long list of damaged files.
TOOLS := tools tests/extension tests/test_packaging.py
TOOLS += tests/alignerf/page/test_browser.py tests/alignerf/page/test_damaged.py

check: $(VENV)/.installed
	@files="$$(python -m tests.reached $(TOOLS))" && ALIGNERF_SECONDS=60 \
		pytest -q -n 2 -m "not whole" $$files

test: $(VENV)/.installed
	@pytest -n 2 --dist worksteal -m "not whole" $(TOOLS:%=--ignore=%)

tools: $(VENV)/.installed
	@pytest -n 2 --dist worksteal $(TOOLS)
	@pytest -n 2 --dist worksteal -m whole $(TOOLS:%=--ignore=%)

bench: $(VENV)/.installed
	@python -m tools.bench.speed $(if $(PEER),--peer $(PEER)) $(BENCH)

peers: $(VENV)/.installed
	@ALIGNERF_OPTIMISED=1 ALIGNERF_MULTINERF="$(wildcard $(PEERS)/multinerf)" \
		ALIGNERF_MIPNERF="$(wildcard $(PEERS)/mipnerf)" \
		ALIGNERF_NERFPLUSPLUS="$(wildcard $(PEERS)/nerfplusplus)" \
		ALIGNERF_BARF="$(wildcard $(PEERS)/bundle-adjusting-NeRF)" \
		pytest -n0 -q tests/alignerf/mipnerf360/test_multinerf_model.py \
		tests/alignerf/systems/test_official.py

torture: $(VENV)/.installed
	@TORTURE_CASES=300 TORTURE_SEED=$$(date +%Y%m%d) \
		pytest -n 2 --dist worksteal tools/torture $(TORTURE)

docs: $(VENV)/.installed
	@python -m tools.docs.tables
	@python -m tools.docs.figures

site: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--require-hashes -r requirements-site.lock
	@python -m tools.docs.site

lint: $(VENV)/.installed
	ruff format --check .
	ruff check .
	snakefmt --check Snakefile workflow
	snakemake --lint

cluster: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--require-hashes -r requirements-cluster.lock

# Made anew when the pins change; marked whole only once all is installed.
$(VENV)/.installed: requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "error: CPython 3.11 or newer is needed: make PYTHON=python3.x"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--require-hashes -r requirements.lock
	@touch $@

lock:
	uv pip compile pyproject.toml --extra train --extra dev --universal --python-version 3.11 \
		--fork-strategy fewest --no-annotate --no-header --generate-hashes \
		--output-file requirements.lock
	uv pip compile pyproject.toml --extra train --extra cluster --universal --python-version 3.11 \
		--fork-strategy fewest --no-annotate --no-header --generate-hashes \
		--constraint requirements.lock --output-file requirements-cluster.lock
	printf '%s\n' properdocs properdocs-theme-mkdocs | uv pip compile - \
		--universal --python-version 3.11 --fork-strategy fewest \
		--no-annotate --no-header --generate-hashes \
		--constraint requirements.lock --output-file requirements-site.lock
	@$(MAKE) --no-print-directory environment.yml

# The pins of the lock, with what they are for, and without their hashes.
environment.yml: requirements.lock
	@head="$$(sed '/ pip:$$/q' $@)" && { echo "$$head"; sed -n 's/ *\\$$//; s/^[a-z].*==/      - &/p' $<; } > $@

# Nothing is installed for it.
clean:
	@if [ -e $(VENV)/.installed ]; then exec python -m alignerf.cli.clean; \
	else echo "no packages in $(VENV): type why-blurry clean, where it is installed"; fi
